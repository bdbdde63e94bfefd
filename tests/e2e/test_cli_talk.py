"""How much is said, and how: --quiet, --verbose, --color, and a table that fits."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

from replay.colours import are_on
from replay.commands import COMMANDS
from replay.sinks.terminal_table import table_text
from tests.bags import write_mcap
from tests.data_paths import ROOT
from tests.program import Program
from tests.runs import at, bare_room, growing, in_log_order, seen, two_robots

SAMPLE = ROOT / "samples" / "two_robots.mcap"
COLOUR = "\x1b[32m"


@pytest.fixture
def run(tmp_path: Path) -> Path:
    return write_mcap(tmp_path / "run.mcap", in_log_order(*[two_robots()]))


class Terminal:
    """A stream that says it leads to a terminal."""

    def __init__(self, columns: int, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setenv("COLUMNS", str(columns))
        monkeypatch.setenv("TERM", "xterm-256color")
        monkeypatch.delenv("NO_COLOR", raising=False)
        monkeypatch.setattr(sys.stdout, "isatty", lambda: True)


def test_quiet_says_nothing(replay: Program, run: Path) -> None:
    ran = replay.merge(run, "-q")
    assert (ran.status, ran.out, ran.err) == (0, "", "")
    assert ran.statuses == {"r1": "reference", "r2": "merged"}


def test_quiet_prints_what_was_asked_for(replay: Program, run: Path) -> None:
    ran = replay.merge(run, "--quiet", "--json")
    assert ran.out == ran.report_path.read_text(encoding="utf-8")
    assert ran.err == ""


def test_quiet_tells_errors(replay: Program, tmp_path: Path) -> None:
    assert "nothing.bag" in replay.merge(tmp_path / "nothing.bag", "-q").error


def test_quiet_does_not_hide_a_status(replay: Program, tmp_path: Path) -> None:
    alone = write_mcap(tmp_path / "alone.mcap", [seen("r1", 0.0), seen("r3", 1.0, bare_room())])
    ran = replay.merge(alone, "-q", "--require-all")
    assert (ran.status, ran.out) == (1, "")
    assert ran.err == "replay: not merged: r3; --require-all makes that a failure\n"


def test_one_map_alone_is_said_to_be_merged_with_nothing(replay: Program, run: Path) -> None:
    said = "there is only one map, r1 (/r1/map): nothing to merge it with"
    assert said in replay.merge(run, "--robots", "r1").err
    assert "only one map" not in replay.merge(run, "--robots", "r1,r2", "--force").err


def test_names_are_said_as_they_are(replay: Program, tmp_path: Path) -> None:
    run = write_mcap(tmp_path / "run.mcap", growing("r1", topic="/:bus:/map"))
    ran = replay("merge", run, "-o", "out:bus:[bold].mcap", "--no-rrd")
    assert "wrote out:bus:[bold].mcap" in ran.err
    assert "only one map, :bus: (/:bus:/map)" in ran.err
    assert ran.out.splitlines()[1].startswith(":bus:  reference")


def test_help_fits_the_terminal(replay: Program, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "60")
    for command in COMMANDS:
        lines = replay(command, "--help").out.splitlines()
        prose = [line for line in lines if not line.startswith((" ", "usage:"))]
        assert max(map(len, prose)) <= 60, command


def test_recover_can_be_quiet(replay: Program, run: Path, tmp_path: Path) -> None:
    ran = replay("recover", run, "-o", tmp_path / "new.mcap", "-q")
    assert (ran.status, ran.out, ran.err) == (0, "", "")


def test_verbose_says_what_came_and_which_pairs_were_searched_and_why(replay: Program, run: Path) -> None:
    said = replay.merge(run, "-v").err
    usual = replay.merge(run).err
    came = r"\+[\d.]+ s: new maps of r[12]; \d+ of \d+ messages read; [\d.]+ s"
    assert len([line for line in said.splitlines() if re.fullmatch(came, line)]) >= 2
    assert re.search(r"\n  r2 on r1 searched, as both maps are there for the first time: (accepted|refused)", said)
    assert "searched" not in usual


def test_all_and_nothing_is_refused(replay: Program, run: Path) -> None:
    assert replay.merge(run, "-q", "-v").error == "--quiet and --verbose: expected one of them"


def test_skipped_messages_say_when(replay: Program, tmp_path: Path) -> None:
    messages = [*growing("r1"), seen("r1", 90.5, resolution=0.0)]
    said = replay.merge(write_mcap(tmp_path / "run.mcap", in_log_order(messages))).err
    assert re.search(
        r"\(run\.mcap, /r1/map at \d{4}-\d\d-\d\d \d\d:\d\d:\d\d\.\d{3} UTC, \+90\.5 s\): bad_resolution", said
    )
    assert str(at(90.5)) not in said


@pytest.mark.parametrize(
    ("choice", "is_terminal", "variables", "on"),
    [
        ("auto", True, {}, True),
        ("auto", False, {}, False),
        ("auto", True, {"NO_COLOR": "1"}, False),
        ("auto", True, {"NO_COLOR": ""}, True),
        ("auto", True, {"TERM": "dumb"}, False),
        ("auto", False, {"FORCE_COLOR": "1"}, True),
        ("auto", False, {"FORCE_COLOR": "1", "NO_COLOR": "1"}, False),
        ("always", False, {"NO_COLOR": "1"}, True),
        ("never", True, {"FORCE_COLOR": "1"}, False),
    ],
)
def test_where_colours_are(
    choice: str, is_terminal: bool, variables: dict[str, str], on: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("NO_COLOR", "FORCE_COLOR"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("TERM", "xterm")
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(sys.stdout, "isatty", lambda: is_terminal)
    assert are_on(sys.stdout, choice) is on


def test_colours_are_where_they_are_asked_for(replay: Program, run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    forced = replay.merge(run)
    assert COLOUR in forced.out
    assert "\x1b" not in forced.err, "a progress bar is for terminals, whatever is forced"
    assert "\x1b" not in replay.merge(run, "--color", "never").out
    assert COLOUR in replay.merge(run, "--color", "always").out


def report(**row: object) -> dict:
    figures = {
        "status": "unmerged",
        "reason": {"code": "too_little_overlap", "message": "the maps share 1.3 m² of ground, less than 6 m²"},
        "merged_from_map": None,
        "acceptance": 0.98765,
        "overlap_m2": 1.3579,
        "confidence": None,
    }
    return {"settings": {"merge": {"scale": "metadata"}}, "robots": {"r2": {**figures, **row}}}


def test_a_row_says_the_same_as_its_reason() -> None:
    """Both are rounded down: 1.36 m² is not 1.4 m² here and 1.3 m² there."""
    text = table_text(report())
    assert text.count("1.3 m²") == 2
    assert "0.987" in text


def test_the_column_of_the_confidence_stays_where_none_is_known() -> None:
    header, row = table_text(report()).splitlines()
    assert "confidence" in header
    assert row[header.index("confidence") : header.index("reason")].strip() == "–"


def test_lines_have_no_blanks_at_their_ends() -> None:
    assert all(line == line.rstrip() for line in table_text(report()).splitlines())


def test_on_a_narrow_terminal_reasons_stand_below(monkeypatch: pytest.MonkeyPatch) -> None:
    Terminal(80, monkeypatch)
    lines = table_text(report(), "never").splitlines()
    assert max(map(len, lines)) <= 80
    assert "reason" not in lines[0]
    assert lines[-1] == "r2: the maps share 1.3 m² of ground, less than 6 m²"


def test_on_a_wide_terminal_reasons_stand_beside(monkeypatch: pytest.MonkeyPatch) -> None:
    Terminal(140, monkeypatch)
    header, row = table_text(report(), "never").splitlines()
    assert row.index("the maps share") == header.index("reason")


def test_long_names_leave_room_for_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    Terminal(80, monkeypatch)
    told = report()
    told["robots"] = {"r" * 90: told["robots"]["r2"]}
    lines = table_text(told, "never").splitlines()
    assert "1.3 m²" in lines[1]
    assert lines[1].startswith("r" * 11 + "… unmerged ")
    assert "".join(lines[3:]).startswith("r" * 90)
