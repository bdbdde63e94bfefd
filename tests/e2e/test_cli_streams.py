"""Standard output and standard error that cannot be written, that nobody reads, or that lack characters."""

from __future__ import annotations

import json
import os
import subprocess
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.bags import write_mcap
from tests.program import PROGRAM, quiet
from tests.runs import growing, seen

MERGE = ("-o", "out.mcap", "--no-rrd", "--images", "none")
COMMANDS = {
    "merge": ("merge", MERGE),
    "merge --json": ("merge", (*MERGE, "--json")),
    "info": ("info", ()),
    "recover": ("recover", ("-o", "out.mcap")),
}
WRITTEN = {"merge": {"out.json", "out.mcap"}, "info": set(), "recover": {"out.mcap"}}

needs_full = pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no device that is always full")
needs_shell = pytest.mark.skipif(os.name == "nt", reason="descriptors are closed by a POSIX shell")


@contextmanager
def nobody() -> Iterator[int]:
    """Return the end of a pipe that nobody reads."""
    reading, writing = os.pipe()
    os.close(reading)
    try:
        yield writing
    finally:
        os.close(writing)


@contextmanager
def full() -> Iterator[int]:
    descriptor = os.open("/dev/full", os.O_WRONLY)
    try:
        yield descriptor
    finally:
        os.close(descriptor)


STREAMS = {"nobody": nobody, "full": full}


def run(
    command: str, path: Path, folder: Path, *more: str, stdout: int = subprocess.PIPE, stderr: int = subprocess.PIPE
) -> subprocess.CompletedProcess[str]:
    name, arguments = COMMANDS[command]
    return subprocess.run(
        [*PROGRAM, name, path, *arguments, *more],
        cwd=folder,
        env=quiet(),
        text=True,
        stdout=stdout,
        stderr=stderr,
        timeout=60,
    )


def names(folder: Path) -> set[str]:
    return {each.name for each in folder.iterdir()}


@needs_full
@pytest.mark.parametrize("command", ["merge", "merge --json", "info"])
def test_output_that_cannot_be_printed(two: Path, tmp_path: Path, command: str) -> None:
    with full() as stream:
        done = run(command, two, tmp_path, stdout=stream)
    assert done.returncode == 3
    assert done.stderr.splitlines()[-1] == (
        "replay: error: standard output: cannot be written: No space left on device"
    )
    assert names(tmp_path) == WRITTEN[COMMANDS[command][0]]


@pytest.mark.parametrize("command", COMMANDS)
def test_nobody_reads_the_output(two: Path, tmp_path: Path, command: str) -> None:
    with nobody() as stream:
        done = run(command, two, tmp_path, stdout=stream)
    assert done.returncode == 0
    assert "Traceback" not in done.stderr
    assert "BrokenPipe" not in done.stderr
    assert names(tmp_path) == WRITTEN[COMMANDS[command][0]]


@pytest.mark.parametrize("command", ["merge", "merge --json"])
def test_the_status_is_the_same_if_nobody_reads_the_output(tmp_path: Path, command: str) -> None:
    path = write_mcap(tmp_path / "run.mcap", growing("r1"))
    with nobody() as stream:
        assert run(command, path, tmp_path, "--require-all", stdout=stream).returncode == 1


@needs_full
@pytest.mark.parametrize("stream", STREAMS)
@pytest.mark.parametrize("command", COMMANDS)
def test_standard_error_that_cannot_be_written_costs_nothing(
    two: Path, tmp_path: Path, command: str, stream: str
) -> None:
    expected = run(command, two, tmp_path)
    written = {each.name: each.read_bytes() for each in tmp_path.iterdir()}
    for each in tmp_path.iterdir():
        each.unlink()
    with STREAMS[stream]() as descriptor:
        done = run(command, two, tmp_path, stderr=descriptor)
    assert (done.returncode, done.stdout) == (0, expected.stdout)
    assert {each.name: each.read_bytes() for each in tmp_path.iterdir()} == written


@needs_full
@pytest.mark.parametrize("stream", STREAMS)
@pytest.mark.parametrize("arguments", [("info", "nowhere.mcap"), ("fly",)])
def test_an_error_that_cannot_be_said_has_its_status(tmp_path: Path, stream: str, arguments: tuple[str, ...]) -> None:
    with STREAMS[stream]() as descriptor:
        done = subprocess.run([*PROGRAM, *arguments], cwd=tmp_path, env=quiet(), stderr=descriptor, timeout=60)
    assert done.returncode == 2


@needs_shell
@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("closed", [">&-", "2>&-", "<&- >&- 2>&-"])
def test_streams_that_are_closed_cost_nothing(two: Path, tmp_path: Path, command: str, closed: str) -> None:
    name, arguments = COMMANDS[command]
    shell = ["sh", "-c", f'"$@" {closed}', "sh", *PROGRAM, name, str(two), *arguments]
    done = subprocess.run(shell, cwd=tmp_path, env=quiet(), text=True, capture_output=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    assert names(tmp_path) == WRITTEN[name]
    if name == "merge":
        json.loads((tmp_path / "out.json").read_text("utf-8"))


@needs_shell
def test_an_error_is_not_printed_as_output_where_there_is_no_standard_error(tmp_path: Path) -> None:
    shell = ["sh", "-c", '"$@" 2>&-', "sh", *PROGRAM, "info", "nowhere.mcap"]
    done = subprocess.run(shell, cwd=tmp_path, env=quiet(), text=True, capture_output=True, timeout=60)
    assert (done.returncode, done.stdout) == (2, "")


@pytest.mark.parametrize("command", COMMANDS)
def test_streams_that_know_no_more_than_ascii(tmp_path: Path, command: str) -> None:
    path = write_mcap(tmp_path / "run.mcap", [seen("r1", 0.0, topic="/größe/map"), seen("r2", 1.0)])
    name, arguments = COMMANDS[command]
    done = subprocess.run(
        [*PROGRAM, name, path, *arguments],
        cwd=tmp_path,
        env={**quiet(), "PYTHONIOENCODING": "ascii"},
        capture_output=True,
        timeout=60,
    )
    said = (done.stdout + done.stderr).decode("ascii")
    assert done.returncode == 0, said
    if command == "merge --json":
        assert json.loads(done.stdout) == json.loads((tmp_path / "out.json").read_text("utf-8"))
    elif name != "recover":
        assert "gr\\xf6\\xdfe" in said


def test_what_programs_read_is_whole_where_streams_know_no_more_than_ascii(tmp_path: Path) -> None:
    """Escapes of Python are none of JSON or TOML."""
    robots = ("größe", "𝄞")
    runs = [tmp_path / name for name in ("a.json", "b.json")]
    path = write_mcap(tmp_path / "run.mcap", [seen("r1", 0.0, topic="/größe/map"), seen("r2", 1.0, topic="/𝄞/map")])
    (tmp_path / "truth.json").write_text(
        json.dumps({"reference": robots[0], "robots": {robots[1]: {"same_place": False}}}), encoding="utf-8"
    )
    (tmp_path / "expect.yaml").write_text("robots: {größe: {status: reference}}\n", encoding="utf-8")

    def said(*arguments: object) -> bytes:
        asked = {**quiet(), "PYTHONIOENCODING": "ascii"}
        done = subprocess.run([*PROGRAM, *arguments], cwd=tmp_path, env=asked, capture_output=True, timeout=60)
        assert done.returncode in (0, 1), done.stderr
        assert done.stdout.isascii()
        return done.stdout

    for run_path, order in zip(runs, (robots, robots[::-1]), strict=True):
        report = json.loads(
            said("merge", path, "-o", run_path.with_suffix(".mcap"), *MERGE[2:], "--json", "--robots", ",".join(order))
        )
        assert report == json.loads(run_path.read_text("utf-8"))
        assert set(report["robots"]) == set(robots)
    assert {item["map_topic"] for item in json.loads(said("info", path, "--json"))["robots"]} == {
        f"/{robot}/map" for robot in robots
    }
    assert "größe" in str(json.loads(said("compare", *runs, "--json")))
    assert "𝄞" in str(json.loads(said("evaluate", runs[0], "--truth", "truth.json", "--json")))
    assert set(json.loads(said("check", path, "--expect", "expect.yaml", "--json"))["robots"]) == set(robots)
    settings = tomllib.loads(said("config", "--robots", ",".join(robots)).decode("ascii"))
    assert settings["robots"] == list(robots)
