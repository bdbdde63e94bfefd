"""What a map is turned into before it is matched."""

import math

import numpy as np
import pytest

from mapmerge.grid import Grid
from mapmerge.prepare import prepare
from mapmerge.prepared import (
    CELL_FREE,
    CELL_OCCUPIED,
    CELL_UNKNOWN,
    CELL_UNSURE,
    MEETS_FREE,
    MEETS_NEAR,
    MEETS_WALL,
)
from mapmerge.sim2 import Sim2
from mapmerge.walls import thinned
from tests.floors import CONFIG, drawn, filled, flat, prepared_map, within


class TestClasses:
    def test_65_is_occupied_and_25_is_free(self):
        cells = np.array([[65, 64, 26, 25, 0, 100, -1]], np.int8)
        prepared = prepare(Grid(np.vstack([cells, np.zeros_like(cells)]), 0.5), 0.5, CONFIG)
        margin = prepared.margin
        expected = [CELL_OCCUPIED, CELL_UNSURE, CELL_UNSURE, CELL_FREE, CELL_FREE, CELL_OCCUPIED, CELL_UNKNOWN]
        assert prepared.classes[margin, margin:-margin].tolist() == expected
        assert (prepared.classes[:margin] == CELL_UNKNOWN).all()

    def test_outside_is_unknown_and_far_from_walls(self):
        prepared = prepared_map(filled(100, 20, 20))
        outside = np.array([[-50.0, 0.5], [0.5, 80.0], [1.0, -1.2], [1e6, 1e6]])
        index = prepared.flat_index(outside)
        assert (prepared.classes.ravel()[index] == CELL_UNKNOWN).all()
        assert (prepared.meets.ravel()[index] == 0).all()


class TestWalls:
    def test_the_nearest_wall_is_that_of_a_search_but_for_a_square(self):
        prepared = prepared_map(flat(Sim2(-1.0, -1.0, 0.3)))
        points_m = np.random.default_rng(0).uniform(-0.8, np.add(prepared.extent_m, 0.8), (4000, 2))
        reach_m = max(CONFIG.refine.rough_reject_m)
        away_m = np.hypot(*(points_m[:, None] - prepared.walls_m[None]).transpose(2, 0, 1))
        x_m, y_m = points_m.astype(np.float32).T
        nearest = prepared.nearest.wall_at(x_m, y_m)
        found_m = prepared.nearest.distance_m(nearest, x_m, y_m)
        near = away_m.min(axis=1) <= reach_m
        assert 100 < near.sum() < 4000
        slack_m = 2.0 * prepared.wall_spacing_m
        assert (found_m[near] <= away_m.min(axis=1)[near] + slack_m).all()
        assert (found_m[away_m.min(axis=1) > reach_m + slack_m] > reach_m).all()

    def test_a_wall_is_its_own_nearest_one(self):
        prepared = prepared_map(flat(Sim2(-1.0, -1.0, 0.3)))
        x_m, y_m = prepared.walls_m.astype(np.float32).T
        wall = prepared.nearest.wall_at(x_m, y_m)
        assert (prepared.nearest.distance_m(wall, x_m, y_m) == 0.0).all()
        assert np.array_equal(prepared.nearest.directions[wall], prepared.directions)

    def test_no_wall_is_in_reach_of_a_place_beyond_the_padding(self):
        prepared = prepared_map(flat())
        x_m, y_m = np.array([[-30.0, 2.0], [2.0, 90.0], [1e6, -1e6], [40.0, 40.0]], np.float32).T
        nearest = prepared.nearest.wall_at(x_m, y_m)
        assert (prepared.nearest.distance_m(nearest, x_m, y_m) > max(CONFIG.refine.rough_reject_m)).all()

    @pytest.mark.parametrize("degrees", [0.0, 17.0, 45.0, 90.0, 133.0])
    def test_directions_are_those_of_the_walls(self, degrees):
        line = drawn(within(-99, -99, 99, 99), [(-3.0, 2.95, 3.0, 3.05)], size_m=(12.0, 12.0))
        walls = prepared_map(line)
        assert np.abs(walls.directions[3:-3] - (1.0, 0.0)).max() < 0.12
        turned = drawn(
            within(-99, -99, 99, 99),
            [(-3.0, -0.05, 3.0, 0.05)],
            size_m=(12.0, 12.0),
            floor_from_map=Sim2(yaw_rad=-math.radians(degrees)) @ Sim2(-6.0, -6.0),
        )
        found = np.median(prepared_map(turned).directions, axis=0)
        expected = math.cos(2 * math.radians(degrees)), math.sin(2 * math.radians(degrees))
        np.testing.assert_allclose(found, expected, atol=0.12)

    def test_directions_are_short_where_walls_are_no_line(self):
        blob = prepared_map(filled(100, 40, 40))
        middle = np.abs(blob.walls_m - 1.0).max(axis=1) < 0.5
        assert np.hypot(*blob.directions[middle].T).max() < 0.1

    def test_what_a_point_meets(self):
        prepared = prepared_map(flat())
        meets = prepared.meets
        row, col = np.random.default_rng(0).integers((0, 0), meets.shape, (2000, 2)).T
        centres_m = (np.stack([col, row], axis=1) - prepared.margin + 0.5) * 0.05
        away_m = np.hypot(*(centres_m[:, None] - prepared.wall_cells_m[None]).transpose(2, 0, 1)).min(axis=1)
        assert np.array_equal((meets & MEETS_FREE) > 0, prepared.classes == CELL_FREE)
        for bit, limit_m in ((MEETS_WALL, CONFIG.verify.tolerance_m), (MEETS_NEAR, CONFIG.verify.near_m)):
            met = (meets[row, col] & bit) > 0
            assert 0 < met.sum() < len(met)
            # the distance transform is right to a few percent
            assert met[away_m <= 0.96 * limit_m].all()
            assert not met[away_m > 1.04 * limit_m].any()

    def test_cells_are_where_the_grid_has_them(self):
        grid = flat(Sim2(-1.0, -1.0, 0.3))
        prepared = prepared_map(grid)
        in_map = prepared.grid.map_from_grid.apply(prepared.wall_cells_m)
        np.testing.assert_allclose(in_map, grid.centres_m(grid.cells >= 65), atol=1e-9)

    def test_a_metre_of_wall_weighs_about_the_same_at_every_resolution(self):
        """Of cells, there are four times as many at 0.05 m as at 0.1 m."""
        weights = [
            len(prepared_map(flat(Sim2(-1.0, -1.0, 0.3), resolution_m=resolution_m)).walls_m)
            for resolution_m in (0.05, 0.08, 0.1)
        ]
        assert max(weights) < 1.7 * min(weights)

    def test_free_points_weigh_the_area(self):
        prepared = prepared_map(flat())
        free_m2 = (prepared.grid.cells == 0).sum() * 0.05**2
        assert len(prepared.free_m) * 0.25**2 == pytest.approx(free_m2, rel=0.03)


class TestThinned:
    def test_one_mean_point_for_each_square(self):
        points = np.array([[0.01, 0.01], [0.09, 0.05], [0.11, 0.01], [-0.05, 0.31]])
        found = thinned(points, 0.1)
        assert sorted(map(tuple, found.round(6).tolist())) == [(-0.05, 0.31), (0.05, 0.03), (0.11, 0.01)]

    def test_none(self):
        assert thinned(np.empty((0, 2)), 0.1).shape == (0, 2)

    def test_does_not_depend_on_the_order(self):
        points = np.random.default_rng(1).uniform(-5.0, 5.0, (500, 2))
        np.testing.assert_allclose(thinned(points, 0.4), thinned(points[::-1], 0.4), atol=1e-12)


class TestDegenerate:
    @pytest.mark.parametrize(
        "grid",
        [
            filled(0, 0, 0),
            filled(-1, 30, 40),
            filled(0, 30, 40),
            filled(100, 30, 40),
            filled(100, 1, 1),
            filled(0, 1, 1),
            filled(100, 1, 200),
            filled(100, 200, 1),
            filled(100, 3, 3, resolution_m=5.0),
        ],
    )
    @pytest.mark.parametrize("coarser", [1.0, 1.6, 10.0])
    def test_has_an_outcome(self, grid, coarser):
        prepared = prepare(grid, grid.resolution_m * coarser, CONFIG)
        assert prepared.classes.shape == prepared.meets.shape
        assert prepared.directions.shape == prepared.walls_m.shape
        assert np.isfinite(prepared.directions).all()
        x, y = np.random.default_rng(0).uniform(-20.0, 20.0, (2, 50)).astype(np.float32)
        nearest = prepared.nearest.wall_at(x, y)
        assert (nearest >= 0).all()
        assert (nearest <= len(prepared.walls_m)).all()
        assert len(prepared.wall_cells_m) == (prepared.classes == CELL_OCCUPIED).sum()
        assert math.prod(prepared.extent_m) >= 0.0
