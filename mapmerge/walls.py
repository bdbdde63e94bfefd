"""Walls of a map as points, kept up to date by region: thinned, numbered, with directions, and which one is nearest.

All places are counted in whole cells and squares of the map's lattice, so that what is kept up to date is, to the bit,
what is computed anew of the same map.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmerge.grid import Counted, Mask
from mapmerge.plane import NOTHING, Box, Plane
from mapmerge.sim2 import Points

Whole = NDArray[np.int64]
Numbers = NDArray[np.int32]

_Item = TypeVar("_Item", bound=np.generic)

NO_WALL = 0
DIRECTION_SQUARES = 7
_BAND_SQUARES = 512
_ROW = 1 << 32
_FRACTIONS = 16
_ROUNDING = 1e-9


class Squares:
    """The squares by which walls are thinned, counted on the same lattice as the cells.

    Parameters
    ----------
    cells
        Side of a square in cells, 1 or more; need not be whole.
    """

    def __init__(self, cells: float) -> None:
        self.cells = cells

    def of(self, cells: Whole) -> Whole:
        """Return the square in which the middle of each cell lies, along one axis."""
        return np.asarray(np.floor((cells + 0.5) / self.cells + _ROUNDING), np.int64)

    def box(self, cells: Box) -> Box:
        """Return the squares that a box of cells touches."""
        if cells.is_empty:
            return NOTHING
        top, left, bottom, right = self.of(np.array(cells, np.int64) - np.array([0, 0, 1, 1], np.int64)).tolist()
        return Box(top, left, bottom + 1, right + 1)

    def rows_of_cells(self, squares: Box) -> tuple[int, int]:
        """Return the first row of cells in a box of squares, and the one after the last."""
        reach = math.ceil(self.cells) + 2
        edges = []
        for row in (squares.top, squares.bottom):
            near = math.floor(row * self.cells) + np.arange(-reach, reach + 1)
            edges.append(int(near[np.argmax(self.of(near) >= row)]))
        return edges[0], edges[1]


class LiveWalls:
    """The walls of one map.

    Parameters
    ----------
    square_cells
        Side of the squares by which walls are thinned, in cells.
    reach_squares
        Beyond how many squares no wall is near.

    Attributes
    ----------
    cell_rows, cell_cols
        Row and column of all occupied cells, row by row, shape (N,) each.
    numbers
        Of the thinned walls, row by row of the squares, shape (M,). A wall keeps its number as long as it is there.
    rows, cols
        Where the wall of each number is, in cells, shape (S,).
    directions
        Of the wall of each number: cosine and sine of twice the angle in which it runs, shape (S, 2).
    nearest
        For each square the number of the nearest wall; `NO_WALL` if none is within reach.
    """

    def __init__(self, square_cells: float, reach_squares: float) -> None:
        self.squares = Squares(square_cells)
        self.reach_squares = reach_squares
        self.cell_rows: Counted = np.empty(0, np.int32)
        self.cell_cols: Counted = np.empty(0, np.int32)
        self.numbers: Numbers = np.empty(0, np.int32)
        self.rows: NDArray[np.float64] = np.zeros(1)
        self.cols: NDArray[np.float64] = np.zeros(1)
        self.directions: NDArray[np.float32] = np.zeros((1, 2), np.float32)
        self.nearest = Plane(np.int32)
        self._keys: Whole = np.empty(0, np.int64)
        self._free: Numbers = np.empty(0, np.int32)

    @property
    def margin_squares(self) -> int:
        """How far around what is known the nearest wall is kept."""
        return math.ceil(self.reach_squares) + 1

    def update(self, occupied: Callable[[Box], Mask], covered: Box, changed: Box) -> None:
        """Take in that a box of cells changed.

        Parameters
        ----------
        occupied
            Tells which cells of a box are occupied.
        covered
            All that is known.
        changed
            What may differ from before.
        """
        moved, appeared = NOTHING, NOTHING
        for band in self.squares.box(changed).bands(_BAND_SQUARES):
            differing, occupancy = self._renew(occupied, covered, band)
            moved, appeared = moved.union(differing), appeared.union(occupancy)
        for band in moved.padded(DIRECTION_SQUARES // 2).bands(_BAND_SQUARES):
            self._direct(band)
        known = self.squares.box(covered).padded(self.margin_squares)
        self.nearest.cover(known)
        for band in appeared.padded(self.margin_squares).within(known).bands(_BAND_SQUARES):
            self._find_nearest(band)

    def _renew(self, occupied: Callable[[Box], Mask], covered: Box, band: Box) -> tuple[Box, Box]:
        """Collect the walls of a band of squares; return the boxes of squares whose walls moved, and came or went."""
        first, last = self.squares.rows_of_cells(band)
        rows = Box(first, covered.left, last, covered.right).within(covered)
        cells = np.flatnonzero(np.ascontiguousarray(occupied(rows))).astype(np.int64)
        row, col = np.divmod(cells, max(1, rows.shape[1]))
        row, col = row + rows.top, col + rows.left
        begin, end = np.searchsorted(self.cell_rows, (first, last))
        self.cell_rows = _spliced(self.cell_rows, begin, end, row.astype(np.int32))
        self.cell_cols = _spliced(self.cell_cols, begin, end, col.astype(np.int32))

        keys, mean_row, mean_col = self._thinned(row, col)
        begin, end = np.searchsorted(self._keys, (band.top * _ROW - _ROW // 2, band.bottom * _ROW - _ROW // 2))
        old_keys, old_numbers = self._keys[begin:end], self.numbers[begin:end]
        known = np.isin(keys, old_keys, assume_unique=True)
        stays = np.isin(old_keys, keys, assume_unique=True)
        numbers = np.empty(len(keys), np.int32)
        numbers[known] = old_numbers[stays]
        numbers[~known] = self._new_numbers(int(np.count_nonzero(~known)))
        self._free = np.concatenate([self._free, old_numbers[~stays]])
        moved = ~known | (self.rows[numbers] != mean_row) | (self.cols[numbers] != mean_col)
        self.rows[numbers], self.cols[numbers] = mean_row, mean_col
        self.numbers = _spliced(self.numbers, begin, end, numbers)
        self._keys = _spliced(self._keys, begin, end, keys)
        gone = old_keys[~stays]
        appeared = _box_of_keys(np.concatenate([keys[~known], gone]))
        return _box_of_keys(np.concatenate([keys[moved], gone])), appeared

    def _thinned(self, row: Whole, col: Whole) -> tuple[Whole, NDArray[np.float64], NDArray[np.float64]]:
        """Return the squares of some cells, sorted, and the middle of the cells of each."""
        if len(row) == 0:
            return np.empty(0, np.int64), np.empty(0), np.empty(0)
        square_row, square_col = self.squares.of(row), self.squares.of(col)
        top, left = int(square_row.min()), int(square_col.min())
        cols = int(square_col.max()) - left + 1
        member = (square_row - top) * cols + (square_col - left)
        count = np.bincount(member)
        filled = np.flatnonzero(count)
        # sums of whole numbers, so that they do not depend on where counting begins
        sums = [np.bincount(member, weights=values)[filled] / count[filled] for values in (row, col)]
        return (filled // cols + top) * _ROW + filled % cols + left, sums[0], sums[1]

    def _new_numbers(self, count: int) -> Numbers:
        """Return numbers that no wall has, those of walls that are gone first."""
        reused, self._free = self._free[:count], self._free[count:]
        first, more = len(self.rows), count - len(reused)
        if more:
            self.rows = np.concatenate([self.rows, np.zeros(more)])
            self.cols = np.concatenate([self.cols, np.zeros(more)])
            self.directions = np.concatenate([self.directions, np.zeros((more, 2), np.float32)])
        return np.concatenate([reused, np.arange(first, first + more, dtype=np.int32)])

    def _within(self, box: Box) -> tuple[Whole, Whole, Numbers]:
        """Return row and column of the squares of a box that hold walls, and the numbers of these."""
        begin, end = np.searchsorted(self._keys, (box.top * _ROW - _ROW // 2, box.bottom * _ROW - _ROW // 2))
        row, col = _rows_and_cols(self._keys[begin:end])
        inside = (col >= box.left) & (col < box.right)
        return row[inside] - box.top, col[inside] - box.left, self.numbers[begin:end][inside]

    def _direct(self, box: Box) -> None:
        """Find which way each wall of some squares runs, from the spread of the walls around it."""
        around = box.padded(DIRECTION_SQUARES // 2)
        row, col, numbers = self._within(around)
        side = self.squares.cells * _FRACTIONS
        # fractions of a cell, in whole numbers: sums are exact wherever counting begins
        x = np.rint(self.cols[numbers] * _FRACTIONS) - math.floor(around.left * side)
        y = np.rint(self.rows[numbers] * _FRACTIONS) - math.floor(around.top * side)
        moments = np.zeros((6, *around.shape))
        moments[:, row, col] = (np.ones_like(x), x, y, x * x, y * y, x * y)
        size = (DIRECTION_SQUARES, DIRECTION_SQUARES)
        half = DIRECTION_SQUARES // 2
        chosen = (row >= half) & (row < around.shape[0] - half) & (col >= half) & (col < around.shape[1] - half)
        row, col, numbers = row[chosen], col[chosen], numbers[chosen]
        count, sum_x, sum_y, sum_xx, sum_yy, sum_xy = (
            cv2.boxFilter(image, cv2.CV_64F, size, normalize=False, borderType=cv2.BORDER_CONSTANT)[row, col]
            for image in moments
        )
        xx, yy, xy = count * sum_xx - sum_x**2, count * sum_yy - sum_y**2, count * sum_xy - sum_x * sum_y
        total = np.maximum(xx + yy, 1.0)
        self.directions[numbers] = np.stack([(xx - yy) / total, 2 * xy / total], axis=1).astype(np.float32)

    def _find_nearest(self, box: Box) -> None:
        """Find the wall that is nearest to each square of a box."""
        around = box.padded(self.margin_squares)
        row, col, numbers = self._within(around)
        target = self.nearest.part(box)
        if len(numbers) == 0:
            target[:] = NO_WALL
            return
        is_empty = np.full(around.shape, 255, np.uint8)
        is_empty[row, col] = 0
        distance, labels = cv2.distanceTransformWithLabels(
            is_empty, cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
        )
        number_of = np.zeros(len(numbers) + 1, np.int32)
        number_of[labels[row, col]] = numbers
        inner = box.slices(around)
        target[:] = np.where(distance[inner] <= self.reach_squares, number_of[labels[inner]], np.int32(NO_WALL))


def thinned(points_m: Points, spacing_m: float) -> Points:
    """Return the mean point of each occupied square of this side, row by row."""
    if len(points_m) == 0:
        return points_m
    square = np.floor(points_m / spacing_m + 1e-9).astype(np.intp)
    square -= square.min(axis=0)
    member = square[:, 1] * (int(square[:, 0].max()) + 1) + square[:, 0]
    count = np.bincount(member)
    key = np.flatnonzero(count)
    sums = [np.bincount(member, weights=points_m[:, axis])[key] for axis in (0, 1)]
    means: Points = np.stack(sums, axis=1) / count[key][:, None]
    return means


def _spliced(values: NDArray[_Item], begin: np.intp, end: np.intp, new: NDArray[_Item]) -> NDArray[_Item]:
    """Return values of which some, from ``begin`` to ``end``, are replaced."""
    return np.concatenate([values[:begin], new, values[end:]])


def _rows_and_cols(keys: Whole) -> tuple[Whole, Whole]:
    row = (keys + _ROW // 2) // _ROW
    return row, keys - row * _ROW


def _box_of_keys(keys: Whole) -> Box:
    if len(keys) == 0:
        return NOTHING
    row, col = _rows_and_cols(keys)
    return Box(int(row.min()), int(col.min()), int(row.max()) + 1, int(col.max()) + 1)
