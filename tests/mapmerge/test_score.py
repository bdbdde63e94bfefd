"""What walls of one map meet in the other."""

import numpy as np
import pytest

from mapmerge.align import poses_of
from mapmerge.config import VerifyConfig
from mapmerge.score import agreement, probe
from mapmerge.sim2 import Sim2
from tests.floors import drawn, filled, flat, prepared_map, within

LIMITS = VerifyConfig()
ONE_WALL = [(0, 3, 6, 3.1)]
TARGET = prepared_map(drawn(within(0, 0, 6, 6), ONE_WALL, size_m=(6, 6)))
ONLY_THE_WALL = prepared_map(drawn(within(9, 9, 9, 9), ONE_WALL, size_m=(6, 6)))


def found(target, source, *poses, most=5000):
    rows = poses_of(poses or [Sim2()])
    return agreement(target, source, rows, probe(source, most, most), probe(target, most, most))


class TestWalls:
    """A wall of 6 m at y = 3 m in the target, free space on both sides of it; the same wall in the source."""

    @pytest.mark.parametrize(
        ("up_m", "matched", "near", "far"),
        [(0.0, 1, 0, 0), (0.15, 1, 0, 0), (0.35, 0, 1, 0), (1.0, 0, 0, 1), (5.0, 0, 0, 0)],
    )
    def test_on_a_wall_beside_it_amid_free_space_and_outside(self, up_m, matched, near, far):
        pose = TARGET.grid.map_from_grid.inverse() @ Sim2(0.0, up_m) @ ONLY_THE_WALL.grid.map_from_grid
        tally = found(TARGET, ONLY_THE_WALL, pose).ahead
        metres = tally.matched_m[0], tally.near_m[0], tally.far_m[0]
        assert metres == pytest.approx((6.0 * matched, 6.0 * near, 6.0 * far))
        assert tally.violated_m[0] == pytest.approx(6.0 * (near + far))
        assert tally.share[0] == matched

    def test_a_wall_in_unknown_space_is_neither(self):
        target = prepared_map(drawn(within(0, 0, 6, 3), ONE_WALL, size_m=(6, 6)))
        behind = target.grid.map_from_grid.inverse() @ Sim2(0.0, 0.6) @ ONLY_THE_WALL.grid.map_from_grid
        tally = found(target, ONLY_THE_WALL, behind).ahead
        assert (tally.matched_m[0], tally.violated_m[0], tally.share[0]) == (0.0, 0.0, 0.0)

    def test_the_other_direction_is_that_of_the_maps_swapped(self):
        target, source, pose = prepared_map(flat()), prepared_map(flat(ragged=3)), Sim2(0.4, -0.3, 0.2)
        there, back = found(target, source, pose), found(source, target, pose.inverse())
        for one, other in ((there.ahead, back.back), (there.back, back.ahead)):
            assert one.matched_m[0] == pytest.approx(other.matched_m[0], rel=0.01)
            assert one.far_m[0] == pytest.approx(other.far_m[0], rel=0.01)

    def test_placements_do_not_matter_to_each_other(self):
        target, source = prepared_map(flat()), prepared_map(flat(ragged=3))
        poses = [Sim2(0.1 * number, -0.2, 0.3 * number) for number in range(5)]
        together = found(target, source, *poses).score_m(LIMITS)
        alone = [found(target, source, pose).score_m(LIMITS)[0] for pose in poses]
        np.testing.assert_array_equal(together, alone)

    def test_few_points_stand_for_all(self):
        target, source = prepared_map(flat()), prepared_map(flat(ragged=3))
        all_of_them, few = (found(target, source, most=most) for most in (5000, 200))
        assert few.ahead.matched_m[0] == pytest.approx(all_of_them.ahead.matched_m[0], rel=0.1)
        assert few.free_m2[0] == pytest.approx(all_of_them.free_m2[0], rel=0.1)

    @pytest.mark.parametrize("pose", [Sim2(), Sim2(300.0, -2.0, 1.0), Sim2(scale=2.5)])
    @pytest.mark.parametrize(
        "grid", [filled(100, 1, 1), filled(100, 1, 100), filled(0, 40, 40), filled(-1, 4, 4), filled(100, 40, 40)]
    )
    def test_maps_with_little_on_them_have_figures(self, grid, pose):
        few, other = prepared_map(grid), prepared_map(flat())
        for target, source in ((few, other), (other, few), (few, few)):
            tallies = found(target, source, pose)
            assert np.isfinite(tallies.score_m(LIMITS)).all()
            assert 0.0 <= tallies.ahead.share[0] <= 1.0
