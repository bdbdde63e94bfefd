"""Ends that come from outside: interrupted, terminated, nobody listening."""

from __future__ import annotations

import os
import signal
import subprocess
from pathlib import Path
from typing import Any

import pytest

from replay.interrupts import NUMBERS
from replay.sinks.partial_file import PartialFile
from replay.sources.mcap.file import McapFile
from tests.bags import write_mcap
from tests.program import PROGRAM, Program, quiet, started, wait_for
from tests.runs import flat_map, seen

# A shell shows 130 for both. Python ends itself with the signal, whatever the program returns, if it was running code
# that is made at run time, such as a dataclass.
INTERRUPTED = (130, -signal.SIGINT)


@pytest.fixture(scope="module")
def long_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording that takes long to merge: each map says something new."""
    messages = [
        seen(robot, index, flat_map(robot, 7.0 + 2.0 * (index % 2))) for index in range(150) for robot in ("r1", "r2")
    ]
    return write_mcap(tmp_path_factory.mktemp("long") / "long.mcap", messages)


@pytest.mark.parametrize("jobs", [1, 2])
@pytest.mark.parametrize("number", NUMBERS)
def test_interrupted(long_run: Path, tmp_path: Path, number: signal.Signals, jobs: int) -> None:
    process = started("merge", long_run, "-o", "out.mcap", "--no-rrd", "--jobs", jobs, cwd=tmp_path)
    wait_for(tmp_path / "out.mcap.partial", process)
    process.send_signal(number)
    out, err = process.communicate(timeout=30)
    assert process.returncode in INTERRUPTED
    assert out == ""
    assert err.splitlines()[-1] == "replay: interrupted; nothing was written"
    assert "Traceback" not in err
    assert not list(tmp_path.iterdir())


def test_interrupted_leaves_what_was_there(long_run: Path, tmp_path: Path) -> None:
    for name in ("out.mcap", "out.json"):
        (tmp_path / name).write_text("of an earlier run")
    process = started("merge", long_run, "-o", "out.mcap", "--no-rrd", "--force", cwd=tmp_path)
    wait_for(tmp_path / "out.mcap.partial", process)
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=30)
    assert process.returncode in INTERRUPTED
    assert {each.name: each.read_text() for each in tmp_path.iterdir()} == {
        "out.mcap": "of an earlier run",
        "out.json": "of an earlier run",
    }


def test_what_is_ignored_stays_ignored(two: Path, tmp_path: Path) -> None:
    """As under nohup."""
    process = subprocess.Popen(
        ["nohup", *PROGRAM, "merge", two, "-o", "out.mcap", "--no-rrd"],
        cwd=tmp_path,
        env=quiet(),
        text=True,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    wait_for(tmp_path / "out.mcap.partial", process)
    process.send_signal(signal.SIGHUP)
    process.communicate(timeout=30)
    assert process.returncode == 0
    assert (tmp_path / "out.json").exists()


@pytest.mark.parametrize("number", NUMBERS)
def test_while_a_file_is_made_it_is_known_to_be_there(
    replay: Program, two: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: signal.Signals
) -> None:
    make = os.open

    def interrupted(path: Any, flags: int, *more: int) -> int:
        made = make(path, flags, *more)
        if str(path).endswith("out.json.partial"):
            signal.raise_signal(number)
        return made

    monkeypatch.setattr(os, "open", interrupted)
    ran = replay.merge(two)
    assert ran.status == 130
    assert ran.err.splitlines()[-1] == "replay: interrupted; nothing was written"
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("number", NUMBERS)
def test_while_final_names_are_given_all_are(
    replay: Program, two: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: signal.Signals
) -> None:
    """What takes no time is not left half done."""
    rename = PartialFile.publish

    def interrupted(self: PartialFile) -> None:
        rename(self)
        signal.raise_signal(number)

    monkeypatch.setattr(PartialFile, "publish", interrupted)
    assert replay.merge(two).status == 0
    assert sorted(each.name for each in tmp_path.iterdir()) == ["out.json", "out.mcap"]


def test_interrupted_when_all_is_written_says_so(replay: Program, two: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("replay.sinks.terminal_table.table_text", interrupted)
    ran = replay.merge(two)
    assert ran.status == 130
    assert ran.err.splitlines()[-1] == "replay: interrupted; the outputs are written"
    assert ran.mcap.exists()


def test_interrupted_while_the_inputs_are_closed_says_so(
    replay: Program, two: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    close = McapFile.close

    def interrupted(self: McapFile) -> None:
        close(self)
        if (replay.folder / "out.json").exists():
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(McapFile, "close", interrupted)
    ran = replay.merge(two)
    assert ran.status == 130
    assert ran.err.splitlines()[-1] == "replay: interrupted; the outputs are written"
    assert ran.mcap.exists()
