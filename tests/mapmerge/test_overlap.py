"""Where placed maps agree and contradict each other."""

import numpy as np
import pytest

from mapmerge.config import CellConfig
from mapmerge.grid import Grid
from mapmerge.overlap import AGREE, CONTRADICT, SHARED, overlap
from mapmerge.sim2 import IDENTITY, Sim2
from mapmerge.warp import Layer
from tests.floors import filled

CELLS = CellConfig()
CELL_M = 0.05


def compared(*layers, lattice=None, tolerance_m=0.1, side=2048):
    first = layers[0].grid
    return overlap(layers, lattice or first, CELLS, tolerance_m=tolerance_m, max_side_cells=side)


def room(wall_col, shape=(60, 80)):
    """A free floor with a wall along a column."""
    cells = np.zeros(shape, np.int8)
    cells[:, wall_col] = 100
    return Grid(cells, CELL_M)


def test_the_same_maps_agree_everywhere():
    found = compared(Layer(room(30), IDENTITY), Layer(room(30), IDENTITY))
    assert set(np.unique(found.kinds)) == {AGREE}
    assert found.kinds.shape == (60, 80)
    assert found.resolution_m == CELL_M


@pytest.mark.parametrize(("off", "kind"), [(1, AGREE), (2, AGREE), (9, CONTRADICT)])
def test_walls_agree_within_the_tolerance_and_contradict_beyond(off, kind):
    found = compared(Layer(room(30), IDENTITY), Layer(room(30 + off), IDENTITY))
    assert set(np.unique(found.kinds[:, [30, 30 + off]])) == {kind}
    assert set(np.unique(found.kinds[:, :25])) == {AGREE}


def test_ground_of_one_map_alone_says_nothing():
    part = np.full((60, 80), -1, np.int8)
    part[:, :40] = 0
    found = compared(Layer(room(70), IDENTITY), Layer(Grid(part, CELL_M), IDENTITY))
    assert found.kinds.shape == (60, 40)
    assert set(np.unique(found.kinds)) == {AGREE}


def test_ground_that_one_of_two_maps_is_not_sure_of_is_shared():
    found = compared(Layer(room(70), IDENTITY), Layer(filled(50, 60, 80), IDENTITY))
    assert set(np.unique(found.kinds)) == {SHARED}


@pytest.mark.parametrize("layers", [[room(30)], [room(30), filled(-1, 60, 80)], [room(30), filled(0, 0, 0)]])
def test_without_common_ground_there_is_nothing(layers):
    assert compared(*(Layer(grid, IDENTITY) for grid in layers)) is None
    assert compared(Layer(room(30), IDENTITY), Layer(room(30), Sim2(90.0, 0.0))) is None


def test_one_map_of_three_that_contradicts_two_is_seen():
    found = compared(*(Layer(room(col), IDENTITY) for col in (30, 30, 60)))
    assert set(np.unique(found.kinds[:, [30, 60]])) == {CONTRADICT}


def test_it_lies_where_the_maps_lie():
    """A turned map on one that has a corner of its own: the wall that contradicts is found where it is."""
    cells = np.zeros((200, 200), np.int8)
    lattice = Grid(cells, CELL_M, Sim2(-5.0, -3.0))
    other = np.zeros((100, 100), np.int8)
    other[60:63, 40:43] = 100
    pose = Sim2(-1.0, 1.0, 0.7)
    found = compared(Layer(lattice, IDENTITY), Layer(Grid(other, CELL_M), pose), lattice=lattice)
    rows, cols = np.nonzero(found.kinds == CONTRADICT)
    at_m = found.merged_from_grid.apply_point((cols.mean() + 0.5) * CELL_M, (rows.mean() + 0.5) * CELL_M)
    assert at_m == pytest.approx(pose.apply_point(41.5 * CELL_M, 61.5 * CELL_M), abs=0.5 * CELL_M)


@pytest.mark.parametrize("side", [2048, 40, 33, 7])
def test_large_maps_are_compared_in_larger_cells_and_thin_walls_stay(side):
    here, there = Layer(room(30, (120, 160)), IDENTITY), Layer(room(120, (120, 160)), Sim2(0.0, 0.0, 1e-3))
    found = compared(here, there, side=side)
    assert max(found.kinds.shape) <= side + 2
    assert (found.kinds == CONTRADICT).sum() * found.resolution_m == pytest.approx(2 * 120 * CELL_M, rel=0.3)
