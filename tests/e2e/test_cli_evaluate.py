"""`replay evaluate`: a run held against known truth."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest

from benchmarks.recordings import RECORDINGS
from mapmerge.sim2 import Sim2
from samples.generate import main as make_samples
from tests.data_paths import ROOT, shared_data
from tests.program import Program, Ran
from tests.runs import FLOOR_FROM_MAP, reference_from

TRUE = reference_from("r2")


def as_truth(pose: Sim2, **more: Any) -> dict[str, Any]:
    return {"x_m": pose.x_m, "y_m": pose.y_m, "yaw_rad": pose.yaw_rad, **more}


def evaluated(replay: Program, run: Path, truth: object, *flags: object) -> Ran:
    path = replay.folder / "truth.json"
    path.write_text(json.dumps(truth), encoding="utf-8")
    return replay("evaluate", run, "--truth", path, *flags)


def of_r2(pose: Sim2 = TRUE, **more: Any) -> dict[str, Any]:
    return {"reference": "r1", "robots": {"r2": as_truth(pose, **more)}}


def test_errors_are_those_of_the_pose(replay: Program, outcome: Path) -> None:
    off = Sim2(TRUE.x_m + 0.3, TRUE.y_m - 0.4, TRUE.yaw_rad + math.radians(2.0))
    ran = evaluated(replay, outcome, of_r2(off), "--json")
    assert (ran.status, ran.err) == (0, "")
    found = json.loads(ran.out)
    r2 = found["robots"]["r2"]
    assert r2["verdict"] == "placed"
    assert r2["distance_m"] == pytest.approx(0.5, abs=0.1)
    assert r2["angle_deg"] == pytest.approx(2.0, abs=0.3)
    assert (found["rmse_m"], found["rmse_deg"]) == (r2["distance_m"], r2["angle_deg"])
    assert found["map"] is None


def test_positions_are_compared_amid_the_overlap(replay: Program, outcome: Path) -> None:
    centre = (40.0, 30.0)
    turned = Sim2(yaw_rad=math.radians(1.0))
    pivot = Sim2(*TRUE.apply_point(*centre))
    about_centre = pivot @ turned @ pivot.inverse() @ TRUE
    at_centre = evaluated(replay, outcome, of_r2(about_centre, overlap_centre_m=centre), "--json")
    at_origin = evaluated(replay, outcome, of_r2(about_centre), "--json")
    errors = [json.loads(ran.out)["robots"]["r2"]["distance_m"] for ran in (at_centre, at_origin)]
    assert errors[0] < 0.4 < errors[1]


@pytest.mark.parametrize(
    ("truth", "verdict"),
    [
        (of_r2(), "placed"),
        (of_r2(Sim2(TRUE.x_m + 1.5, TRUE.y_m, TRUE.yaw_rad)), "elsewhere"),
        (of_r2(Sim2(TRUE.x_m, TRUE.y_m, TRUE.yaw_rad + 0.2)), "elsewhere"),
        (of_r2(same_place=False), "false merge"),
    ],
)
def test_what_became_of_a_robot(replay: Program, outcome: Path, truth: dict[str, Any], verdict: str) -> None:
    ran = evaluated(replay, outcome, truth)
    assert ran.status == 0
    assert f"1 {verdict}" in ran.out.splitlines()
    limited = evaluated(replay, outcome, truth, "--max-error-m", "0.2", "--max-error-deg", "1")
    assert limited.status == (0 if verdict == "placed" else 1)


def test_refused_robots_are_missed_or_rightly_so(replay: Program, outcome: Path) -> None:
    report = json.loads(outcome.with_suffix(".json").read_text(encoding="utf-8"))
    report["robots"]["r2"] |= {"status": "unmerged", "merged_from_map": None}
    run = replay.folder / "run.json"
    run.write_text(json.dumps(report), encoding="utf-8")
    assert "1 missed" in evaluated(replay, run, of_r2()).out
    assert evaluated(replay, run, of_r2(), "--max-error-m", 1).status == 1
    assert "1 refused" in evaluated(replay, run, of_r2(same_place=False)).out
    assert evaluated(replay, run, of_r2(same_place=False), "--max-error-m", 1).status == 0


def test_truth_may_be_in_another_robots_frame(replay: Program, outcome: Path) -> None:
    truth = {"reference": "r2", "robots": {"r1": as_truth(TRUE.inverse())}}
    ran = evaluated(replay, outcome, truth, "--max-error-m", "0.1", "--max-error-deg", "0.5")
    assert ran.status == 0, ran.out
    assert ran.out.splitlines()[1].startswith("r2     placed")
    nothing = {"reference": "r2", "robots": {"r3": as_truth(TRUE)}}
    assert "it says nothing of how r1" in evaluated(replay, outcome, nothing).error
    apart = {"reference": "r2", "robots": {"r1": as_truth(TRUE, same_place=False)}}
    assert "1 false merge" in evaluated(replay, outcome, apart).out


def test_what_is_beyond_which_limit_is_said(replay: Program, outcome: Path) -> None:
    off = of_r2(Sim2(TRUE.x_m + 0.3, TRUE.y_m, TRUE.yaw_rad + math.radians(2.0)), overlap_centre_m=(20.0, 15.0))

    def beyond(*flags: object) -> list[str]:
        ran = evaluated(replay, outcome, off, *flags)
        said = [line for line in ran.out.splitlines() if line.startswith("beyond the limits")]
        assert ran.status == bool(said)
        return said

    assert beyond() == beyond("--max-error-m", 5) == []
    (far,) = beyond("--max-error-m", "0.1")
    assert far.startswith("beyond the limits: r2: ")
    assert far.endswith(" m off, at most 0.1 allowed")
    (both,) = beyond("--max-error-m", "0.1", "--max-error-deg", 1)
    assert " m off, at most 0.1 allowed; turned by " in both
    (missed,) = evaluated(replay, outcome, of_r2(same_place=False), "--max-error-m", 9).out.splitlines()[-1:]
    assert missed == "beyond the limits: r2: false merge"


def test_another_place_is_beyond_a_limit_of_the_turn_alone(replay: Program, outcome: Path) -> None:
    elsewhere = of_r2(Sim2(TRUE.x_m + 3.0, TRUE.y_m, TRUE.yaw_rad))
    ran = evaluated(replay, outcome, elsewhere, "--max-error-deg", 5, "--json")
    assert ran.status == 1
    (said,) = json.loads(ran.out)["beyond"].values()
    assert said.endswith(" m off, at most 1 allowed")
    assert evaluated(replay, outcome, elsewhere, "--max-error-m", 4, "--max-error-deg", 5).status == 0


def test_a_robot_that_is_not_there_is_absent(replay: Program, outcome: Path) -> None:
    truth = of_r2()
    truth["robots"]["r7"] = as_truth(TRUE)
    ran = evaluated(replay, outcome, truth, "--max-error-m", 3)
    assert (ran.status, ran.out.splitlines()[-1]) == (1, "beyond the limits: r7: absent")
    assert "1 placed, 1 absent" in ran.out.splitlines()


def test_robots_without_truth_are_named(replay: Program, outcome: Path) -> None:
    report = json.loads(outcome.with_suffix(".json").read_text(encoding="utf-8"))
    report["robots"]["r3"] = report["robots"]["r2"]
    run = replay.folder / "run.json"
    run.write_text(json.dumps(report), encoding="utf-8")
    assert "r3: there is no truth of it" in evaluated(replay, run, of_r2()).out.splitlines()


def test_nobody_is_told_that_all_is_well_of_robots_without_truth(replay: Program, outcome: Path) -> None:
    ran = evaluated(replay, outcome, {"reference": "r1", "robots": {}}, "--max-error-m", 3)
    assert ran.status == 2
    assert "there is no truth of any of its robots; expected that of r2" in ran.error


def test_a_stranger_that_is_not_there_is_no_error(replay: Program, outcome: Path) -> None:
    truth = of_r2()
    truth["robots"]["r9"] = {"same_place": False}
    ran = evaluated(replay, outcome, truth, "--max-error-m", 3)
    assert (ran.status, ran.out.splitlines()[-1]) == (0, "1 placed, 1 refused")


def test_degrees_are_taken_as_well(replay: Program, outcome: Path) -> None:
    pose = {"x_m": TRUE.x_m, "y_m": TRUE.y_m, "yaw_deg": math.degrees(TRUE.yaw_rad)}
    assert evaluated(replay, outcome, {"reference": "r1", "robots": {"r2": pose}}, "--max-error-deg", 1).status == 0


@pytest.mark.parametrize(
    ("truth", "said"),
    [
        ([], "expected a mapping"),
        ({"robots": {}}, "it has no 'reference'"),
        ({"reference": "r1", "robots": {"r2": {"x_m": 1}}}, "robots.r2 has no 'yaw_rad'"),
        ({"reference": "r1", "robots": {"r2": as_truth(TRUE, overlap_centre_m=[1])}}, "[x, y], two numbers"),
        ({"reference": "r1", "robots": {"r2": as_truth(TRUE, same_place="no")}}, "expected true or false"),
        ({"reference": "r1", "robots": {"r2": as_truth(TRUE, yaw_deg=3)}}, "expected either yaw_deg or yaw_rad"),
        ({"reference": "r1", "robot": {}, "robots": {}}, "robot: did you mean 'robots'?"),
        (of_r2(overlap_center_m=[1, 2]), "r2.overlap_center_m: did you mean 'overlap_centre_m'?"),
    ],
)
def test_what_is_wrong_in_a_truth_is_named(replay: Program, outcome: Path, truth: object, said: str) -> None:
    ran = evaluated(replay, outcome, truth)
    assert ran.status == 2
    assert ran.error.startswith(f"{replay.folder / 'truth.json'}: ")
    assert said in ran.error


def test_the_merged_map_is_like_its_own(replay: Program, outcome: Path) -> None:
    assert replay("export", outcome, "-o", "true").status == 0
    ran = evaluated(replay, outcome, of_r2(), "--true-map", "true.yaml", "--json")
    found = json.loads(ran.out)["map"]
    assert found.pop("tolerance_m") == 0.1
    assert found.pop("merged_from_true_map") == {"x_m": 0.0, "y_m": 0.0, "yaw_rad": 0.0, "scale": 1.0}
    assert found == {
        **dict.fromkeys(("walls_right", "walls_found", "cells_alike", "free_iou", "free_covered"), 1.0),
        **dict.fromkeys(("wall_error_m", "far_wall_error_m"), 0.0),
    }


def test_a_tolerance_that_no_map_has_is_refused(replay: Program, outcome: Path) -> None:
    assert replay("export", outcome, "-o", "true").status == 0
    ran = evaluated(replay, outcome, of_r2(), "--true-map", "true.yaml", "--tolerance-m", "1e300")
    assert ran.error == "--tolerance-m 1e300: expected a number from 0 to 1e+12"
    ran = evaluated(replay, outcome, of_r2(), "--true-map", "true.yaml", "--tolerance-m", "1e12")
    assert (ran.status, ran.err) == (0, "")


def test_a_true_map_lies_where_the_truth_says(replay: Program, outcome: Path) -> None:
    """The map of r1, in a frame of its own, is true where it lies truly, and false a metre beside that."""
    floor_from_true = Sim2(5.0, -3.0, 0.4)
    report = json.loads(outcome.with_suffix(".json").read_text(encoding="utf-8"))
    own = Sim2(**report["robots"]["r1"]["merged_from_map"])
    assert own == Sim2()
    assert replay("export", outcome, "--robots", "r1", "-o", "true").status == 0
    text = (replay.folder / "true.yaml").read_text(encoding="utf-8")
    origin = next(line for line in text.splitlines() if line.startswith("origin: "))
    merged_from_true = FLOOR_FROM_MAP["r1"].inverse() @ floor_from_true
    moved = merged_from_true.inverse() @ Sim2(*json.loads(origin.removeprefix("origin: ")))
    new = f"origin: [{moved.x_m}, {moved.y_m}, {moved.yaw_rad}]"
    (replay.folder / "true.yaml").write_text(text.replace(origin, new), encoding="utf-8")
    shares = []
    for pose in (merged_from_true, Sim2(1.0, 0.5) @ merged_from_true):
        truth = {**of_r2(), "reference_from_true_map": as_truth(pose)}
        ran = evaluated(replay, outcome, truth, "--true-map", "true.yaml", "--json")
        found = json.loads(ran.out)["map"]
        shares.append((found["walls_found"], found["cells_alike"]))
    assert min(shares[0]) > 0.97
    assert max(shares[1]) < 0.95
    assert shares[1][0] < 0.6


def test_a_true_map_needs_a_merged_one(replay: Program, outcome: Path) -> None:
    ran = evaluated(replay, outcome.with_suffix(".json"), of_r2(), "--true-map", "true.yaml")
    assert "give OUT.mcap" in ran.error
    assert "true.yaml: it does not exist" in evaluated(replay, outcome, of_r2(), "--true-map", "true.yaml").error


def test_a_sample_is_like_the_floor_that_it_was_made_of(replay: Program) -> None:
    make_samples(["--out", str(replay.folder), "--only", "two_robots", "--true-maps"])
    run = ROOT / "samples/two_robots.mcap"
    merged = replay.merge(run)
    ran = replay(
        *("evaluate", merged.mcap, "--truth", run.with_suffix(".truth.json"), "--true-map", "two_robots.true_map.yaml"),
        *("--max-error-m", "0.1", "--max-error-deg", "0.5"),
    )
    assert ran.status == 0, ran.out
    ran = replay(
        *("evaluate", merged.mcap, "--truth", run.with_suffix(".truth.json"), "--true-map", "two_robots.true_map.yaml"),
        "--json",
    )
    found = json.loads(ran.out)["map"]
    assert found["walls_right"] > 0.98
    assert found["walls_found"] > 0.9
    assert found["cells_alike"] > 0.95
    assert found["free_covered"] > 0.85
    assert found["wall_error_m"] <= 0.05


@pytest.mark.parametrize("name", [name for name in RECORDINGS if name.startswith(("intel_three", "odd", "other"))])
def test_real_recordings_are_right(replay: Program, name: str) -> None:
    path = shared_data(f"real/{name}")
    truth = path.parent / f"{path.stem}.truth.json"
    ran = replay(
        "evaluate", replay.merge(path).mcap, "--truth", truth, "--max-error-m", "0.1", "--max-error-deg", "0.5"
    )
    assert ran.status == 0, ran.out


def test_names_do_not_steer_a_terminal(replay: Program, outcome: Path) -> None:
    report = json.loads(outcome.with_suffix(".json").read_text(encoding="utf-8"))
    report["robots"]["\x1b[2Jr3"] = report["robots"]["r2"]
    (replay.folder / "odd.json").write_text(json.dumps(report), encoding="utf-8")
    ran = evaluated(replay, replay.folder / "odd.json", of_r2())
    assert ran.status == 0
    assert ran.out.replace("\n", "").isprintable()
    assert r"\x1b[2Jr3" in ran.out
