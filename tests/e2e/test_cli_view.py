"""Looking at recordings and at runs: what is refused, what the viewer is told, and that a run does not depend on it."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import signal
import socket
import stat
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from threading import Thread
from typing import Any

import pytest

from replay import viewer
from replay.errors import InputError, OutputError, UsageError
from replay.sinks.rerun_stream import TIMELINE
from tests.program import Program, in_process_of_its_own, quiet
from tests.renderer import needs_renderer
from tests.rrd import contents

POSIX = pytest.mark.skipif(sys.platform == "win32", reason="a shell script stands for the viewer")
LINUX = pytest.mark.skipif(sys.platform != "linux", reason="there is a screen wherever there is a window system")


@pytest.fixture
def screen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DISPLAY", ":9")


@pytest.fixture
def rrd(tmp_path: Path) -> Path:
    path = tmp_path / "run.rrd"
    path.write_bytes(b"RRF2" + bytes(20))
    return path


def stand_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, script: str) -> None:
    """Let a script be the viewer."""
    path = tmp_path / "stand_in"
    path.write_text(f"#!/bin/sh\n{script}\n", encoding="utf-8")
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setattr(viewer, "program", lambda: path)


# Viewing


@POSIX
@pytest.mark.usefixtures("screen")
def test_all_recordings_are_given_to_a_viewer_that_is_off_the_network(
    replay: Program, tmp_path: Path, rrd: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    told = tmp_path / "told"
    stand_in(tmp_path, monkeypatch, f'echo "$@" > {told}; env >> {told}')
    assert replay("view", rrd, rrd).status == 0
    arguments, *variables = told.read_text(encoding="utf-8").splitlines()
    assert arguments.split() == ["--bind", "127.0.0.1", str(rrd), str(rrd), "--port", "auto"]
    assert {"CI=1", "HTTPS_PROXY=http://127.0.0.1:9"} <= set(variables)
    assert f"HOME={os.environ['HOME']}" in variables


@POSIX
@pytest.mark.usefixtures("screen")
def test_what_the_viewer_fails_of_is_said(
    replay: Program, tmp_path: Path, rrd: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stand_in(tmp_path, monkeypatch, 'echo "Error: no graphics adapter was found" >&2; echo bye; exit 4')
    done = replay("view", rrd)
    assert done.status == 3
    assert done.error == "the viewer ended with status 4: Error: no graphics adapter was found"


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("none.rrd", None, "it does not exist"),
        ("map.yaml", b"image: map.pgm", "neither a Rerun recording nor an MCAP"),
        ("empty.rrd", b"", "neither a Rerun recording nor an MCAP"),
    ],
)
def test_what_is_no_recording_is_refused(
    replay: Program, tmp_path: Path, name: str, content: bytes | None, says: str
) -> None:
    if content is not None:
        (tmp_path / name).write_bytes(content)
    done = replay("view", tmp_path / name)
    assert done.status == 2
    assert says in done.error
    assert name in done.error


def test_a_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="this is no file"):
        viewer.view([tmp_path])


@LINUX
def test_without_a_screen_it_is_said_what_to_do(
    replay: Program, two: Path, rrd: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    done = replay("view", rrd)
    assert done.status == 2
    assert "there is no screen here" in done.error
    assert f"rerun {rrd} --web-viewer" in done.error
    done = replay("merge", two, "--view", "-o", replay.folder / "out.mcap")
    assert done.status == 2
    assert "leave --view out" in done.error
    assert not (replay.folder / "out.mcap").exists()


def test_a_recording_that_is_not_written_cannot_be_viewed(replay: Program, two: Path) -> None:
    done = replay("merge", two, "--view", "--no-rrd", "-o", replay.folder / "out.mcap")
    assert done.status == 2
    assert "--view shows the Rerun recording, which is not written" in done.error


def test_the_viewer_comes_with_the_library(monkeypatch: pytest.MonkeyPatch) -> None:
    assert viewer.program().is_file()
    monkeypatch.setattr(viewer, "find_spec", lambda _: None)
    with pytest.raises(UsageError, match="not installed"):
        viewer.program()


@POSIX
@pytest.mark.usefixtures("screen")
def test_a_viewer_that_does_not_start_ends_the_run_before_it_begins(
    replay: Program, two: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stand_in(tmp_path, monkeypatch, 'echo "Error: no window" >&2; exit 1')
    done = replay("merge", two, "--view", "-o", replay.folder / "out.mcap")
    assert done.status == 3
    assert "the viewer does not start: Error: no window" in done.err
    assert not list(replay.folder.glob("out.*"))


@POSIX
@pytest.mark.usefixtures("screen")
def test_one_that_cannot_be_started_is_an_error(tmp_path: Path, rrd: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(viewer, "program", lambda: tmp_path / "none")
    with pytest.raises(OutputError, match="cannot be started"):
        viewer.view([rrd])


@LINUX
def test_names_are_those_of_a_shell_where_a_command_is_told(
    replay: Program, rrd: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    shutil.copy(rrd, tmp_path / "a run; ls.rrd")
    said = replay("view", "a run; ls.rrd").error
    command, *arguments = shlex.split(said.partition("in a browser: ")[2])
    assert Path(command).name == "rerun"
    assert arguments[:2] == ["a run; ls.rrd", "--web-viewer"]


@POSIX
@pytest.mark.usefixtures("screen")
@pytest.mark.parametrize("command", ["view", "merge"])
def test_an_interrupt_while_the_viewer_starts_ends_it(
    replay: Program, two: Path, rrd: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    note = tmp_path / "pid"
    stand_in(tmp_path, monkeypatch, f'echo $$ > "{note}.new"; mv "{note}.new" "{note}"; exec sleep 60')

    def interrupt() -> None:
        wait_until(note.exists, lambda: "the viewer was not started")
        os.kill(os.getpid(), signal.SIGINT)

    Thread(target=interrupt, daemon=True).start()
    done = replay(*(("view", rrd) if command == "view" else ("merge", two, "--view", "-o", "out.mcap")))
    assert done.status == 130
    with pytest.raises(ProcessLookupError):
        os.kill(int(note.read_text()), 0)


# Live


SHOWING_NOBODY = """
import os, sys
from replay import cli, viewer
viewer.open_live = lambda: viewer.live_address(int(sys.argv[1]))
status = cli.main(sys.argv[2:])
sys.exit("RUST_LOG is left behind" if "RUST_LOG" in os.environ else status)
"""


def test_a_viewer_that_is_gone_does_not_matter(replay: Program, two: Path) -> None:
    """The run ends and says nothing of it, and its outputs are those of a run without."""
    folder = replay.folder
    with socket.socket() as nobody:
        nobody.bind(("127.0.0.1", 0))
        port = nobody.getsockname()[1]
        command = [sys.executable, "-c", SHOWING_NOBODY, port, "merge", two, "--view", "-o", folder / "live.mcap"]
        environment = {name: value for name, value in quiet().items() if name != "RUST_LOG"}
        live = subprocess.run(
            [*map(str, command), "--images", "none"],
            env={**environment, "DISPLAY": ":9"},
            capture_output=True,
            text=True,
            timeout=120,
        )
    assert live.returncode == 0, live.stderr
    alone = in_process_of_its_own("merge", two, "-o", folder / "alone.mcap", "--images", "none")
    assert alone.returncode == 0, alone.stderr
    assert without_times(live.stderr) == without_times(alone.stderr.replace("alone.", "live."))
    assert contents(folder / "live.rrd") == contents(folder / "alone.rrd")
    for kind in ("mcap", "json"):
        assert (folder / f"live.{kind}").read_bytes() == (folder / f"alone.{kind}").read_bytes()


def without_times(said: str) -> str:
    return re.sub(r"\d+\.\d+ s", "… s", said)


def test_a_viewer_shows_the_run(replay: Program, two: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    needs_renderer()
    from scripts.screenshot import complaints
    from scripts.screenshot import viewer as headless

    monkeypatch.setenv("DISPLAY", ":9")
    folder = replay.folder
    with headless("1000x700") as client:
        monkeypatch.setattr(viewer, "open_live", lambda: client.url)
        assert replay("merge", two, "--view", "-o", folder / "live.mcap", "--images", "changed").status == 0
        wait_until(lambda: shows_a_run(client.get_state()), client.get_state)
        assert complaints(client) == []
    assert replay("merge", two, "-o", folder / "alone.mcap", "--images", "changed").status == 0
    assert contents(folder / "live.rrd") == contents(folder / "alone.rrd")


def shows_a_run(state: Any) -> bool:
    """Tell whether a viewer has loaded a recording of some length, and shows its views."""
    if state.loading or not state.recordings:
        return False
    timelines = [each for each in state.recordings[0].timelines if each.name == TIMELINE]
    views = {view.name for view in state.views}
    return any(each.end > each.start for each in timelines) and {"Maps", "Outcome", "Overlay"} <= views


def wait_until(is_so: Callable[[], bool], found: Callable[[], object]) -> None:
    for _ in range(300):
        if is_so():
            return
        time.sleep(0.1)
    raise AssertionError(found())
