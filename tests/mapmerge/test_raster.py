"""What placed maps say of the same pixels."""

from __future__ import annotations

import numpy as np
import pytest

from mapmerge.config import CellConfig
from mapmerge.grid import UNKNOWN_BYTE, Grid
from mapmerge.raster import compared_on, pixels_around, seen, shrunk, values_on
from mapmerge.sim2 import IDENTITY, Sim2
from mapmerge.warp import Layer

CELLS = CellConfig()
TOLERANCE_M = 0.15


def room(resolution_m: float = 0.1, origin: Sim2 = IDENTITY) -> Grid:
    """Return free space of 4 m × 3 m with a wall along its lower edge."""
    cells = np.zeros((round(3 / resolution_m), round(4 / resolution_m)), np.int8)
    cells[0] = 100
    return Grid(cells, resolution_m, origin)


def test_pixels_are_the_cells_of_the_finest_map() -> None:
    pixels = pixels_around([Layer(room(0.1), IDENTITY), Layer(room(0.05), IDENTITY)], 1000)
    assert pixels is not None
    assert pixels.pixel_m == 0.05
    assert pixels.x_m < 0.0 < 4.0 < pixels.x_m + pixels.width_m
    assert pixels.y_m < 0.0 < 3.0 < pixels.y_m + pixels.height_m


@pytest.mark.parametrize("most", [20, 100, 1600])
def test_there_are_never_more_pixels_than_asked_for(most: int) -> None:
    far = Layer(room(), Sim2(500.0, -300.0, 0.7))
    pixels = pixels_around([Layer(room(), IDENTITY), far], most)
    assert pixels is not None
    assert max(pixels.rows, pixels.cols) <= most


def test_maps_that_know_nothing_have_no_picture() -> None:
    nothing = Grid(np.full((9, 9), -1, np.int8), 0.1)
    assert pixels_around([Layer(nothing, IDENTITY)], 100) is None
    assert pixels_around([], 100) is None


def test_a_map_on_its_own_cells_is_shown_as_it_is() -> None:
    grid = room(origin=Sim2(2.0, -1.0))
    layer = Layer(grid, IDENTITY)
    pixels = pixels_around([layer], 1000)
    assert pixels is not None
    values = values_on(layer, pixels, CELLS)
    rows, cols = np.nonzero(values != UNKNOWN_BYTE)
    found = values[rows.min() : rows.max() + 1, cols.min() : cols.max() + 1]
    assert np.array_equal(found, grid.cells.view(np.uint8))


def test_thin_walls_stay_where_pixels_are_large() -> None:
    layer = Layer(room(0.02), IDENTITY)
    pixels = pixels_around([layer], 30)
    assert pixels is not None
    walls = seen(values_on(layer, pixels, CELLS), CELLS).walls
    assert walls.any(axis=0).sum() >= 4.0 / pixels.pixel_m - 1


def walls_compared(shift_m: float) -> tuple[int, int]:
    """Return how many pixels of walls agree and contradict if one of two rooms is moved upwards."""
    layers = [Layer(room(), IDENTITY), Layer(room(), Sim2(0.0, shift_m))]
    pixels = pixels_around(layers, 1000)
    assert pixels is not None
    walls = np.logical_or(*(seen(values_on(layer, pixels, CELLS), CELLS).walls for layer in layers))
    found = compared_on(layers, pixels, CELLS, TOLERANCE_M)
    return int((walls & found.agree).sum()), int((walls & found.contradict).sum())


def test_walls_within_the_tolerance_agree() -> None:
    assert walls_compared(0.0) == (40, 0)
    assert walls_compared(0.1) == (40, 0)  # one of them lies where the other map knows nothing


def test_a_wall_in_the_others_free_space_contradicts_it() -> None:
    assert walls_compared(1.0) == (0, 40)  # that of the lower room lies where the other knows nothing


def test_nobody_agrees_with_himself() -> None:
    layer = Layer(room(), IDENTITY)
    pixels = pixels_around([layer], 1000)
    assert pixels is not None
    found = compared_on([layer], pixels, CELLS, TOLERANCE_M)
    assert not found.agree.any()
    assert not found.contradict.any()


@pytest.mark.parametrize(("most", "sides"), [(1000, (30, 40)), (40, (30, 40)), (39, (15, 20)), (10, (8, 10))])
def test_a_map_is_shrunk_as_far_as_it_must_be_and_keeps_its_walls(most: int, sides: tuple[int, int]) -> None:
    found = shrunk(room(), most, CELLS)
    assert found.cells.shape == sides
    assert (found.cells[0] == 100).all()


def test_a_map_that_knows_nothing_can_be_shrunk() -> None:
    assert shrunk(Grid(np.full((9, 9), -1, np.int8), 0.1), 4, CELLS).cells.size == 0
