"""The tint of the merged map in the Rerun recording: what is said to be painted anew is all that is not as before."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from mapmerge.config import CellConfig
from mapmerge.grid import UNKNOWN, Grid
from mapmerge.sim2 import IDENTITY, Sim2
from replay.sinks import rerun_overlap
from replay.sinks.rerun_overlap import Tint

CELL_M = 0.05
ROWS, COLS = 40, 60
AROUND = 12
FREE = np.uint8(84)
SLIDING = [HealthCheck.function_scoped_fixture]


def result(merged: Grid, *placed: tuple[Grid, Sim2]) -> Any:
    """Return as much of a result as the tint looks at."""
    names = [f"r{index}" for index in range(len(placed))]
    return SimpleNamespace(
        merged=merged,
        grids={name: grid for name, (grid, _) in zip(names, placed, strict=True)},
        robots={name: SimpleNamespace(merged_from_map=pose) for name, (_, pose) in zip(names, placed, strict=True)},
    )


def ground(merged: Grid) -> Grid:
    """Return free cells on the lattice of a map, and around it: their picture is that of the tint alone."""
    corner = merged.map_from_grid @ Sim2(-AROUND * CELL_M, -AROUND * CELL_M)
    return Grid(np.zeros((ROWS + 2 * AROUND, COLS + 2 * AROUND), np.int8), CELL_M, corner)


def in_colours(pixels: np.ndarray) -> np.ndarray:
    return pixels if pixels.ndim == 3 else np.repeat(pixels[..., None], 3, axis=2)


def room(wall_col: int) -> Grid:
    cells = np.zeros((ROWS, COLS), np.int8)
    cells[:, wall_col] = 100
    return Grid(cells, CELL_M)


def test_agreement_is_green_and_contradiction_red() -> None:
    merged, tint = room(20), Tint(CellConfig(), 0.1)
    tint.update(result(merged, (room(20), IDENTITY), (room(40), IDENTITY)))
    picture = in_colours(tint.paint(merged)).astype(int)
    red, green, blue = picture[5, 5]
    assert green > red == blue - (blue - red)
    assert tuple(picture[5, 20]) == tuple(picture[5, 40]) == (255, 40, 40)
    assert tint.paint(merged).shape == (ROWS, COLS, 3)


def test_where_one_map_is_alone_is_grey() -> None:
    merged, tint = room(20), Tint(CellConfig(), 0.1)
    aside = Sim2(30 * CELL_M, 0.0)
    tint.update(result(merged, (room(20), IDENTITY), (room(20), aside)))
    picture = in_colours(tint.paint(merged))
    assert (picture[:, :15] == FREE).all()
    assert (picture[:, 35:45, 1] > picture[:, 35:45, 0]).all()


def test_a_map_that_is_withdrawn_takes_the_tint_with_it() -> None:
    merged, tint = room(20), Tint(CellConfig(), 0.1)
    tint.update(result(merged, (room(20), IDENTITY), (room(20), IDENTITY)))
    assert tint.update(result(merged, (room(20), IDENTITY))).shape == (ROWS, COLS)
    assert tint.paint(merged).ndim == 2


@st.composite
def patches(draw: st.DrawFn) -> tuple[int, slice, slice, int]:
    row, col = draw(st.integers(0, ROWS - 1)), draw(st.integers(0, COLS - 1))
    rows, cols = slice(row, row + draw(st.integers(1, 9))), slice(col, col + draw(st.integers(1, 9)))
    return draw(st.integers(0, 1)), rows, cols, draw(st.sampled_from([UNKNOWN, 0, 100]))


@pytest.mark.parametrize("most_cells", [1024, 25])
@settings(max_examples=60, deadline=None, suppress_health_check=SLIDING)
@given(
    changes=st.lists(st.tuples(patches(), st.integers(0, 3), st.integers(0, 3), st.booleans()), min_size=1, max_size=6)
)
def test_nothing_changes_but_what_is_said(
    changes: list[tuple[tuple[int, slice, slice, int], int, int, bool]],
    most_cells: int,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(rerun_overlap, "MAX_SIDE_CELLS", most_cells)
    tint, grids = Tint(CellConfig(), 0.1), [room(20), room(22)]
    pose, merged = IDENTITY, Grid(np.zeros((ROWS, COLS), np.int8), CELL_M)
    tint.update(result(merged, (grids[0], IDENTITY), (grids[1], pose)))
    for (which, rows, cols, value), moved, grown, leaves in changes:
        cells = grids[which].cells.copy()
        cells[rows, cols] = value
        grids[which] = Grid(cells, CELL_M)
        pose = Sim2(pose.x_m + moved * CELL_M, pose.y_m) if moved == 3 else pose
        corner = merged.map_from_grid @ Sim2(-grown * CELL_M, 0.0)
        merged = Grid(np.zeros((merged.rows, merged.cols + grown), np.int8), CELL_M, corner)
        before = in_colours(tint.paint(ground(merged))).copy()
        box = tint.update(result(merged, (grids[0], IDENTITY), *(() if leaves else ((grids[1], pose),))))
        differs = (in_colours(tint.paint(ground(merged))) != before).any(axis=2)
        top, left, bottom, right = (max(0, edge + AROUND) for edge in box)
        differs[top:bottom, left:right] = False
        assert not differs.any()
