"""Alignment of many candidates at once, and their arithmetic."""

import math

import numpy as np
import pytest

from mapmerge.align import align, composed, evenly, inverses, placed, placement_of, poses_of
from mapmerge.config import RefineConfig
from mapmerge.sim2 import IDENTITY, Sim2, wrap_angle
from tests.floors import FEW_POINTS, FLAT_M, errors, filled, flat, prepared_map, walls_of_the_flat

LIMITS = RefineConfig()
REJECT_M = LIMITS.rough_reject_m + LIMITS.reject_m
CENTRE_M = (FLAT_M[0] / 2 + 1.0, FLAT_M[1] / 2 + 1.0)
SCALES = (0.4, 2.5)


def off_by(distance_m, degrees, scale=1.0):
    """Return starts that are off by a turn about the flat's middle, either way, and a shift, in all directions."""
    to_centre = Sim2(*CENTRE_M)
    shifts = [
        Sim2(distance_m * math.cos(turn), distance_m * math.sin(turn), math.radians(angle), scale)
        for turn, angle in zip(np.arange(0.0, 6.2, 0.8), (degrees, -degrees) * 4, strict=True)
    ]
    return [to_centre @ shift @ to_centre.inverse() for shift in shifts]


def noisy(seed):
    """Return a map of the flat, and wall points of the flat in the frame of its grid."""
    target = prepared_map(flat(ragged=1))
    into_grid = target.grid.map_from_grid.inverse() @ Sim2(1.0, 1.0)
    return target, into_grid.apply(walls_of_the_flat(seed))


def aligned(target, walls_m, *starts, reject_m=REJECT_M, scales=(1.0, 1.0)):
    return [placement_of(pose) for pose in align(target, walls_m, poses_of(starts), reject_m, scales=scales)]


class TestPoses:
    ONE, TWO = Sim2(3.0, -1.0, 2.5, 1.2), Sim2(-7.0, 0.3, -1.0, 0.7)

    def test_rows_are_placements(self):
        rows = poses_of([self.ONE, self.TWO])
        assert rows.shape == (2, 4)
        assert [placement_of(row) for row in rows] == [self.ONE, self.TWO]
        assert poses_of([]).shape == (0, 4)

    def test_compose_and_invert_as_placements_do(self):
        one, two = poses_of([self.ONE, self.TWO]), poses_of([self.TWO, self.ONE])
        for row, expected in zip(composed(one, two), (self.ONE @ self.TWO, self.TWO @ self.ONE), strict=True):
            np.testing.assert_allclose(placement_of(row).matrix, expected.matrix, atol=1e-12)
        for row, expected in zip(composed(one, two[:1]), (self.ONE @ self.TWO, self.TWO @ self.TWO), strict=True):
            np.testing.assert_allclose(placement_of(row).matrix, expected.matrix, atol=1e-12)
        for row, pose in zip(inverses(one), (self.ONE, self.TWO), strict=True):
            np.testing.assert_allclose(placement_of(row).matrix, pose.inverse().matrix, atol=1e-12)

    def test_points_are_placed_as_by_each_placement(self):
        points_m = walls_of_the_flat(0)
        x, y = placed(poses_of([self.ONE, self.TWO]), points_m)
        for row, pose in enumerate((self.ONE, self.TWO)):
            np.testing.assert_allclose(np.stack([x[row], y[row]], axis=1), pose.apply(points_m), atol=1e-4)


class TestAlign:
    @pytest.mark.parametrize("start", off_by(0.5, 4.0))
    def test_converges_from_half_a_metre_and_4_degrees(self, start):
        """The steps of the two passes, taken twice; the first time they end near by."""
        target, walls_m = noisy(2)
        (once,) = aligned(target, evenly(walls_m, LIMITS.points), start)
        assert errors(once, IDENTITY, CENTRE_M)[0] < 0.3
        (found,) = aligned(target, evenly(walls_m, LIMITS.points), once)
        position_m, angle_deg = errors(found, IDENTITY, CENTRE_M)
        assert position_m < 0.03
        assert angle_deg < 0.2
        assert found.scale == 1.0

    @pytest.mark.parametrize("start", off_by(0.35, 3.0))
    def test_converges_with_few_points_and_then_with_more(self, start):
        target, walls_m = noisy(2)
        (rough,) = aligned(target, evenly(walls_m, LIMITS.rough_points), start, reject_m=LIMITS.rough_reject_m)
        (found,) = aligned(target, evenly(walls_m, LIMITS.points), rough, reject_m=LIMITS.reject_m)
        position_m, angle_deg = errors(found, IDENTITY, CENTRE_M)
        assert position_m < 0.04
        assert angle_deg < 0.3

    @pytest.mark.parametrize("start", off_by(0.3, 1.5))
    def test_converges_closely_from_30_cm_and_1_5_degrees(self, start):
        target, walls_m = noisy(2)
        (found,) = aligned(target, walls_m, start)
        position_m, angle_deg = errors(found, IDENTITY, CENTRE_M)
        assert position_m < 0.02
        assert angle_deg < 0.1

    def test_candidates_do_not_matter_to_each_other(self):
        target, walls_m = noisy(2)
        starts = [*off_by(0.5, 4.0), Sim2(500.0, 3.0), Sim2(2.0, 1.0, 2.0)]
        together = aligned(target, walls_m, *starts)
        for start, found in zip(starts, together, strict=True):
            (alone,) = aligned(target, walls_m, start)
            assert errors(alone, found, CENTRE_M) == pytest.approx((0.0, 0.0), abs=1e-4)

    @pytest.mark.parametrize("start", off_by(0.3, 1.5)[:4])
    def test_outliers_do_not_pull_it_away(self, start):
        """30% of the points stand about half a metre beside a wall, all on the same side."""
        target, walls_m = noisy(2)
        rng = np.random.default_rng(7)
        wrong = rng.uniform(size=len(walls_m)) < 0.3
        walls_m[wrong] += rng.uniform((0.3, 0.3), (0.7, 0.7), (int(wrong.sum()), 2))
        (found,) = aligned(target, walls_m, start)
        position_m, angle_deg = errors(found, IDENTITY, CENTRE_M)
        assert position_m < 0.05
        assert angle_deg < 0.2

    def test_a_map_on_itself_stays_where_it_is(self):
        prepared = prepared_map(flat())
        (found,) = aligned(prepared, prepared.walls_m, IDENTITY)
        assert errors(found, IDENTITY, CENTRE_M)[0] < 1e-3

    def test_far_from_every_wall_the_start_is_returned(self):
        target, walls_m = noisy(2)
        far = Sim2(500.0, 0.0, 0.4)
        assert aligned(target, walls_m, far) == [far]
        assert aligned(target, walls_m, far, scales=SCALES) == [far]

    def test_points_beyond_the_map_say_nothing(self):
        """Half of the source lies outside of what the target knows."""
        target, walls_m = noisy(2)
        (found,) = aligned(target, np.vstack([walls_m, walls_m - (30.0, 20.0)]), IDENTITY)
        assert errors(found, IDENTITY, CENTRE_M)[0] < 0.02

    def test_slides_along_a_line_no_further_than_it_started(self):
        line = prepared_map(filled(100, 2, 200))
        (found,) = aligned(line, line.walls_m, Sim2(0.5, 0.1, math.radians(1.0)))
        assert abs(wrap_angle(found.yaw_rad)) < math.radians(0.2)
        assert found.apply_point(5.0, 0.05)[1] == pytest.approx(0.05, abs=0.03)


class TestScale:
    @pytest.mark.parametrize("scale", [0.5, 2.0, 1.07])
    def test_is_kept_where_it_is_given(self, scale):
        target, walls_m = noisy(2)
        (found,) = aligned(target, walls_m / scale, Sim2(0.1, 0.1, scale=scale))
        assert found.scale == scale
        assert errors(found, Sim2(scale=scale), (CENTRE_M[0] / scale, CENTRE_M[1] / scale))[0] < 0.02

    @pytest.mark.parametrize("true", [0.5, 0.9, 1.0, 1.6])
    @pytest.mark.parametrize("factor", [0.97, 1.03])
    def test_is_found_where_it_is_free(self, true, factor):
        """Off by as much as half a step of the scales that are tried."""
        target, walls_m = noisy(2)
        for start in off_by(0.2, 1.5, factor):
            (found,) = aligned(target, walls_m / true, start @ Sim2(scale=true), scales=SCALES)
            assert found.scale == pytest.approx(true, rel=0.003)
            position_m, angle_deg = errors(found, Sim2(scale=true), (CENTRE_M[0] / true, CENTRE_M[1] / true))
            assert position_m < 0.03
            assert angle_deg < 0.2

    def test_stays_within_its_limits(self):
        target, walls_m = noisy(2)
        for start in (0.98, 1.0, 1.02):
            (found,) = aligned(target, walls_m / 1.2, Sim2(scale=start), scales=(0.97, 1.03))
            assert 0.97 - 1e-9 <= found.scale <= 1.03 + 1e-9


class TestFew:
    @pytest.mark.parametrize("scales", [(1.0, 1.0), SCALES])
    @pytest.mark.parametrize("name", FEW_POINTS)
    def test_points_have_an_outcome(self, name, scales):
        target, _ = noisy(2)
        for found in aligned(target, FEW_POINTS[name], IDENTITY, Sim2(1.0, 1.0, 0.5), scales=scales):
            assert all(map(math.isfinite, (found.x_m, found.y_m, found.yaw_rad)))

    @pytest.mark.parametrize("scales", [(1.0, 1.0), SCALES])
    @pytest.mark.parametrize("grid", [filled(-1, 4, 4), filled(0, 9, 9), filled(100, 1, 1), filled(100, 1, 90)])
    def test_walls_have_an_outcome(self, grid, scales):
        (found,) = aligned(prepared_map(grid), walls_of_the_flat(1), IDENTITY, scales=scales)
        assert all(map(math.isfinite, (found.x_m, found.y_m, found.yaw_rad)))

    def test_no_candidates(self):
        target, walls_m = noisy(2)
        assert align(target, walls_m, poses_of([]), REJECT_M).shape == (0, 4)


class TestEvenly:
    @pytest.mark.parametrize(("count", "most"), [(10, 3), (1000, 7), (8, 8), (3, 9), (0, 5), (5, 1), (5, 0)])
    def test_at_most_so_many_each_once(self, count, most):
        points = np.arange(2.0 * count).reshape(-1, 2)
        chosen = evenly(points, most)
        assert len(chosen) == min(count, most)
        assert len(np.unique(chosen, axis=0)) == len(chosen)
        if count > 0 and most > 1:
            assert np.array_equal(chosen[[0, -1]], points[[0, -1]])
