"""Maps whose resolutions are wrong, with ``--scale free``: one placement with its scale in all outputs."""

import math

import pytest

from tests.bags import write_mcap
from tests.floors import with_another_label
from tests.outputs import maps, transforms
from tests.program import Program
from tests.runs import RESOLUTION_M, flat_map, in_log_order, is_right, reference_from, seen

FLAT_M2 = 54.0


def mislabelled(factor):
    """Return maps of r1, and one of r2 that calls its cells so many times as large as they are."""
    maps_of_r2 = [seen("r2", 2.0, with_another_label(flat_map("r2"), factor))]
    return in_log_order([seen("r1", 0.0, flat_map("r1", 7.0)), seen("r1", 10.0)], maps_of_r2)


@pytest.mark.parametrize("factor", [1.1, 0.8])
def test_a_wrong_resolution_is_made_up_for(replay: Program, factor: float) -> None:
    ran = replay.merge(write_mcap(replay.folder / "run.mcap", mislabelled(factor)), "--scale", "free")
    assert ran.status == 0, ran.err
    found = ran.robots["r2"]
    assert found["status"] == "merged"
    pose = found["merged_from_map"]
    assert pose["scale"] == pytest.approx(1.0 / factor, rel=0.01)
    assert is_right({**pose, "scale": pose["scale"] * factor}, reference_from("r2"))
    assert "scale" in ran.out
    assert f"{pose['scale']:.3f}" in ran.out
    assert found["acceptance"] > 0.9
    assert found["overlap_m2"] == pytest.approx(FLAT_M2, rel=0.1)
    # the merged map is the reference's, with what r2 adds at the size that it truly has
    merged = maps(ran.mcap)[-1].grid
    assert merged.resolution_m == RESOLUTION_M
    assert merged.known_area_m2 == pytest.approx(FLAT_M2, rel=0.15)
    # transforms are rigid: where the frame is and how it is turned, as in the report
    _, last = list(transforms(ran.mcap))[-1]
    (child,) = set(last) - {"r1/map"}
    shift, turn = last[child].transform.translation, last[child].transform.rotation
    assert (shift.x, shift.y) == pytest.approx((pose["x_m"], pose["y_m"]), abs=1e-6)
    assert 2.0 * math.atan2(turn.z, turn.w) == pytest.approx(pose["yaw_rad"], abs=1e-6)
    assert turn.z**2 + turn.w**2 == pytest.approx(1.0)


def test_half_the_size_is_found_if_not_surely(replay: Program) -> None:
    """Such as 0.05 m for cells of 0.10 m: of many scales one may fit by chance."""
    flags = "--scale", "free", "--min-confidence", "0.5"
    ran = replay.merge(write_mcap(replay.folder / "run.mcap", mislabelled(0.5)), *flags)
    pose = ran.robots["r2"]["merged_from_map"]
    assert pose["scale"] == pytest.approx(2.0, rel=0.01)
    assert is_right({**pose, "scale": pose["scale"] * 0.5}, reference_from("r2"))


def test_is_believed_without_it(replay: Program) -> None:
    """A map of twice the size fits nowhere, and no placement has a scale."""
    ran = replay.merge(write_mcap(replay.folder / "run.mcap", mislabelled(2.0)))
    assert ran.statuses == {"r1": "reference", "r2": "unmerged"}
    assert "scale" not in ran.out
