from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import replace
from importlib import resources
from typing import Any

import jsonschema
import pytest

from mapmerge.fuse import Agreement
from mapmerge.grid import Grid
from mapmerge.merger import Merger
from mapmerge.outcome import RobotOutcome, Status
from mapmerge.prior import Prior
from mapmerge.reasons import Reason, ReasonCode
from mapmerge.result import MergeResult
from mapmerge.sim2 import Sim2
from replay.errors import BadMessage
from replay.events import Noted, Report, RobotInput, Skipped
from replay.report import ReportBuilder
from replay.skip_cause import SkipCause
from replay.sources.losses import MOST_LISTED, MOST_PLACES, OTHER_PLACES
from tests.runs import bare_room, begun_anew, flat_map, is_right, reference_from

ROBOTS = ("r1", "r2", "r3")
INPUT: Mapping[str, Any] = {
    "name": "run.mcap",
    "format": "mcap",
    "size_bytes": 5,
    "said_of": None,
    "robots": list(ROBOTS),
    "clocks": dict.fromkeys(ROBOTS, "header"),
    "offsets_ns": dict.fromkeys(ROBOTS, 0),
    "messages": None,
    "until_ns": None,
    "late": None,
    "bad_stamps": None,
    "sha256": None,
    "transforms": {},
}


def builder(robots: tuple[str, ...] = ROBOTS) -> ReportBuilder:
    inputs = [RobotInput(robot, f"/{robot}/map", f"{robot}/map", "header", (0,), 3) for robot in robots]
    return ReportBuilder(inputs, {"merge": {}}, "1.2.3")


def reported(*steps: Mapping[str, Grid], robots: tuple[str, ...] = ROBOTS) -> list[Report]:
    """Return the report after each step, all checked against the schema."""
    report, merger, found = builder(robots), Merger(robots), []
    for stamp_ns, grids in enumerate(steps):
        result = merger.step(grids)
        report.take(stamp_ns, result)
        found.append(report.build(stamp_ns, result, [INPUT]))
        validate(found[-1])
    return found


def validate(report: Report) -> None:
    schema = json.loads(resources.files("replay").joinpath("schemas/report.schema.json").read_text("utf-8"))
    jsonschema.Draft202012Validator(schema).validate(json.loads(json.dumps(report, allow_nan=False)))


def test_before_any_map() -> None:
    report = builder().build(None, Merger(ROBOTS).result, [INPUT])
    validate(report)
    assert (report["schema"], report["version"], report["stamp_ns"]) == ("replay.report/1", "1.2.3", None)
    assert (report["reference"], report["updates"]) == ("r1", 0)
    for robot in report["robots"].values():
        assert robot["status"] == robot["reason"]["code"] == "no_map"
        absent = {"merged_from_map", "acceptance", "overlap_m2", "overlap_fraction", "confidence", "component"}
        assert {robot[name] for name in absent | {"component_from_map", "placed_via", "first_merged_stamp_ns"}} == {
            None
        }


def test_a_run() -> None:
    waiting, alone, merged = reported({"r2": flat_map("r2")}, {"r1": flat_map("r1", 1.0)}, {"r1": flat_map("r1")})
    assert waiting["robots"]["r2"]["status"] == "unmerged"
    assert waiting["robots"]["r2"]["reason"]["code"] == "no_reference_map"
    assert waiting["robots"]["r2"]["component"] == "r2"
    assert alone["robots"]["r1"]["status"] == "reference"
    assert alone["robots"]["r1"]["merged_from_map"] == {"x_m": 0.0, "y_m": 0.0, "yaw_rad": 0.0, "scale": 1.0}
    found = merged["robots"]["r2"]
    assert (found["status"], found["placed_via"], found["component"]) == ("merged", "r1", "r1")
    assert is_right(found["merged_from_map"], reference_from("r2"))
    assert found["component_from_map"] == found["merged_from_map"]
    assert found["first_merged_stamp_ns"] == 2
    assert (found["map_frame"], found["map_topic"]) == ("r2/map", "/r2/map")
    assert [merged["updates"], *(robot["updates"] for robot in merged["robots"].values())] == [3, 2, 1, 0]


def test_history() -> None:
    steps = [
        {"r1": flat_map("r1"), "r2": flat_map("r2")},
        {"r2": begun_anew(flat_map("r2"))},
        {"r2": bare_room()},
        {"r2": flat_map("r2")},
    ]
    reports = reported(*steps)
    history = [change for report in reports for change in report["history"]]
    events = [(change["stamp_ns"], change["robot"], change["event"]) for change in history]
    assert events == [
        (0, "r2", "placed"),
        (1, "r2", "jumped"),
        (1, "r2", "moved"),
        (2, "r2", "jumped"),
        (2, "r2", "withdrawn"),
        (3, "r2", "placed"),
    ]
    # one before the end holds what changed at its time alone, or reports would grow with the square of the ticks
    assert [len(report["history"]) for report in reports] == [1, 2, 2, 1]
    assert [report["history_before"] for report in reports] == [0, 1, 3, 5]
    triggers = [change["trigger"] for change in history]
    assert triggers == ["first", None, "map_jumped", None, "map_jumped", "retry"]
    assert reports[-1]["robots"]["r2"]["first_merged_stamp_ns"] == 0


def test_the_last_report_has_all_of_the_history() -> None:
    report, merger = builder(), Merger(ROBOTS)
    before: list[Report] = []
    for stamp_ns, grid in enumerate([flat_map("r2"), begun_anew(flat_map("r2"))]):
        result = merger.step({"r1": flat_map("r1"), "r2": grid})
        report.take(stamp_ns, result)
        before.append(report.build(stamp_ns, result, [INPUT]))
    last = report.build(1, merger.result, [INPUT], is_last=True)
    validate(last)
    assert last["history"] == [change for each in before for change in each["history"]]
    assert (len(last["history"]), last["history_before"]) == (3, 0)
    assert {**last, "history": None, "history_before": None} == {**before[-1], "history": None, "history_before": None}


def test_pairs() -> None:
    (report,) = reported({robot: flat_map(robot) for robot in ROBOTS})
    assert [(pair["a"], pair["b"]) for pair in report["pairs"]] == [("r1", "r2"), ("r1", "r3"), ("r2", "r3")]
    for pair in report["pairs"]:
        assert pair["accepted"] is True
        assert pair["reason"]["code"] == "accepted"
        assert is_right(pair["a_from_b"], reference_from(pair["b"], pair["a"]))
        assert pair["rivals"]
        assert all(0.0 <= rival["likelihood"] < 0.01 for rival in pair["rivals"])
        assert all(rival["score_m"] < pair["scores"]["score_m"] for rival in pair["rivals"])


def test_a_pair_without_a_candidate() -> None:
    (report,) = reported({"r1": flat_map("r1"), "r2": bare_room()})
    (pair,) = report["pairs"]
    assert pair["accepted"] is False
    assert report["robots"]["r2"]["reason"]["code"] == pair["reason"]["code"]


def test_skipped_messages_are_counted_by_cause() -> None:
    report = builder()
    for cause in (SkipCause.EMPTY, SkipCause.BAD_ORIGIN, SkipCause.EMPTY):
        report.skip(Skipped("r1", "/r1/map", 5, cause, "detail", "run.mcap"))
    found = report.build(None, Merger(ROBOTS).result, [INPUT])
    validate(found)
    assert list(found["skipped"].items()) == [("bad_origin", 1), ("empty", 2)]


def test_what_is_lost_is_counted_by_place() -> None:
    report = builder()
    for messages in (3, None):
        lost = Skipped("", "", 5, SkipCause.DAMAGED, "detail", "run.mcap", f"the chunk at byte {messages}", messages)
        report.skip(lost)
    report.skip(Skipped("r1", "/r1/map", 7, SkipCause.EMPTY, "no cell", "run.mcap"))
    report.skip(Skipped("r1", "/r1/map", 9, SkipCause.EMPTY, "no cell, either", "run.mcap"))
    found = report.build(None, Merger(ROBOTS).result, [INPUT])
    validate(found)
    assert found["skipped"] == {"damaged": 4, "empty": 2}
    assert [(item["place"], item["messages"], item["detail"]) for item in found["skipped_at"]] == [
        ("the chunk at byte 3", 3, "detail"),
        ("the chunk at byte None", None, "detail"),
        ("", 2, "no cell"),
    ]


def test_damage_that_costs_nothing_is_listed_and_not_counted() -> None:
    report = builder()
    report.skip(Skipped("", "", 5, SkipCause.ENDS_EARLY, "detail", "run.bag", "byte 9", 0))
    found = report.build(None, Merger(ROBOTS).result, [INPUT])
    validate(found)
    assert found["skipped"] == {}
    assert [(item["cause"], item["place"], item["messages"]) for item in found["skipped_at"]] == [
        ("ends_early", "byte 9", 0)
    ]


def test_of_very_many_places_the_first_are_listed() -> None:
    report = builder()
    for number in range(500):
        place = f"message {number}"
        report.skip(Skipped("", "/tf", number, SkipCause.DAMAGED, f"detail {number}", "run.db3", place))
    report.skip(Skipped("", "/tf", 0, SkipCause.DAMAGED, "detail 0", "other.db3", "message 0"))
    found = report.build(None, Merger(ROBOTS).result, [INPUT])
    validate(found)
    assert found["skipped"] == {"damaged": 501}
    listed = [(item["input"], item["place"], item["messages"], item["detail"]) for item in found["skipped_at"]]
    assert listed == [
        *(("run.db3", f"message {number}", 1, f"detail {number}") for number in range(MOST_PLACES)),
        ("run.db3", OTHER_PLACES, 500 - MOST_PLACES, f"detail {MOST_PLACES}"),
        ("other.db3", "message 0", 1, "detail 0"),
    ]


def test_of_very_many_topics_the_first_are_listed_and_the_others_added_up() -> None:
    """What it lists is written at each tick, and does not grow with what a recording says."""
    report = builder()
    for number in range(5000):
        topic = f"/r{number}/map"
        report.skip(Skipped("", topic, number, SkipCause.UNKNOWN_TYPE, "another", "run.mcap", f"topic {topic}"))
    found = report.build(None, Merger(ROBOTS).result, [INPUT])
    validate(found)
    assert found["skipped"] == {"unknown_type": 5000}
    *listed, others = found["skipped_at"]
    assert [each["topic"] for each in listed] == [f"/r{number}/map" for number in range(MOST_LISTED)]
    assert (others["topic"], others["place"], others["messages"]) == ("", OTHER_PLACES, 5000 - MOST_LISTED)


def test_what_was_believed() -> None:
    prior = Prior(Sim2(1.23456789, 2.0, 0.5), 0.5, 0.6, 0.1, "recorded in /tf")
    report, priors = builder(), {"r2": prior}
    maps = {robot: flat_map(robot) for robot in ("r1", "r2")}
    result = Merger(ROBOTS).step(maps, priors)
    report.take(0, result, priors)
    found = report.build(0, result, [INPUT])
    validate(found)
    told = {
        "pose": {"x_m": 1.234568, "y_m": 2.0, "yaw_rad": 0.5, "scale": 1.0},
        "sigma": {"x_m": 0.5, "y_m": 0.6, "yaw_rad": 0.1},
        "origin": "recorded in /tf",
    }
    assert [robot["prior"] for robot in found["robots"].values()] == [None, told, None]
    assert [pair["prior"] for pair in found["pairs"]] == [told]


def test_notes_are_kept_in_order() -> None:
    report = builder()
    for robot in ("r3", "r2"):
        report.note(Noted(robot, f"of {robot}"))
    found = report.build(None, Merger(ROBOTS).result, [INPUT])
    validate(found)
    assert found["notes"] == [{"robot": "r3", "message": "of r3"}, {"robot": "r2", "message": "of r2"}]


class TestNumbers:
    @staticmethod
    def placed(pose: Sim2, agreement: Agreement | None = None) -> dict[str, Any]:
        outcome = RobotOutcome(Status.MERGED, Reason(ReasonCode.ACCEPTED, "x"), pose, agreement)
        known = Merger(["r1"]).result
        result: MergeResult = replace(known, robots={"r1": outcome})
        report = builder(("r1",)).build(0, result, [INPUT])
        validate(report)
        return report["robots"]["r1"]

    def test_are_rounded(self) -> None:
        found = self.placed(Sim2(1.23456789, -1e-9, 1e-10))["merged_from_map"]
        assert json.dumps(found) == '{"x_m": 1.234568, "y_m": 0.0, "yaw_rad": 0.0, "scale": 1.0}'

    @pytest.mark.parametrize("yaw_rad", [math.pi, -math.pi, -math.pi + 1e-10, 3 * math.pi, math.pi - 1e-10])
    def test_yaw_is_above_minus_pi_and_at_most_pi(self, yaw_rad: float) -> None:
        found = self.placed(Sim2(yaw_rad=yaw_rad))["merged_from_map"]["yaw_rad"]
        assert -math.pi < found <= math.pi

    def test_acceptance_is_absent_without_overlap(self) -> None:
        found = self.placed(Sim2(), Agreement(0.0, 0.0, 0.0))
        assert (found["acceptance"], found["overlap_m2"], found["overlap_fraction"]) == (None, 0.0, 0.0)
        assert self.placed(Sim2(), Agreement(0.5, 3.0, 0.25))["acceptance"] == 0.5


def test_a_report_is_not_changed_by_what_comes_later() -> None:
    first, second = reported({"r1": flat_map("r1")}, {"r2": flat_map("r2")})
    assert first["history"] == []
    assert len(second["history"]) == 1


def test_causes_are_the_closed_list() -> None:
    assert SkipCause(BadMessage("empty", "x").cause) is SkipCause.EMPTY
