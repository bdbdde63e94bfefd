"""The lattice that a map's cells lie on: a map that grows keeps it, so that cells can be compared one by one."""

from __future__ import annotations

import cv2
import numpy as np

from mapmerge.grid import UNKNOWN, Cells, Grid, Mask
from mapmerge.plane import NOTHING, Box, read

_BAND_ROWS = 64
_WHOLE = 1e-3
_SAME_RAD = 1e-9
_MOST_CELLS = 1 << 30


def offset_cells(before: Grid, after: Grid) -> tuple[int, int] | None:
    """Return row and column of the first cell of one grid among the cells of another; None if their lattices differ."""
    turn_rad = after.map_from_grid.yaw_rad - before.map_from_grid.yaw_rad
    if before.resolution_m != after.resolution_m or abs(turn_rad) > _SAME_RAD:
        return None
    (x, y), (other_x, other_y) = _corner_cells(after), _corner_cells(before)
    col, row = x - other_x, y - other_y
    if max(abs(col), abs(row)) > _MOST_CELLS or max(abs(col - round(col)), abs(row - round(row))) > _WHOLE:
        return None
    return round(row), round(col)


def changed_box(before: Grid, after: Grid) -> Box | None:
    """Return the smallest box of cells, counted from the first of ``after``, outside of which both say the same.

    A cell beyond a grid is as good as unknown. None if the grids' lattices differ, so that no cell can be compared.
    """
    offset = offset_cells(before, after)
    if offset is None:
        return None
    here = Box(0, 0, *after.cells.shape)
    there = Box(0, 0, *before.cells.shape).shifted(-offset[0], -offset[1])
    both = here.within(there)
    found = NOTHING
    if not both.is_empty:
        found = _differing(after.cells[both.slices(here)], before.cells[both.slices(there)])
        found = found.shifted(both.top, both.left)
    if both != here:
        found = found.union(_known_outside(after, here, both))
    if both != there:
        found = found.union(_known_outside(before, there, both))
    return found


def same_within(before: Grid, after: Grid, offset: tuple[int, int], box: Box) -> bool:
    """Tell whether two grids say the same in a box of cells, counted from the first of ``after``.

    A cell beyond a grid is as good as unknown.

    Parameters
    ----------
    offset
        Of the grids, see `offset_cells`.
    """
    if box.is_empty:
        return True
    here, there = read(after.cells, box, UNKNOWN), read(before.cells, box.shifted(*offset), UNKNOWN)
    return not cv2.norm(here, there, cv2.NORM_INF)


def box_of(mask: Mask) -> Box:
    """Return the smallest box that holds all cells that are set."""
    rows = np.flatnonzero(mask.any(axis=1))
    if rows.size == 0:
        return NOTHING
    top, bottom = int(rows[0]), int(rows[-1]) + 1
    cols = np.flatnonzero(mask[top:bottom].any(axis=0))
    return Box(top, int(cols[0]), bottom, int(cols[-1]) + 1)


def _differing(one: Cells, other: Cells) -> Box:
    """Return the smallest box outside of which two arrays are equal."""
    whole = Box(0, 0, *one.shape)
    bands = list(whole.bands(_BAND_ROWS))

    def differs(band: Box) -> bool:
        # the largest difference of a band is found several times as fast as where it is
        return bool(cv2.norm(one[band.slices(whole)], other[band.slices(whole)], cv2.NORM_INF))

    first = next((band for band in bands if differs(band)), None)
    if first is None:
        return NOTHING
    last = next(band for band in reversed(bands) if band == first or differs(band))
    rows = Box(first.top, 0, last.bottom, whole.right)
    return box_of(one[rows.slices(whole)] != other[rows.slices(whole)]).shifted(rows.top, 0)


def _known_outside(grid: Grid, box: Box, inner: Box) -> Box:
    """Return the box of what a grid, which covers a box, knows outside of an inner one."""
    if inner.is_empty:
        return box_of(grid.known).shifted(box.top, box.left)
    found = NOTHING
    for part in (
        Box(box.top, box.left, inner.top, box.right),
        Box(inner.bottom, box.left, box.bottom, box.right),
        Box(inner.top, box.left, inner.bottom, inner.left),
        Box(inner.top, inner.right, inner.bottom, box.right),
    ):
        if not part.is_empty:
            known = grid.cells[part.slices(box)] >= 0
            found = found.union(box_of(known).shifted(part.top, part.left))
    return found


def _corner_cells(grid: Grid) -> tuple[float, float]:
    """Return x and y of a grid's corner along its own axes, in cells."""
    pose = grid.map_from_grid
    corner = pose.inverse()
    return -corner.x_m / grid.resolution_m, -corner.y_m / grid.resolution_m
