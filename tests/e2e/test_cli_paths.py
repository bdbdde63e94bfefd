"""Paths that no file can have, that lead nowhere or in a circle, and files that are none."""

from __future__ import annotations

import os
import stat
import subprocess
from pathlib import Path

import pytest

from tests.bags import write_mcap, write_rosbag2
from tests.program import PROGRAM, Program, quiet
from tests.runs import two_robots

LONG = "n" * 300
MERGE = ("--no-rrd", "--images", "none")
COMMANDS = {"merge": MERGE, "info": (), "recover": ()}

needs_posix = pytest.mark.skipif(os.name == "nt", reason="there are no such files, links or names there")


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("name", [f"{LONG}.mcap", f"{LONG}/run.mcap", f"r1={LONG}.mcap"])
def test_an_input_with_too_long_a_name(replay: Program, command: str, name: str) -> None:
    ran = replay(command, name, *COMMANDS[command], *(() if command == "info" else ("-o", "out.mcap")))
    assert ran.status == 2
    assert "File name too long" in ran.error
    assert not list(replay.folder.iterdir())


@pytest.mark.parametrize("command", ["merge", "recover"])
@pytest.mark.parametrize("name", [f"{LONG}.mcap", f"{LONG}/out.mcap"])
def test_an_output_with_too_long_a_name(replay: Program, two: Path, command: str, name: str) -> None:
    ran = replay(command, two, *COMMANDS[command], "-o", name)
    assert ran.status == 3
    assert "File name too long" in ran.error
    assert not list(replay.folder.iterdir())


@pytest.fixture
def circle(tmp_path: Path) -> str:
    (tmp_path / "a").symlink_to("b")
    (tmp_path / "b").symlink_to("a")
    return "a"


@needs_posix
@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("name", ["{}", "{}/run.mcap"])
def test_an_input_by_links_in_a_circle(replay: Program, circle: str, command: str, name: str) -> None:
    ran = replay(command, name.format(circle), *COMMANDS[command])
    assert ran.status == 2
    assert ran.error.startswith(f"{name.format(circle)}: ")


@needs_posix
@pytest.mark.parametrize("command", ["merge", "recover"])
@pytest.mark.parametrize("more", [(), ("--force",)])
def test_an_output_by_links_in_a_circle(
    replay: Program, two: Path, circle: str, command: str, more: tuple[str, ...]
) -> None:
    (replay.folder / "out.mcap").symlink_to("out.mcap")
    for name in (f"{circle}/out.mcap", "out.mcap"):
        ran = replay(command, two, *COMMANDS[command], "-o", name, *more)
        assert ran.status == 3
        assert ran.error == f"{name}: its links lead in a circle; give another path"


@needs_posix
@pytest.mark.parametrize("command", ["merge", "recover"])
def test_a_link_that_leads_nowhere_is_not_replaced(replay: Program, two: Path, tmp_path: Path, command: str) -> None:
    for name in ("out.mcap", "out.json", "out.rrd"):
        (tmp_path / name).symlink_to("nowhere")
        ran = replay(command, two, *COMMANDS[command], "-o", "out.mcap")
        assert ran.status == 2
        assert ran.error.startswith(f"{name}: this is a link, which no output replaces")
        assert [each.name for each in tmp_path.iterdir()] == [name]
        assert (tmp_path / name).is_symlink()
        (tmp_path / name).unlink()


@needs_posix
@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("is_input_there", [True, False])
def test_the_current_folder_is_gone(two: Path, tmp_path: Path, command: str, is_input_there: bool) -> None:
    gone = tmp_path / "gone"
    gone.mkdir()
    shell = ["sh", "-c", 'rmdir "$PWD"; exec "$@"', "sh", *PROGRAM]
    run = str(two) if is_input_there else "run.mcap"
    root = str(Path(__file__).parents[2])
    environment = {**quiet(), "PYTHONPATH": root}
    done = subprocess.run([*shell, command, run], cwd=gone, env=environment, text=True, capture_output=True, timeout=60)
    if command == "info" and is_input_there:
        assert done.returncode == 0, done.stderr
        return
    assert done.returncode in (2, 3)
    (line,) = [each for each in done.stderr.splitlines() if not each.startswith("sh:")]
    assert line.startswith("replay: error: ")
    assert "the current folder is no longer there" in line or "it does not exist" in line


@needs_posix
@pytest.mark.parametrize("command", COMMANDS)
def test_a_pipe_is_not_waited_for(tmp_path: Path, command: str) -> None:
    os.mkfifo(tmp_path / "run.mcap")
    done = subprocess.run(
        [*PROGRAM, command, "run.mcap"], cwd=tmp_path, env=quiet(), text=True, capture_output=True, timeout=60
    )
    assert done.returncode == 2
    assert "this is no regular file" in done.stderr


@needs_posix
def test_metadata_that_is_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    bag = write_rosbag2(tmp_path / "bag", two_robots(), "mcap")
    (bag / "metadata.yaml").unlink()
    os.mkfifo(bag / "metadata.yaml")
    done = subprocess.run(
        [*PROGRAM, "info", bag], cwd=tmp_path, env=quiet(), text=True, capture_output=True, timeout=60
    )
    assert done.returncode == 0, done.stderr
    assert "no regular file" in done.stdout


@pytest.mark.skipif(os.name == "nt" or os.uname().sysname == "Darwin", reason="names there are always Unicode")
@pytest.mark.parametrize("command", ["merge", "recover"])
def test_names_that_are_not_utf_8(replay: Program, tmp_path: Path, command: str) -> None:
    strange = os.fsdecode(b"\xff.mcap")
    write_mcap(tmp_path / strange, two_robots())
    arguments = ("--images", "none") if command == "merge" else ()
    ran = replay(command, strange, *arguments, "-o", os.fsdecode(b"out\xfe.mcap"))
    assert ran.status == 0, ran.err
    written = {os.fsencode(each.name) for each in tmp_path.iterdir()} - {b"\xff.mcap"}
    suffixes = (b".mcap", b".rrd", b".json") if command == "merge" else (b".mcap",)
    assert written == {b"out\xfe" + suffix for suffix in suffixes}


@pytest.fixture(params=["pipe", "link", "link to a pipe", "device"])
def taken(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """A name that no file has; nothing may replace it, nor wait for it."""
    path = tmp_path / "taken"
    if request.param == "pipe":
        os.mkfifo(path)
    elif request.param == "device":
        try:
            os.mknod(path, stat.S_IFCHR | 0o600, os.makedev(1, 3))
        except PermissionError:
            pytest.skip("only root makes devices")
    else:
        other = tmp_path / "other"
        os.mkfifo(other) if "pipe" in request.param else other.write_text("mine")
        path.symlink_to(other)
    return path.name


@needs_posix
@pytest.mark.parametrize(
    ("ending", "command"),
    [
        (".mcap", "merge {run} -o taken.mcap --force --no-rrd --images none"),
        (".rrd", "merge {run} -o taken.mcap --force --no-rrd --images none"),
        (".json", "merge {run} -o taken.mcap --force --no-rrd --images none"),
        (".html", "merge {run} -o o.mcap --report taken.html --force --no-rrd --images none"),
        (".mcap", "recover {run} -o taken.mcap --force"),
        ("", "export {out} --to tf -o taken --force"),
        (".pgm", "export {out} -o taken --force"),
        (".xml", "check {out} --expect e.yaml --junit taken.xml"),
        (".yaml", "check {out} --write-expect taken.yaml --force"),
        (".md", "check {out} --expect e.yaml --summary taken.md"),
    ],
)
def test_what_is_no_file_is_neither_replaced_nor_opened(
    two: Path, outcome: Path, tmp_path: Path, taken: str, ending: str, command: str
) -> None:
    path = (tmp_path / taken).rename(tmp_path / f"taken{ending}")
    (tmp_path / "e.yaml").write_text("robots: {r2: merged}")
    before = path.lstat()
    arguments = command.format(run=two, out=outcome).split()
    done = subprocess.run([*PROGRAM, *arguments], cwd=tmp_path, env=quiet(), text=True, capture_output=True, timeout=60)
    after = path.lstat()
    assert (after.st_ino, after.st_mode, after.st_size) == (before.st_ino, before.st_mode, before.st_size)
    if ending == ".md" and path.is_file():  # appended to, where it leads to
        assert "expectation holds" in (tmp_path / "other").read_text()
        return
    assert done.returncode == 2, done.stderr
    assert done.stderr.startswith(f"replay: error: {path.name}: this is ")
    assert sorted(each.name for each in tmp_path.iterdir() if each.name != "other") == sorted(["e.yaml", path.name])


@needs_posix
@pytest.mark.parametrize("ending", [".mcap.partial", ".json.replaced", ".mcap.recovering"])
def test_names_that_are_taken_meanwhile_are_refused_at_the_start(
    replay: Program, two: Path, tmp_path: Path, ending: str
) -> None:
    name = f"out{ending}"
    os.mkfifo(tmp_path / name)
    flags = (*MERGE, "-o", "out.mcap", "--force")
    assert replay("merge", two, *flags).error.startswith(f"{name}: this is a device, a pipe or the like")
    (tmp_path / name).unlink()
    (tmp_path / name).mkdir()
    assert replay("merge", two, *flags).error == f"{name}: a folder has this name; remove it, or give another name"
    assert [each.name for each in tmp_path.iterdir()] == [name]


@needs_posix
@pytest.mark.parametrize("name", ["/dev/null", "/dev/stdout"])
@pytest.mark.parametrize("flag", ["--junit", "--summary"])
def test_findings_are_not_written_to_devices(replay: Program, outcome: Path, name: str, flag: str) -> None:
    (replay.folder / "e.yaml").write_text("robots: {r2: merged}")
    before = Path(name).lstat()
    ran = replay("check", outcome, "--expect", "e.yaml", flag, name)
    assert Path(name).lstat().st_ino == before.st_ino
    if ran.status:  # where standard output is a file, it is appended to as any
        assert ran.error.startswith(f"{name}: this is ")
        assert ran.error.endswith(", and print that afterwards")


def test_outputs_of_settings_with_names_that_no_file_can_have(replay: Program, two: Path) -> None:
    (replay.folder / "s.toml").write_text('[outputs]\noutput = "a\\u0000b.mcap"\n')
    ran = replay("merge", two, "--config", "s.toml")
    assert (ran.status, ran.error) == (3, "a\\x00b.mcap: no file can have this name; give another")
