"""The sample recordings, whose truth is known."""

from __future__ import annotations

import pytest

from mapmerge.sim2 import Sim2
from tests.data_paths import ROOT
from tests.floors import errors
from tests.outputs import reports
from tests.program import Program, started
from tests.truth import check, read_truth

SAMPLES = ROOT / "samples"
RUNS = {
    "two_robots": ("two_robots.mcap",),
    "three_robots": ("three_robots.bag",),
    "bag_per_robot": ("bag_per_robot/alpha", "bag_per_robot/bravo"),
}


@pytest.mark.parametrize("name", RUNS)
def test_end_where_the_truth_says(replay: Program, name: str) -> None:
    runs = [SAMPLES / run for run in RUNS[name]]
    # The same in a process of its own, at the same time: where sets and hashes are in another order.
    with started("merge", *runs, "-o", "again.mcap", "--no-rrd", "--images", "none", cwd=replay.folder) as again:
        ran = replay.merge(*runs, "--require-all")
        assert ran.status == 0
        again.communicate(timeout=120)
        assert again.returncode == 0
    for path in (ran.mcap, ran.report_path):
        repeated = path.with_stem("again")
        assert path.read_bytes() == repeated.read_bytes(), "it does not repeat itself to the byte"
    check(ran.robots, read_truth(SAMPLES / f"{name}.truth.json"))
    assert ran.report["skipped"] == {}


def test_a_restart_in_the_middle(replay: Program) -> None:
    ran = replay.merge(*(SAMPLES / run for run in RUNS["bag_per_robot"]))
    known = read_truth(SAMPLES / "bag_per_robot.truth.json")["bravo"]
    before = known["before_restart"]
    restart_ns = before["restart_stamp_ns"]
    places = [(time_ns, report["robots"]["bravo"]["merged_from_map"]) for time_ns, report in reports(ran.mcap)]
    for time_ns, pose in places:
        truth = before if time_ns < restart_ns else known
        true = Sim2(truth["x_m"], truth["y_m"], truth["yaw_rad"])
        if pose:
            # a turn is less certain where the maps share little yet
            found = Sim2(pose["x_m"], pose["y_m"], pose["yaw_rad"], pose["scale"])
            error_m, error_deg = errors(found, true, tuple(truth["overlap_centre_m"]))
            assert error_m <= 0.20
            assert error_deg <= 1.5
    assert any(pose for time_ns, pose in places if time_ns < restart_ns)
    events = [(change["event"], change["stamp_ns"] > restart_ns) for change in ran.report["history"]]
    assert events[0] == ("placed", False)
    assert {event for event, is_after in events[1:] if not is_after} <= {"moved"}
    assert [event for event, is_after in events if is_after] == ["jumped", "moved"]
    assert [robot["map_frame"] for robot in ran.robots.values()] == ["alpha/map", "bravo/map"]
    assert [item["clocks"] for item in ran.report["inputs"]] == [{"/map": "header"}] * 2
