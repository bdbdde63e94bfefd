"""How the program ends, and what it says then."""

from __future__ import annotations

import json
import math
import threading
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from replay import __version__, synonyms
from replay.arguments import command_parser
from replay.commands import COMMANDS
from tests import bags
from tests.bags import write_mcap
from tests.program import Program, in_process_of_its_own
from tests.runs import bare_room, growing, in_log_order, seen, two_robots


def test_done(replay: Program, two: Path) -> None:
    ran = replay.merge(two)
    assert (ran.status, ran.statuses) == (0, {"r1": "reference", "r2": "merged"})


def test_the_table_has_a_row_a_robot(replay: Program, tmp_path: Path) -> None:
    messages = in_log_order(growing("r1"), growing("r2"), [seen("r3", 30.0, bare_room())])
    ran = replay.merge(write_mcap(tmp_path / "run.mcap", messages))
    head, *rows = (line.split() for line in ran.out.splitlines())
    assert head[:2] == ["robot", "status"]
    assert [row[:2] for row in rows] == [["r1", "reference"], ["r2", "merged"], ["r3", "unmerged"]]
    pose = ran.robots["r2"]["merged_from_map"]
    yaw_deg = math.degrees(pose["yaw_rad"])
    assert rows[1][2:5] == [f"{pose['x_m']:.2f}", f"{pose['y_m']:.2f}", f"{yaw_deg:.1f}"]
    assert rows[2][2:5] == ["–", "–", "–"]
    for robot, line in zip(ran.robots.values(), ran.out.splitlines()[1:], strict=True):
        assert line.rstrip().endswith(robot["reason"]["message"])


def test_no_progress_bar_without_a_terminal(replay: Program, two: Path) -> None:
    ran = replay.merge(two)
    assert "\x1b" not in ran.out + ran.err
    assert "━" not in ran.err


def test_json_prints_the_report_and_nothing_else(replay: Program, two: Path) -> None:
    ran = replay.merge(two, "--json")
    assert ran.out == ran.report_path.read_text(encoding="utf-8")
    assert json.loads(ran.out)["schema"] == "replay.report/1"


def test_require_all(replay: Program, two: Path, tmp_path: Path) -> None:
    assert replay.merge(two, "--require-all").status == 0
    other = write_mcap(tmp_path / "run.mcap", [*growing("r1"), seen("r2", 30.0, bare_room())])
    assert replay.merge(other).status == 0
    ran = replay.merge(other, "--require-all")
    assert (ran.status, ran.statuses["r2"]) == (1, "unmerged")
    assert ran.mcap.exists()


def test_require_all_is_not_met_by_one_robot_alone(replay: Program, tmp_path: Path) -> None:
    run = write_mcap(tmp_path / "run.mcap", growing("r1"))
    assert replay.merge(run).status == 0
    assert replay.merge(run, "--require-all", "--force").status == 1


def test_require_all_counts_a_robot_without_a_map(replay: Program, tmp_path: Path) -> None:
    messages = [*growing("r1"), seen("r2", 3.0, resolution=0.0)]
    ran = replay.merge(write_mcap(tmp_path / "run.mcap", messages), "--require-all")
    assert (ran.status, ran.statuses["r2"]) == (1, "no_map")


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ((), "a command is missing; expected one of merge, info"),
        (("merge",), "RUN is missing; expected one recording or more"),
        (("info",), "such as `replay info run.mcap`"),
        (("fly", "run.mcap"), "fly: there is no such command; expected one of merge, info"),
        (("merg", "run.mcap"), "merg: there is no such command; did you mean merge?"),
        (("run.mcap",), "to merge: replay merge run.mcap"),
        (("merge", "run.mcap", "--nonsense"), "unrecognized arguments: --nonsense; `replay merge --help` lists"),
        (("merge", "run.mcap", "--robot", "r1"), "did you mean --robots?"),
        (("merge", "run.mcap", "--cloc", "log"), "did you mean --clock?"),
        (("merge", "run.mcap", "--start-offset", "5"), "did you mean --start?"),
        (("merge", "run.mcap", "--silent"), "did you mean --quiet?"),
        (("merge", "run.mcap", "--min-overlap", "4"), "did you mean --set merge.verify.min_overlap_m2=…?"),
        (("inspect", "run.mcap"), "did you mean info?"),
        (("halp",), "there is no such command"),
        (("merge", "run.mcap", "--clock", "sundial"), "--clock: 'sundial' is none of header, log;"),
        (("merge", "run.mcap", "--images", "change"), "is none of none, changed, all; did you mean changed?"),
    ],
)
def test_flags_that_are_none(replay: Program, arguments: tuple[str, ...], expected: str) -> None:
    ran = replay(*arguments)
    assert ran.status == 2
    assert expected in ran.error


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("--robots", "r1,,r2"), "--robots r1,,r2: expected names"),
        (("--robots", "r1,r1"), "each once"),
        (("--start", "noon"), "--start: 'noon' is no time"),
        (("--stop", "1.2.3"), "--stop: '1.2.3' is no number of seconds"),
        (("--reorder-window", "-1"), "--reorder-window: '-1' is no number of seconds"),
        (("--every", "inf"), "--every: 'inf' is no number of seconds"),
        (("-o", "out.bag"), "ends in .mcap"),
    ],
)
def test_values_that_are_none(replay: Program, two: Path, arguments: tuple[str, ...], expected: str) -> None:
    ran = replay("merge", two, *arguments)
    assert ran.status == 2
    assert expected in ran.error
    assert not list(replay.folder.iterdir())


def test_start_after_stop(replay: Program, two: Path) -> None:
    ran = replay.merge(two, "--start", "20", "--stop", "10")
    assert ran.status == 2
    assert "--stop" in ran.error


def test_a_bug_ends_with_a_status_and_a_word(replay: Program, two: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object, **__: object) -> None:
        raise ZeroDivisionError("as a bug would")

    monkeypatch.setattr("mapmerge.merger.Merger.step", broken)
    ran = replay.merge(two)
    assert ran.status == 3
    assert "ZeroDivisionError" in ran.err
    assert f"a bug in replay {__version__}" in ran.err.splitlines()[-1]
    assert not list(replay.folder.iterdir())


@pytest.mark.parametrize("jobs", [1, 2])
@pytest.mark.parametrize(
    "where",
    [
        "replay.sources.mcap.chunk_reader.message_data",
        "replay.sinks.mcap_file.McapSink._tick",
        "replay.feeds.assemble",
        "replay.sinks.json_file.report_text",
    ],
)
def test_a_bug_in_any_thread(
    replay: Program, two: Path, monkeypatch: pytest.MonkeyPatch, where: str, jobs: int
) -> None:
    def broken(*_: object, **__: object) -> None:
        raise ZeroDivisionError("as a bug would")

    monkeypatch.setattr(where, broken)
    ran = replay("merge", two, "-o", "out.mcap", "--jobs", jobs)
    assert ran.status == 3
    assert "ZeroDivisionError: as a bug would" in ran.err
    assert "please report it" in ran.err.splitlines()[-1]
    assert not list(replay.folder.iterdir())
    assert not {each.name for each in threading.enumerate()} & {"reader", "writer", "rrd"}


def no_memory_for_python(*_: object, **__: object) -> object:
    raise MemoryError


def no_memory_for_numpy(*_: object, **__: object) -> object:
    return np.zeros((1 << 31, 1 << 31), np.uint8)


@pytest.mark.parametrize("jobs", [1, 2])
@pytest.mark.parametrize(
    ("where", "expected"),
    [
        ("mapmerge.merger.Merger.step", "the maps of r"),
        ("replay.gallery.Gallery.due", "the maps of r"),
        ("replay.feeds.assemble", "there is not enough memory"),
    ],
)
@pytest.mark.parametrize("greedy", [no_memory_for_python, no_memory_for_numpy])
def test_too_little_memory_is_no_bug(
    replay: Program,
    two: Path,
    monkeypatch: pytest.MonkeyPatch,
    where: str,
    expected: str,
    greedy: Callable[..., object],
    jobs: int,
) -> None:
    monkeypatch.setattr(where, greedy)
    ran = replay("merge", two, "-o", "out.mcap", "--jobs", jobs)
    assert ran.status == 2
    last = ran.err.splitlines()[-1]
    assert last.startswith(f"replay: error: {expected}")
    assert "not enough memory" in last
    assert "--max-memory SIZE" in last
    assert "Traceback" not in ran.err
    assert not list(replay.folder.iterdir())


@pytest.mark.parametrize(("code", "status"), [(cv2.Error.StsNoMem, 2), (cv2.Error.StsAssert, 3)])
def test_errors_of_opencv_are_bugs_but_for_memory(
    replay: Program, two: Path, monkeypatch: pytest.MonkeyPatch, code: int, status: int
) -> None:
    def broken(*_: object, **__: object) -> None:
        error = cv2.error("OpenCV said so")
        error.code = code
        raise error

    monkeypatch.setattr("mapmerge.merger.Merger.step", broken)
    ran = replay.merge(two)
    assert ran.status == status
    assert ("Traceback" in ran.err, "please report it" in ran.err) == (status == 3, status == 3)
    assert not list(replay.folder.iterdir())


def test_a_recording_that_is_damaged_in_the_middle(replay: Program, tmp_path: Path) -> None:
    run = write_mcap(tmp_path / "run.mcap", two_robots())
    bags.damage(run, bags.chunks(run)[-2])
    ran = replay.merge(run, "--strict")
    assert ran.status == 2
    assert ran.err.splitlines()[-1].startswith("replay: error: run.mcap: the chunk at byte")
    assert list(tmp_path.iterdir()) == [run]


class TestInfo:
    def test_says_what_would_be_merged(self, replay: Program, two: Path) -> None:
        ran = replay("info", two)
        assert (ran.status, ran.err) == (0, "")
        assert ran.out.splitlines()[-1] == "would be merged: r2 (/r2/map) into r1 (/r1/map), the reference"
        alone = replay("info", two, "--robots", "r2").out.splitlines()[-1]
        assert alone == "there is only one map, r2 (/r2/map): nothing to merge it with"

    def test_says_why_nothing_would(self, replay: Program, two: Path) -> None:
        ran = replay("info", two, "--robots", "r9")
        assert ran.status == 0
        assert "nothing would be merged: there is no map of robot 'r9'" in ran.out.splitlines()[-1]

    def test_what_is_no_recording(self, replay: Program, tmp_path: Path) -> None:
        (tmp_path / "notes.txt").write_text("dear diary")
        for path in ("notes.txt", "nowhere.bag", "."):
            ran = replay("info", path)
            assert ran.status == 2
            assert ran.error


def test_as_a_process(two: Path, tmp_path: Path) -> None:
    done = in_process_of_its_own("merge", two, "--no-rrd", "--images", "none", "--json", cwd=tmp_path)
    assert (done.returncode, json.loads(done.stdout)["reference"]) == (0, "r1")
    again = in_process_of_its_own("merge", two, "--no-rrd", cwd=tmp_path)
    assert (again.returncode, again.stdout, again.stderr.count("\n")) == (2, "", 1)


def test_version(replay: Program) -> None:
    assert replay("--version").out == f"replay {__version__}\n"


def test_what_others_call_it_is_called_something_here() -> None:
    flags = {
        flag for name in COMMANDS for _, action in command_parser(name).grouped() for flag in action.option_strings
    }
    assert set(synonyms.FLAGS.values()) <= flags
    assert set(synonyms.COMMANDS.values()) <= {*COMMANDS, "--help", "--version"}
    assert not set(synonyms.COMMANDS) & set(COMMANDS)


def test_help_is_a_word_as_well(replay: Program) -> None:
    assert replay("help").out == replay("--help").out
    assert replay("help", "info").out == replay("info", "--help").out
