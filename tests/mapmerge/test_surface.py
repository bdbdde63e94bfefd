"""Shifts of one map on another from the correlation of coarse maps."""

import math

import numpy as np
import pytest

from mapmerge.config import SearchConfig
from mapmerge.grid import Grid
from mapmerge.match.surface import CoarseCells, TranslationSearch, surface_peaks
from mapmerge.sim2 import IDENTITY, Sim2
from tests.floors import errors, filled, flat, hall_and_part, prepared_map

SEARCH = SearchConfig()
WEIGHTS = SEARCH.free_weights
PLACES = [Sim2(), Sim2(3.0, -2.0), Sim2(-1.7, 1.1, 0.6), Sim2(0.4, 9.0, -2.8)]
PARTS = [(1.0, 1.0), (1.0, 29.0), (44.0, 2.0), (45.0, 28.0)]


def searched(target, source, turn=IDENTITY, most=SEARCH.max_side_cells):
    cells = CoarseCells(SEARCH.cell_m, SEARCH.large_cell_m, SEARCH.many_side_cells, most)
    return TranslationSearch(target, source, cells, WEIGHTS, [turn])


def surfaces(target, source, yaw_rad=0.0, scale=1.0):
    turn = Sim2(0.0, 0.0, yaw_rad, scale)
    return searched(target, source, turn).surfaces(turn)


def peaks(surface):
    return surface_peaks(surface, SEARCH.peak_distance_m)


def best_shift(surface):
    return Sim2(*peaks(surface)[0][0].tolist())


def on_grids(place, target, source):
    """Return a placement between map frames as one between grid frames."""
    return target.grid.map_from_grid.inverse() @ place @ source.grid.map_from_grid


class TestShift:
    @pytest.mark.parametrize("place", PLACES)
    @pytest.mark.parametrize("half", [False, True])
    def test_a_known_shift_is_the_best_peak_of_its_half(self, place, half):
        """The surfaces of the turn come first, then those of the turn and 180°."""
        target, source = prepared_map(flat(ragged=1)), prepared_map(flat(Sim2(-1.0, -1.0) @ place, ragged=2, size_m=14))
        truth = on_grids(place, target, source)
        found = surfaces(target, source, truth.yaw_rad + (math.pi if half else 0.0))
        assert len(found) == 2 * len(WEIGHTS)
        for surface in found[len(WEIGHTS) :] if half else found[: len(WEIGHTS)]:
            best = best_shift(surface)
            assert best.yaw_rad == pytest.approx(truth.yaw_rad)
            assert errors(best, truth, (2.0, 2.0))[0] < SEARCH.cell_m

    @pytest.mark.parametrize("part_m", PARTS)
    @pytest.mark.parametrize("yaw_rad", [0.3, -2.9, math.pi / 2])
    @pytest.mark.parametrize("half", [False, True])
    def test_a_small_part_is_found_anywhere_on_a_large_map(self, part_m, yaw_rad, half):
        """The shift may be larger than half of the surface."""
        hall, part, place = hall_and_part(part_m, yaw_rad)
        for target, source, true in ((hall, part, place), (part, hall, place.inverse())):
            maps = prepared_map(target), prepared_map(source)
            truth = on_grids(true, *maps)
            found = surfaces(*maps, truth.yaw_rad + (math.pi if half else 0.0))[-1 if half else len(WEIGHTS) - 1]
            shifts = [Sim2(*pose.tolist()) for pose in peaks(found)[0][:3]]
            assert min(errors(shift, truth, (2.0, 2.0))[0] for shift in shifts) < 1.5 * SEARCH.cell_m

    @pytest.mark.parametrize("scale", [0.5, 0.8, 1.25, 2.0])
    @pytest.mark.parametrize("half", [False, True])
    def test_of_a_map_of_another_scale(self, scale, half):
        target = prepared_map(flat(ragged=1))
        source = flat(Sim2(-1.3, -1.2, 0.4), ragged=2, size_m=12)
        relabelled = prepared_map(Grid(source.cells, source.resolution_m / scale))
        place = Sim2(-1.0, -1.0).inverse() @ Sim2(-1.3, -1.2, 0.4, scale)
        truth = on_grids(place, target, relabelled)
        found = surfaces(target, relabelled, truth.yaw_rad + (math.pi if half else 0.0), scale)
        best = best_shift(found[-1 if half else 0])
        assert best.scale == scale
        assert errors(best, truth, (2.0, 2.0))[0] < SEARCH.cell_m

    def test_a_copy_lies_where_it_is(self):
        target = prepared_map(flat(ragged=1))
        for surface in surfaces(target, target)[: len(WEIGHTS)]:
            assert errors(best_shift(surface), IDENTITY, (0.0, 0.0))[0] < SEARCH.cell_m

    @pytest.mark.parametrize("turn_rad", [0.0, 0.6, math.pi])
    def test_every_shift_that_lets_maps_meet_is_on_the_surface(self, turn_rad):
        wide, tall = prepared_map(filled(100, 20, 200)), prepared_map(filled(100, 160, 10))
        for target, source in ((wide, tall), (tall, wide)):
            for surface in surfaces(target, source, turn_rad):
                corners_m = surface.turn.apply(source.walls_m)
                rows, cols = np.indices(surface.values.shape).reshape(2, -1)
                x_m, y_m = surface.shift_m(rows, cols)
                slack_m = surface.step_m
                assert x_m.min() <= target.walls_m[:, 0].min() - corners_m[:, 0].max() + slack_m
                assert y_m.min() <= target.walls_m[:, 1].min() - corners_m[:, 1].max() + slack_m
                assert x_m.max() >= target.walls_m[:, 0].max() - corners_m[:, 0].min() - slack_m
                assert y_m.max() >= target.walls_m[:, 1].max() - corners_m[:, 1].min() - slack_m

    def test_room_for_other_turns_changes_no_value(self):
        target, source = prepared_map(flat(ragged=1)), prepared_map(flat(Sim2(-1.0, -1.0, 0.4), ragged=2))
        turns = [Sim2(yaw_rad=yaw_rad) for yaw_rad in (0.4, 1.0, 2.7)]
        for turn in turns:
            together = TranslationSearch(target, source, CoarseCells(0.2, 0.2, 1500, 1500), WEIGHTS, turns).surfaces(
                turn
            )
            for one, alone in zip(together, searched(target, source, turn).surfaces(turn), strict=True):
                poses, values = peaks(alone)
                for pose, value in zip(poses[:5], values[:5], strict=True):
                    assert one.values[one.index(Sim2(*pose.tolist()))] == pytest.approx(value, rel=1e-4)

    def test_the_value_of_a_placement_is_that_of_its_shift(self):
        target, source = prepared_map(flat(ragged=1)), prepared_map(flat(Sim2(-1.0, -1.0, 0.4), ragged=2))
        for surface in surfaces(target, source, 0.4):
            poses, values = peaks(surface)
            for pose, value in zip(poses[:5], values[:5], strict=True):
                assert surface.values[surface.index(Sim2(*pose.tolist()))] == value

    def test_a_large_map_has_coarser_cells(self):
        target = prepared_map(flat(ragged=1))
        for most in (40, 100):
            surface = searched(target, target, most=most).surfaces(IDENTITY)[0]
            # the transform takes sizes that are products of small numbers, and a few cells of margin
            assert max(surface.values.shape) <= 1.2 * most + 5
            assert errors(best_shift(surface), IDENTITY, (0.0, 0.0))[0] < surface.step_m


class TestValues:
    def test_are_metres_of_wall(self):
        target = prepared_map(flat())
        length_m = len(target.walls_m) * SEARCH.wall_spacing_m
        for surface in surfaces(target, target)[: len(WEIGHTS)]:
            assert 0.3 * length_m < peaks(surface)[1][0] < 3.0 * length_m

    def test_a_wall_in_free_space_costs_and_more_with_a_larger_weight(self):
        """Two maps with a wall each, and free space where the other has its wall."""
        cells = np.zeros((2, 80, 80), np.int8)
        cells[0, 10], cells[1, 70] = 100, 100
        target, source = (prepared_map(Grid(layer, 0.05)) for layer in cells)
        values = [surface.values[surface.index(IDENTITY)] for surface in surfaces(target, source)[: len(WEIGHTS)]]
        assert values[0] < -1.0
        assert values == sorted(values, reverse=True)

    def test_maps_without_free_space_have_walls_on_walls_only(self):
        walls = prepared_map(Grid(np.where(flat().cells == 100, 100, -1).astype(np.int8), 0.05))
        for surface in surfaces(walls, walls, 0.2):
            assert surface.values.min() > -1e-2 * surface.values.max()


class TestPeaks:
    def test_are_apart_and_best_first(self):
        target = prepared_map(flat(ragged=1))
        poses, values = peaks(surfaces(target, target)[0])
        assert len(values) > 1
        assert (np.diff(values) <= 0).all()
        apart_m = np.abs(poses[:, None, :2] - poses[None, :, :2]).max(axis=2)
        np.fill_diagonal(apart_m, np.inf)
        assert apart_m.min() >= SEARCH.peak_distance_m - 1e-9

    @pytest.mark.parametrize(
        "grid", [filled(100, 1, 1), filled(100, 1, 100), filled(100, 40, 40), filled(0, 40, 40), filled(-1, 4, 4)]
    )
    def test_maps_with_little_on_them_have_an_outcome(self, grid):
        few, other = prepared_map(grid), prepared_map(flat())
        for target, source in ((few, other), (other, few), (few, few)):
            for surface in surfaces(target, source, 0.3):
                assert np.isfinite(surface.values).all()
                poses, values = peaks(surface)
                assert poses.shape == (len(values), 4)
                assert np.isfinite(poses).all()


class TestCoarseCells:
    CELLS = CoarseCells(cell_m=0.2, large_cell_m=0.3, many_side_cells=600, max_side_cells=1000)

    @pytest.mark.parametrize(
        ("extent_m", "least_m", "side_m"),
        [
            pytest.param(50.0, 0.05, 0.2, id="small"),
            pytest.param(50.0, 0.5, 0.5, id="small, of large cells"),
            pytest.param(150.0, 0.05, 0.25, id="between"),
            pytest.param(250.0, 0.05, 0.3, id="large"),
            pytest.param(500.0, 0.05, 0.5, id="too large"),
        ],
    )
    def test_are_larger_where_there_are_many(self, extent_m, least_m, side_m):
        assert self.CELLS.side_m(extent_m, least_m) == pytest.approx(side_m)
