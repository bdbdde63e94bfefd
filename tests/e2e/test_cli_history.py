"""A run in which something happens all the time: what its reports hold, and how the last one is found."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from mcap.writer import Writer

import replay as library
from replay import report_file
from replay.errors import InputError
from replay.options import TimeBound
from tests.bags import NO_INDEX, write_mcap
from tests.outputs import reports
from tests.program import Program, Ran
from tests.runs import at, forgetting

TICKS = 60


@pytest.fixture
def jumping(replay: Program, tmp_path: Path) -> Ran:
    """A run of one robot whose map forgets at each time what it knew."""
    return replay.merge(write_mcap(tmp_path / "run.mcap", forgetting("r1", TICKS)))


def test_reports_do_not_grow_with_the_time(jumping: Ran) -> None:
    *before, (_, final) = reports(jumping.mcap)
    assert final == jumping.report
    assert len(final["history"]) == TICKS - 1
    assert len(before) == TICKS - 1
    sizes = [len(json.dumps(report)) for _, report in before]
    assert max(sizes) < 1.05 * sizes[1]
    assert [change for _, report in before for change in report["history"]] == final["history"][:-1]
    assert [report["history_before"] for _, report in before] == [0, *range(TICKS - 2)]
    assert final["history_before"] == 0


@pytest.mark.parametrize("options", [None, {}, NO_INDEX], ids=["as it is", "copied", "without an index"])
def test_a_report_of_a_time_before_the_end_is_read_with_all_that_was_until_then(
    jumping: Ran, tmp_path: Path, options: dict[str, Any] | None
) -> None:
    path = jumping.mcap if options is None else copied(jumping.mcap, tmp_path / "copy.mcap", **options)
    for bound, last in ((TimeBound.parse("20"), 20), (TimeBound.parse(f"{at(7.5)}ns"), 7), (None, TICKS - 1)):
        report = library.read_report(path, at=bound)
        assert report["stamp_ns"] == at(last)
        assert report["history"] == jumping.report["history"][:last]
        assert report["history_before"] == 0
    with pytest.raises(InputError, match="the run begins after that time"):
        library.read_report(path, at=TimeBound.parse(f"{at(0.0) - 1}ns"))


def test_no_report_is_parsed_that_is_not_asked_for(jumping: Ran, monkeypatch: pytest.MonkeyPatch) -> None:
    final = jumping.report
    parsed: list[Any] = []
    original = json.loads
    monkeypatch.setattr(report_file.json, "loads", lambda text: (parsed.append(text), original(text))[1])
    assert library.read_report(jumping.mcap) == final
    assert len(parsed) == 1
    library.read_report(jumping.mcap, at=TimeBound.parse("20"))
    assert len(parsed) == 3


def test_a_run_that_did_not_end_has_its_history_by_parts(jumping: Ran, tmp_path: Path) -> None:
    path = copied(jumping.mcap, tmp_path / "part.mcap", most=TICKS - 1)
    for bound, last in ((None, TICKS - 2), (TimeBound.parse("20"), 20)):
        report = library.read_report(path, at=bound)
        assert report["stamp_ns"] == at(last)
        assert report["history"] == jumping.report["history"][last - 1 : last]
        assert report["history_before"] == last - 1


def copied(path: Path, to: Path, most: int | None = None, **options: Any) -> Path:
    """Write the first reports of an MCAP to another one, in chunks of their own."""
    with to.open("wb") as file:
        writer = Writer(file, chunk_size=4000, **options)
        writer.start()
        channel = writer.register_channel("/merged/report", "json", 0)
        for stamp_ns, report in reports(path)[:most]:
            writer.add_message(channel, stamp_ns, json.dumps(report).encode(), stamp_ns)
        writer.finish()
    return to
