"""`replay compare`: what differs between two runs."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mapmerge.sim2 import Sim2
from tests.bags import write_mcap
from tests.program import Program, Ran
from tests.runs import bare_room, in_log_order, seen, two_robots

Change = Callable[[dict[str, Any]], object]


@pytest.fixture
def report(outcome: Path) -> dict[str, Any]:
    return json.loads(outcome.with_suffix(".json").read_text(encoding="utf-8"))


def compared(replay: Program, before: dict[str, Any], after: dict[str, Any], *flags: object) -> Ran:
    for name, report in (("a.json", before), ("b.json", after)):
        (replay.folder / name).write_text(json.dumps(report), encoding="utf-8")
    return replay("compare", "a.json", "b.json", *flags)


def differences(ran: Ran) -> list[tuple[str, str]]:
    return [(item["robot"], item["what"]) for item in json.loads(ran.out)["differences"]]


def changed(report: dict[str, Any], change: Change) -> dict[str, Any]:
    other = deepcopy(report)
    change(other)
    return other


def withdraw(report: dict[str, Any]) -> None:
    reason = {"code": "too_little_overlap", "message": "they share next to nothing"}
    report["robots"]["r2"] |= {"status": "unmerged", "merged_from_map": None, "reason": reason, "confidence": None}


def shift(distance_m: float = 0.0, turn_deg: float = 0.0) -> Change:
    def change(report: dict[str, Any]) -> None:
        pose = report["robots"]["r2"]["merged_from_map"]
        pose["x_m"] += distance_m
        pose["yaw_rad"] += math.radians(turn_deg)

    return change


def test_a_run_does_not_differ_from_itself(replay: Program, outcome: Path) -> None:
    ran = replay("compare", outcome, outcome.with_suffix(".json"))
    assert (ran.status, ran.err) == (0, "")
    assert ran.out.splitlines() == [f"no difference between {outcome} and {outcome.with_suffix('.json')}"]


@pytest.mark.parametrize(
    ("change", "found"),
    [
        (lambda report: report["robots"].pop("r2"), ("r2", "vanished")),
        (withdraw, ("r2", "lost")),
        (shift(0.06), ("r2", "moved")),
        (shift(turn_deg=0.6), ("r2", "moved")),
        (lambda report: report["robots"]["r2"].update(acceptance=0.5), ("r2", "acceptance")),
        (lambda report: report["robots"]["r2"].update(confidence=0.5), ("r2", "confidence")),
        (lambda report: report["robots"]["r2"].update(overlap_m2=1.0), ("r2", "overlap")),
        (lambda report: report.update(first_stamp_ns=report["first_stamp_ns"] - 2 * 10**9), ("r2", "time")),
        (lambda report: report.update(skipped={"damaged": 2}), ("", "skipped")),
    ],
)
def test_names_what_is_not_as_it_was(
    replay: Program, report: dict[str, Any], change: Change, found: tuple[str, str]
) -> None:
    ran = compared(replay, report, changed(report, change))
    assert ran.status == 1
    assert ran.out.startswith("1 difference between a.json and b.json\n")
    assert found[1] in ran.out
    assert differences(compared(replay, report, changed(report, change), "--json"))[0] == found


@pytest.mark.parametrize("change", [shift(0.04), shift(turn_deg=0.4)])
def test_what_is_within_the_tolerance_is_no_difference(replay: Program, report: dict[str, Any], change: Change) -> None:
    assert compared(replay, report, changed(report, change)).status == 0
    assert compared(replay, report, changed(report, change), "--tolerance-m", 0, "--tolerance-deg", "0.1").status == 1


def test_tells_by_how_much_in_numbers(replay: Program, report: dict[str, Any]) -> None:
    after = changed(report, shift(0.25, -2.0))
    x_m, y_m = np.subtract(*(seen_at(each, report["robots"]["r2"]["centre_m"]) for each in (after, report)))
    (moved,) = json.loads(compared(replay, report, after, "--json").out)["differences"]
    expected = {"distance_m": math.hypot(x_m, y_m), "dx_m": x_m, "dy_m": y_m, "turn_deg": -2.0, "scale_ratio": 1.0}
    assert moved["amounts"] == pytest.approx(expected, abs=1e-6)


def test_reports_without_a_middle_are_compared_at_the_origin(replay: Program, report: dict[str, Any]) -> None:
    older = changed(report, without_middle)
    (moved,) = json.loads(compared(replay, older, changed(older, shift(0.25, -2.0)), "--json").out)["differences"]
    expected = {"distance_m": 0.25, "dx_m": 0.25, "dy_m": 0.0, "turn_deg": -2.0, "scale_ratio": 1.0}
    assert moved["amounts"] == pytest.approx(expected, abs=1e-6)


def without_middle(report: dict[str, Any]) -> None:
    for robot in report["robots"].values():
        del robot["centre_m"]


def test_a_map_far_from_the_origin_of_its_frame_is_compared_where_it_is(
    replay: Program, report: dict[str, Any]
) -> None:
    centre_m = (4.6e6, 3.0e5)

    def turned_there(other: dict[str, Any]) -> None:
        robot = other["robots"]["r2"]
        pose = Sim2(0.0, 0.0, robot["merged_from_map"]["yaw_rad"] + 2e-5)
        there = np.subtract(seen_at(other, centre_m), pose.apply_point(*centre_m))
        robot["merged_from_map"] |= {"x_m": there[0], "y_m": there[1], "yaw_rad": pose.yaw_rad}

    far = changed(report, lambda other: other["robots"]["r2"].update(centre_m=list(centre_m)))
    assert compared(replay, far, changed(far, turned_there)).status == 0
    assert (
        compared(replay, changed(far, without_middle), changed(changed(far, turned_there), without_middle)).status == 1
    )


def seen_at(report: dict[str, Any], at_m: tuple[float, float]) -> tuple[float, float]:
    """Return where a point of r2's map frame lies in the merged frame."""
    pose = report["robots"]["r2"]["merged_from_map"]
    return Sim2(pose["x_m"], pose["y_m"], pose["yaw_rad"], pose["scale"]).apply_point(*at_m)


def test_a_reason_that_changed_is_a_difference(replay: Program, report: dict[str, Any]) -> None:
    before = changed(report, withdraw)
    after = changed(before, lambda other: other["robots"]["r2"]["reason"].update(code="walls_disagree"))
    assert differences(compared(replay, before, after, "--json")) == [("r2", "reason")]


def test_poses_in_another_reference_are_taken_to_the_first_one(replay: Program, two: Path, outcome: Path) -> None:
    other = replay.merge(two, "--robots", "r2,r1")
    ran = replay("compare", outcome, other.mcap, "--json")
    assert ran.status == 1
    assert differences(ran) == [("", "reference")]


def test_another_reference_that_nobody_is_merged_with_changes_nobody(replay: Program, tmp_path: Path) -> None:
    apart = write_mcap(tmp_path / "apart.mcap", [seen("r1", 0.0), seen("r3", 1.0, bare_room())])
    first = replay("merge", apart, "--robots", "r1,r3", "--no-rrd", "-o", tmp_path / "first.mcap")
    second = replay("merge", apart, "--robots", "r3,r1", "--no-rrd", "-o", tmp_path / "second.mcap")
    assert (first.status, second.status) == (0, 0)
    ran = replay("compare", tmp_path / "first.json", tmp_path / "second.json", "--json")
    assert differences(ran) == [("", "reference")]


def test_poses_without_a_common_robot_are_not_compared(replay: Program, report: dict[str, Any]) -> None:
    def other_reference(other: dict[str, Any]) -> None:
        robots = other["robots"]
        robots["r1"], robots["r2"] = robots["r2"], robots["r1"]
        withdraw({"robots": {"r2": robots["r1"]}})
        other["reference"] = "r2"

    ran = compared(replay, report, changed(report, other_reference))
    assert ran.status == 1
    assert "note: poses cannot be compared" in ran.out
    assert "moved" not in ran.out


def test_a_robot_that_is_new_appeared(replay: Program, outcome: Path) -> None:
    more = write_mcap(replay.folder / "more.mcap", in_log_order(two_robots(), [seen("r3", 30.0, bare_room())]))
    ran = replay("compare", outcome, replay.merge(more).mcap)
    assert ran.status == 1
    assert "r3     appeared" in ran.out
    assert "note: what was used of the inputs is not the same: more.mcap, two.mcap" in ran.out


def test_other_settings_and_versions_are_named_and_no_difference(replay: Program, report: dict[str, Any]) -> None:
    def other_settings(other: dict[str, Any]) -> None:
        other["version"] = "9.9"
        other["settings"]["merge"]["verify"]["min_confidence"] = 0.5
        other["settings"]["outputs"] = {"copy_maps": "of no account"}

    ran = compared(replay, report, changed(report, other_settings))
    assert ran.status == 0
    assert "made by replay" in ran.out
    assert "note: the settings are not the same: merge.verify.min_confidence" in ran.out


def test_a_report_of_another_version_with_more_or_less_in_it_serves(replay: Program, report: dict[str, Any]) -> None:
    def older(other: dict[str, Any]) -> None:
        other["news"] = {"of": ["the future"]}
        for key in ("first_stamp_ns", "history", "pairs", "notes"):
            del other[key]

    assert compared(replay, report, changed(report, older)).status == 0


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "it is empty"),
        (b"{", "this is no JSON, or it was cut off"),
        (b"[1]", "JSON of something else"),
        (b'{"schema": 1}', "JSON of something else"),
        (b'{"schema": "replay.report/9"}', "'replay.report/9', and replay.report/1 is read"),
        (b'{"schema": "replay.report/1"}', "it has no 'reference'"),
        (b"\xff\xfe", "this is no JSON"),
        (b"\x89MCAP0\r\n", "no /merged/report"),
    ],
)
def test_what_is_no_report_is_refused(replay: Program, outcome: Path, content: bytes, said: str) -> None:
    path = replay.folder / "bad.json"
    path.write_bytes(content)
    ran = replay("compare", outcome, path)
    assert ran.status == 2
    assert ran.error.startswith(f"{path}: ")
    assert said in ran.error


@pytest.mark.parametrize(
    ("keys", "value", "said"),
    [
        (("robots", "r2", "status"), "lost", "robots.r2.status is 'lost'; expected one of reference"),
        (
            ("robots", "r2", "merged_from_map", "x_m"),
            "far",
            "robots.r2.merged_from_map.x_m is 'far'; expected a number",
        ),
        (("robots", "r2", "merged_from_map", "scale"), -1, "expected a number from 1e-06 to 1e+06"),
        (("robots", "r2", "merged_from_map"), None, "expected a placed robot to have a pose"),
        (("robots",), [], "expected a mapping"),
        (("inputs",), {}, "expected a list"),
        (("robots", "r2", "first_merged_stamp_ns"), 1.5, "expected a whole number"),
        (("robots", "r2", "acceptance"), 10**400, "expected a number"),
    ],
)
def test_what_is_wrong_in_a_report_is_named(
    replay: Program, report: dict[str, Any], keys: tuple[str, ...], value: object, said: str
) -> None:
    bad = deepcopy(report)
    *way, last = keys
    node = bad
    for key in way:
        node = node[key]
    node[last] = value
    ran = compared(replay, report, bad)
    assert ran.status == 2
    assert "b.json: " in ran.error
    assert said in ran.error


def test_an_mcap_that_was_cut_off_has_no_final_report(replay: Program, outcome: Path) -> None:
    cut = replay.folder / "cut.mcap"
    content = outcome.read_bytes()
    cut.write_bytes(content[: len(content) // 2])
    ran = replay("compare", outcome, cut)
    assert ran.status == 2
    assert "its last report may be lost" in ran.error or "no /merged/report" in ran.error


@pytest.mark.parametrize("value", ["-1", "nan", "inf", "much"])
def test_a_tolerance_is_a_number(replay: Program, outcome: Path, value: str) -> None:
    ran = replay("compare", outcome, outcome, f"--tolerance-m={value}")
    assert ran.status == 2
    assert "--tolerance-m" in ran.error


def test_poses_are_equal_however_the_turn_is_written(replay: Program, report: dict[str, Any]) -> None:
    turned = Sim2(yaw_rad=report["robots"]["r2"]["merged_from_map"]["yaw_rad"] + math.tau).yaw_rad
    same = changed(report, lambda other: other["robots"]["r2"]["merged_from_map"].update(yaw_rad=turned - math.tau))
    assert compared(replay, report, same, "--tolerance-deg", "0.001").status == 0


@pytest.mark.parametrize(("head", "said"), [(b"#ROSBAG V2.0\n", "replay merge"), (b"RRF2", "a Rerun recording")])
def test_a_recording_is_no_outcome(replay: Program, tmp_path: Path, head: bytes, said: str) -> None:
    path = tmp_path / "run.bag"
    path.write_bytes(head + bytes(100))
    assert said in replay("compare", path, path).error
