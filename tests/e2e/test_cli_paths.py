"""Paths that no file can have, that lead nowhere or in a circle, and files that are none."""

from __future__ import annotations

import os
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
        assert f"there is already {name}" in ran.error
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
