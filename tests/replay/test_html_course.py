"""The course of a run on the report page: marks and log, also where more was decided than there is room for."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from replay.html import course, story
from replay.options import RunOptions
from replay.runs import RunPath
from tests.bags import Recorded, write_mcap
from tests.pages import Page, page_of, page_of_run
from tests.runs import bare_room, begun_anew, forgetting, seen

JUMPS = 150


def told(path: Path, recorded: list[Recorded]) -> Page:
    """Return the page of a run."""
    return Page(page_of_run(RunOptions((RunPath(None, write_mcap(path, recorded)),))))


def marks(found: Page) -> list[tuple[float, str, str]]:
    """Return where the marks of the only lane are, in percent, what they show, and what they say."""
    (track,) = found.all("div", kind="track")
    spans = [each for each in track.iter("span") if "event" in each.get("class", "").split()]
    places = [float(each.get("style", "").removeprefix("left:").removesuffix("%")) for each in spans]
    return [(at, each.text or "", each.get("title", "")) for at, each in zip(places, spans, strict=True)]


def log(found: Page) -> list[str]:
    return [" ".join("".join(each.itertext()).split()) for each in found.section("decisions").iter("li")]


def test_few_decisions_have_a_mark_each() -> None:
    found = Page(page_of("restarted"))
    titles = [each.get("title") for each in found.all("span", kind="event") if each.get("title")]
    assert titles == ["placed at +1.0 s", "jumped at +2.0 s", "withdrawn at +2.0 s"]
    assert "so many close together" not in found.words("plots")


def test_many_decisions_are_marked_over_all_of_the_time(tmp_path: Path) -> None:
    found = told(tmp_path / "run.mcap", forgetting("r1", JUMPS + 1))
    drawn = marks(found)
    assert len(drawn) <= course.MOST_MARKS
    assert drawn[0][0] < 3.0
    assert drawn[-1][0] > 97.0
    assert sum(int(sign) for _, sign, _ in drawn if sign.isdigit()) + sum(sign == "✱" for _, sign, _ in drawn) == JUMPS
    counted = re.fullmatch(r"(\d+) times jumped from \+1.0 s to \+[\d.]+ s", drawn[0][2])
    assert counted is not None
    assert counted[1] == drawn[0][1]
    (track,) = found.all("div", kind="track")
    assert f"to +{float(JUMPS):.1f} s" in track.get("aria-label", "").rpartition(";")[2]
    assert "so many close together" in found.words("plots")


def test_a_mark_names_each_kind_that_it_stands_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(course, "MOST_MARKS", 1)
    found = told(tmp_path / "run.mcap", [seen("r1", 0.0), seen("r2", 1.0), seen("r2", 2.0, begun_anew(bare_room()))])
    titles = [each.get("title") for each in found.all("span", kind="event") if each.get("title")]
    assert titles == ["placed, jumped, withdrawn from +1.0 s to +2.0 s"]


def test_a_log_too_long_for_a_page_says_what_it_leaves_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(course, "MOST_ENTRIES", 20)
    lines = log(told(tmp_path / "run.mcap", forgetting("r1", JUMPS + 1)))
    assert len(lines) == 21
    assert [lines[0].split()[0], lines[9].split()[0]] == ["+1.0", "+10.0"]
    assert lines[10] == "130 more, which the JSON report has under history"
    assert [lines[11].split()[0], lines[20].split()[0]] == ["+141.0", "+150.0"]


def test_what_is_not_kept_is_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(story, "MOST_DECISIONS", 30)
    monkeypatch.setattr(course, "MOST_ENTRIES", 20)
    found = told(tmp_path / "run.mcap", forgetting("r1", JUMPS + 1))
    assert [line.split()[0] for line in log(found)[9:12]] == ["+10.0", "130", "+141.0"]
    assert "90 decisions in the middle have no mark" in found.words("plots")
    drawn = marks(found)
    assert (drawn[0][0], drawn[-1][0]) == (pytest.approx(1.0, abs=1.0), pytest.approx(99.0, abs=1.0))
