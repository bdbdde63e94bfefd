from __future__ import annotations

import numpy as np
import pytest

from mapmerge.grid import Grid
from mapmerge.sim2 import Sim2
from replay.assemble import assemble
from replay.errors import BadMessage
from replay.messages import GridMessage, UpdateMessage

LAST = Grid(np.arange(12, dtype=np.int8).reshape(3, 4), 0.05, Sim2(1.0, 2.0, 0.3))


def part(col: int, row: int, rows: int, cols: int) -> UpdateMessage:
    return UpdateMessage(0, "map", col, row, np.full((rows, cols), 100, np.int8))


def test_a_full_map_replaces_the_last() -> None:
    full = Grid(np.zeros((2, 2), np.int8), 0.1)
    for last in (None, LAST):
        assert assemble(last, GridMessage(0, "map", full)) is full


def test_a_part_replaces_its_cells() -> None:
    found = assemble(LAST, part(1, 1, 2, 2))
    assert found.cells.tolist() == [[0, 1, 2, 3], [4, 100, 100, 7], [8, 100, 100, 11]]
    assert (found.resolution_m, found.map_from_grid) == (0.05, Sim2(1.0, 2.0, 0.3))
    assert LAST.cells[1, 1] == 5


@pytest.mark.parametrize(("col", "row", "rows", "cols"), [(0, 0, 3, 4), (3, 2, 1, 1), (0, 0, 1, 1)])
def test_a_part_may_touch_the_edge(col: int, row: int, rows: int, cols: int) -> None:
    assert np.count_nonzero(assemble(LAST, part(col, row, rows, cols)).cells == 100) == rows * cols


@pytest.mark.parametrize(("col", "row", "rows", "cols"), [(-1, 0, 1, 1), (0, -1, 1, 1), (3, 0, 1, 2), (0, 2, 2, 1)])
def test_a_part_must_not_reach_outside(col: int, row: int, rows: int, cols: int) -> None:
    with pytest.raises(BadMessage, match="reaches outside the map of 4 × 3 cells") as caught:
        assemble(LAST, part(col, row, rows, cols))
    assert caught.value.cause == "update_outside_grid"


def test_a_part_of_nothing() -> None:
    with pytest.raises(BadMessage, match="5 × 2 cells came before any full map") as caught:
        assemble(None, part(0, 0, 2, 5))
    assert caught.value.cause == "update_before_grid"
