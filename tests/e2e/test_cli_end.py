"""The end of a run: whatever was only followed is searched once more, however the recording ends."""

from __future__ import annotations

from pathlib import Path

import pytest

from mapmerge.merger import Merger
from mapmerge.sim2 import Sim2
from tests.bags import Recorded, write_mcap
from tests.outputs import reports
from tests.program import Program
from tests.runs import at, bad_messages, flat_map, growing, in_log_order, link, linked, reference_from, seen

TRUE = reference_from("r2")


def three_robots() -> list[Recorded]:
    """Return maps of which the last ones say little more than those before them."""
    more = [seen("r1", 30.0, flat_map("r1", 8.7)), seen("r3", 31.0, flat_map("r3", 8.8))]
    return in_log_order(growing("r1"), growing("r2", 2.0), growing("r3", 4.0), more)


def many_transforms(first_s: float, pose: Sim2) -> list[Recorded]:
    return [linked(first_s + 0.01 * index, link("r1/map", "r2/map", pose)) for index in range(1200)]


def test_all_pairs_are_searched_at_the_end(replay: Program, tmp_path: Path) -> None:
    ran = replay.merge(write_mcap(tmp_path / "run.mcap", three_robots()))
    searched = {(pair["a"], pair["b"]): pair["searched"] for pair in ran.report["pairs"]}
    assert searched == {
        ("r1", "r2"): {"stamp_ns": at(31.0), "trigger": "end"},
        ("r1", "r3"): {"stamp_ns": at(31.0), "trigger": "end"},
        ("r2", "r3"): {"stamp_ns": at(31.0), "trigger": "end"},
    }


def test_the_outcome_is_that_of_the_last_maps_alone(replay: Program, tmp_path: Path) -> None:
    ran = replay.merge(write_mcap(tmp_path / "run.mcap", three_robots()))
    last = {"r1": flat_map("r1", 8.7), "r2": flat_map("r2"), "r3": flat_map("r3", 8.8)}
    expected = Merger(["r1", "r2", "r3"]).step(last, is_last=True)
    assert ran.statuses == {robot: str(outcome.status) for robot, outcome in expected.robots.items()}
    for pair in ran.report["pairs"]:
        pose = expected.pairs[pair["a"], pair["b"]].target_from_source
        assert pose is not None
        found = pair["a_from_b"]
        assert (found["x_m"], found["y_m"]) == pytest.approx((pose.x_m, pose.y_m), abs=3e-6)


def test_of_maps_that_were_searched_no_search_is_needed(replay: Program, tmp_path: Path) -> None:
    ran = replay.merge(write_mcap(tmp_path / "run.mcap", [seen("r1", 0.0), seen("r2", 1.0), seen("r2", 2.0)]))
    (pair,) = ran.report["pairs"]
    assert pair["searched"] == {"stamp_ns": at(1.0), "trigger": "first"}


def test_whatever_else_was_recorded_after_the_last_map(replay: Program, tmp_path: Path) -> None:
    """Messages that cannot be used, and more transforms than are held back."""
    maps = three_robots()
    outcomes = []
    for name, more in {
        "nothing": [],
        "bad messages": list(bad_messages("r1", 40.0).values()),
        "transforms": many_transforms(40.0, Sim2(50.0)),
    }.items():
        run = write_mcap(tmp_path / f"{name}.mcap", in_log_order(maps, more))
        ran = replay.merge(run, "--use-tf")
        assert {pair["searched"]["trigger"] for pair in ran.report["pairs"]} == {"end"}
        outcomes.append((ran.robots, ran.report["pairs"], ran.report["history"], ran.report["updates"]))
        assert [time_ns for time_ns, _ in reports(ran.mcap)][-1] == at(31.0)
    assert outcomes[1] == outcomes[0]
    assert outcomes[2] == outcomes[0]


def test_transforms_after_the_last_map_are_too_late(replay: Program, tmp_path: Path) -> None:
    """Even where so many follow that the run ends with a tick of its own."""
    maps = in_log_order(growing("r1", frame="r1/map"), growing("r2", 2.0, frame="r2/map"))
    few, many = many_transforms(40.0, TRUE)[:5], many_transforms(40.0, TRUE)
    said = []
    for name, late in (("few", few), ("many", many)):
        ran = replay.merge(write_mcap(tmp_path / f"{name}.mcap", in_log_order(maps, late)), "--use-tf")
        assert ran.robots["r2"]["prior"] is None
        assert [pair["prior"] for pair in ran.report["pairs"]] == [None]
        said.append([note["message"] for note in ran.report["notes"]])
    assert said[0] == said[1]
    assert "only after the last map" in said[0][0]
