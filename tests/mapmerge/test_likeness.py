"""How alike maps are is told as it is."""

from __future__ import annotations

import numpy as np
import pytest

from mapmerge.config import CellConfig
from mapmerge.grid import Grid
from mapmerge.likeness import Likeness, likeness
from mapmerge.sim2 import IDENTITY, Sim2

CELLS = CellConfig()
CELL_M = 0.1


def room(shift_cells: int = 0, *, unknown_from: int | None = None) -> Grid:
    """A room with walls one cell thick, shifted to the right, known up to a column."""
    cells = np.full((40, 60), -1, np.int8)
    cells[5:35, 5 + shift_cells : 45 + shift_cells] = 100
    cells[6:34, 6 + shift_cells : 44 + shift_cells] = 0
    if unknown_from is not None:
        cells[:, unknown_from:] = -1
    return Grid(cells, CELL_M, Sim2(-2.0, 1.0))


def compared(found: Grid, true: Grid, pose: Sim2 = IDENTITY, tolerance_m: float = 0.1) -> Likeness:
    return likeness(found, true, pose, tolerance_m, CELLS)


def test_a_map_is_like_itself() -> None:
    assert compared(room(), room()) == Likeness(1.0, 1.0, 0.0, 0.0, 1.0, 1.0, 1.0)


def test_walls_within_the_tolerance_are_right() -> None:
    found = compared(room(1), room())
    assert (found.walls_right, found.walls_found) == (1.0, 1.0)
    assert found.cells_alike is not None
    assert 0.9 < found.cells_alike < 1.0


def test_walls_beyond_it_are_not() -> None:
    found = compared(room(3), room())
    # the walls along the shift stay where they are
    assert found.walls_right == pytest.approx(found.walls_found)
    # of the wall across it one cell at each end has a true wall beside it; the other one is where nothing is known
    assert found.walls_right == pytest.approx((2 * 38 + 2) / (2 * 38 + 28))
    assert found.far_wall_error_m == pytest.approx(0.3)
    assert found.free_iou == pytest.approx(35 / 39)


def test_what_the_map_does_not_know_is_held_against_its_coverage_alone() -> None:
    found = compared(room(unknown_from=25), room())
    assert (found.walls_right, found.walls_found, found.cells_alike) == (1.0, 1.0, 1.0)
    assert found.free_covered == pytest.approx(0.5, abs=0.02)


def test_what_the_true_map_does_not_know_is_held_against_nothing() -> None:
    found = compared(room(), room(unknown_from=25))
    assert found == Likeness(1.0, 1.0, 0.0, 0.0, 1.0, 1.0, 1.0)


@pytest.mark.parametrize("pose", [Sim2(3.0, -1.0), Sim2(1.0, 2.0, 1.2), Sim2(-40.0, 0.0, 3.0)])
def test_the_true_map_may_have_a_frame_of_its_own(pose: Sim2) -> None:
    own = room()
    other = Grid(own.cells, CELL_M, pose.inverse() @ own.map_from_grid)
    assert compared(own, other, pose) == Likeness(1.0, 1.0, 0.0, 0.0, 1.0, 1.0, 1.0)


def test_a_finer_true_map_is_as_true() -> None:
    fine = Grid(np.repeat(np.repeat(room().cells, 4, 0), 4, 1), CELL_M / 4, room().map_from_grid)
    found = compared(room(), fine)
    assert (found.walls_right, found.walls_found) == (1.0, 1.0)
    assert found.cells_alike == 1.0


def test_maps_that_have_nothing_in_common_say_nothing() -> None:
    nothing = Grid(np.full((5, 5), -1, np.int8), CELL_M)
    assert compared(nothing, nothing) == Likeness(None, None, None, None, None, None, None)
    found = compared(room(), room(), Sim2(500.0, 0.0))
    assert (found.walls_right, found.walls_found, found.wall_error_m, found.cells_alike) == (None, None, None, None)
    assert found.free_covered == 0.0
