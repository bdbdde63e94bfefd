"""Grids: what no map can be, and where cells lie."""

import math

import numpy as np
import pytest

from mapmerge.errors import GridError
from mapmerge.grid import MAX_SIDE_CELLS, Grid, cell_centres_m
from mapmerge.sim2 import Sim2

CELLS = np.array([[0, -1, 100], [50, 0, -1]], np.int8)


class TestValidation:
    @pytest.mark.parametrize("cells", [np.zeros(6, np.int8), np.zeros((1, 2, 3), np.int8), np.zeros((), np.int8)])
    def test_other_than_two_dimensions(self, cells):
        with pytest.raises(GridError, match="shape"):
            Grid(cells, 0.05)

    @pytest.mark.parametrize("dtype", [np.uint8, np.int16, np.float32, np.bool_])
    def test_other_than_int8(self, dtype):
        with pytest.raises(GridError, match=np.dtype(dtype).name):
            Grid(CELLS.astype(dtype), 0.05)

    @pytest.mark.parametrize("resolution_m", [0.0, -0.0, -0.05, math.nan, math.inf])
    def test_no_resolution(self, resolution_m):
        with pytest.raises(GridError, match="resolution"):
            Grid(CELLS, resolution_m)

    @pytest.mark.parametrize("value", [math.inf, -math.inf, math.nan])
    @pytest.mark.parametrize("name", ["x_m", "y_m"])
    def test_nowhere(self, name, value):
        with pytest.raises(GridError, match="origin"):
            Grid(CELLS, 0.05, Sim2(**{name: value}))

    def test_no_direction(self):
        with pytest.raises(GridError, match="origin"):
            Grid(CELLS, 0.05, Sim2(yaw_rad=math.nan))

    def test_scaled_origin(self):
        with pytest.raises(GridError, match="scale"):
            Grid(CELLS, 0.05, Sim2(scale=2.0))

    @pytest.mark.parametrize("shape", [(MAX_SIDE_CELLS + 1, 1), (1, MAX_SIDE_CELLS + 1), (MAX_SIDE_CELLS + 1,) * 2])
    def test_too_large_a_side(self, shape):
        with pytest.raises(GridError, match=str(MAX_SIDE_CELLS + 1)):
            Grid(np.broadcast_to(np.int8(0), shape), 0.05)

    def test_the_largest_side(self):
        grid = Grid(np.broadcast_to(np.int8(0), (MAX_SIDE_CELLS, 2)), 0.05)
        assert (grid.rows, grid.cols) == (MAX_SIDE_CELLS, 2)

    @pytest.mark.parametrize("shape", [(0, 0), (0, 5), (5, 0)])
    def test_no_cells_are_a_map_that_knows_nothing(self, shape):
        grid = Grid(np.zeros(shape, np.int8), 0.05)
        assert grid.known_area_m2 == 0.0
        assert grid.cropped_to_known().cells.shape == (0, 0)
        assert grid.centres_m(grid.known).shape == (0, 2)


class TestValue:
    def test_is_read_only(self):
        grid = Grid(CELLS.copy(), 0.05)
        with pytest.raises(ValueError, match="read-only"):
            grid.cells[0, 0] = 1
        with pytest.raises(AttributeError):
            grid.resolution_m = 0.1

    def test_does_not_change_with_the_array_that_it_was_made_of(self):
        """As of a SLAM that publishes from one buffer."""
        buffer = np.zeros((2, 3), np.int8)
        grid = Grid(buffer, 0.1)
        buffer[:] = 100
        assert not grid.cells.any()

    def test_leaves_the_given_array_writeable(self):
        cells = CELLS.copy()
        Grid(cells, 0.05)
        cells[0, 0] = 7
        assert cells[0, 0] == 7

    def test_knows_its_area(self):
        assert Grid(CELLS, 0.5).known_area_m2 == pytest.approx(4 * 0.25)
        assert Grid(CELLS, 0.5).known.tolist() == [[True, False, True], [True, True, False]]

    def test_same_as(self):
        grid = Grid(CELLS, 0.05, Sim2(1.0, 2.0, 0.3))
        assert grid.same_as(Grid(CELLS.copy(), 0.05, Sim2(1.0, 2.0, 0.3)))
        changed = CELLS.copy()
        changed[1, 2] = 0
        for other in (
            Grid(changed, 0.05, grid.map_from_grid),
            Grid(CELLS, 0.06, grid.map_from_grid),
            Grid(CELLS, 0.05, Sim2(1.0, 2.0, 0.3001)),
            Grid(CELLS[:, :2], 0.05, grid.map_from_grid),
        ):
            assert not grid.same_as(other)
            assert not other.same_as(grid)


class TestPlaces:
    def test_row_0_is_the_lowest_and_the_origin_is_an_outer_corner(self):
        grid = Grid(CELLS, 0.5, Sim2(10.0, 20.0))
        centres = grid.centres_m(grid.cells == 100)
        np.testing.assert_allclose(centres, [[11.25, 20.25]])
        np.testing.assert_allclose(grid.centres_m(grid.cells == 50), [[10.25, 20.75]])

    def test_turned_origin(self):
        grid = Grid(CELLS, 0.5, Sim2(10.0, 20.0, math.pi / 2))
        np.testing.assert_allclose(grid.centres_m(grid.cells == 100), [[9.75, 21.25]])

    def test_centres_are_x_and_y_row_by_row(self):
        centres = cell_centres_m(np.array([0, 0, 2]), np.array([0, 3, 1]), 0.1)
        np.testing.assert_allclose(centres, [[0.05, 0.05], [0.35, 0.05], [0.15, 0.25]])


class TestCropped:
    @pytest.mark.parametrize("origin", [Sim2(), Sim2(-3.0, 4.0), Sim2(5.0, -6.0, 0.7), Sim2(1.0, 1.0, -2.5)])
    def test_every_known_cell_keeps_its_place_and_value(self, origin):
        cells = np.full((30, 40), -1, np.int8)
        cells[4:20, 7:31] = np.random.default_rng(3).integers(-1, 101, (16, 24))
        cells[4, 7] = cells[19, 30] = 0
        grid = Grid(cells, 0.05, origin)
        cropped = grid.cropped_to_known()
        assert cropped.cells.shape == (16, 24)
        assert cropped.resolution_m == grid.resolution_m
        assert cropped.cells[cropped.known].tolist() == grid.cells[grid.known].tolist()
        np.testing.assert_allclose(cropped.centres_m(cropped.known), grid.centres_m(grid.known), atol=1e-12)

    def test_one_cell(self):
        cells = np.full((5, 6), -1, np.int8)
        cells[4, 5] = 33
        cropped = Grid(cells, 1.0).cropped_to_known()
        assert cropped.cells.tolist() == [[33]]
        assert cropped.map_from_grid == Sim2(5.0, 4.0)

    def test_nothing_unknown_around_stays_as_it_is(self):
        grid = Grid(np.zeros((3, 4), np.int8), 0.05, Sim2(1.0, 2.0, 0.4))
        assert grid.cropped_to_known().same_as(grid)

    def test_nothing_known(self):
        cropped = Grid(np.full((7, 8), -1, np.int8), 0.05, Sim2(1.0, 2.0, 0.4)).cropped_to_known()
        assert cropped.cells.shape == (0, 0)
        assert cropped.map_from_grid == Sim2(1.0, 2.0, 0.4)
