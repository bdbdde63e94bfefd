"""Walls of a map as points, kept up to date by region: thinned, numbered, with directions, and which one is nearest.

All places are counted in whole cells and squares of the map's lattice, so that what is kept up to date is, to the bit,
what is computed anew of the same map.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmerge.grid import Counted
from mapmerge.keys import Keys, Places, Whole, box_of_keys, exchanged, keys_of, places_of, span_of_rows
from mapmerge.plane import NOTHING, Box, Plane
from mapmerge.sim2 import Points

Numbers = NDArray[np.int32]

NO_WALL = 0
DIRECTION_SQUARES = 7
_BAND_SQUARES = 512
_SPARE = 8
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

    def of(self, cells: Whole | Counted) -> Whole:
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
    numbers
        Of the thinned walls, row by row of the squares, shape (M,). A wall keeps its number as long as it is there.
    rows, cols
        Where the wall of each number is, in cells, shape (S,); anywhere if no wall has that number.
    nearest
        For each square the number of the nearest wall; `NO_WALL` if none is within reach.
    """

    def __init__(self, square_cells: float, reach_squares: float) -> None:
        self.squares = Squares(square_cells)
        self.reach_squares = reach_squares
        self.numbers: Numbers = np.empty(0, np.int32)
        self.rows: NDArray[np.float64] = np.zeros(1)
        self.cols: NDArray[np.float64] = np.zeros(1)
        self.nearest = Plane(np.int32)
        self._keys: Keys = np.empty(0, np.int64)
        self._counts: NDArray[np.int32] = np.zeros(1, np.int32)
        self._free: Numbers = np.empty(0, np.int32)
        self._directions: NDArray[np.float32] = np.zeros((1, 2), np.float32)
        self._undirected = NOTHING

    @property
    def margin_squares(self) -> int:
        """How far around what is known the nearest wall is kept."""
        return math.ceil(self.reach_squares) + 1

    @property
    def directions(self) -> NDArray[np.float32]:
        """Of the wall of each number: cosine and sine of twice the angle in which it runs, shape (S, 2).

        Only a search needs them: they are found when they are asked for, where walls moved since.
        """
        for band in self._undirected.bands(_BAND_SQUARES):
            self._direct(band)
        # only now: another thread may ask, too, and finds the same
        self._undirected = NOTHING
        return self._directions

    def update(self, covered: Box, came: Places, went: Places) -> Numbers:
        """Take in which cells became occupied, and which are so no more; return the numbers of walls in their squares.

        Parameters
        ----------
        covered
            All that is known.
        came, went
            Rows and columns of these cells, row by row.
        """
        moved, appeared, numbers = NOTHING, NOTHING, [np.empty(0, np.int32)]
        for band in self._touched(came).union(self._touched(went)).bands(_BAND_SQUARES):
            rows = self.squares.rows_of_cells(band)
            differing, occupancy, placed = self._renew(_in_rows(came, *rows), _in_rows(went, *rows))
            moved, appeared = moved.union(differing), appeared.union(occupancy)
            numbers.append(placed)
        self._undirected = self._undirected.union(moved.padded(DIRECTION_SQUARES // 2))
        known = self.squares.box(covered).padded(self.margin_squares)
        self.nearest.cover(known)
        for band in appeared.padded(self._reach).within(known).bands(_BAND_SQUARES):
            self._find_nearest(band)
        return np.concatenate(numbers)

    @property
    def _reach(self) -> int:
        """How many squares away along an axis a wall may be near: no distance is shorter than that along an axis."""
        return math.floor(self.reach_squares)

    def _touched(self, cells: Places) -> Box:
        """Return the box of the squares in which cells lie, one column wide: only its rows matter."""
        if len(cells[0]) == 0:
            return NOTHING
        top, bottom = self.squares.of(cells[0][[0, -1]]).tolist()
        return Box(top, 0, bottom + 1, 1)

    def _renew(self, came: Places, went: Places) -> tuple[Box, Box, Numbers]:
        """Take in cells of some rows of squares.

        Returns the boxes of squares whose walls moved, and came or went, and the numbers of those that are there.
        """
        keys, (count, row, col) = self._tallied(came, went)
        if len(keys) == 0:
            return NOTHING, NOTHING, np.empty(0, np.int32)
        place = np.searchsorted(self._keys, keys)
        numbers = np.full(len(keys), NO_WALL, np.int32)
        known = np.zeros(len(keys), np.bool_)
        inside = place < len(self._keys)
        known[inside] = self._keys[place[inside]] == keys[inside]
        numbers[known] = self.numbers[place[known]]

        before = self._counts[numbers]
        count += before
        stays = count > 0
        gone, new = known & ~stays, ~known & stays
        # sums of whole numbers, found again from the means: they do not depend on which cells came when
        row, col = (
            (values + np.rint(means[numbers] * before)) / np.maximum(count, 1)
            for values, means in ((row, self.rows), (col, self.cols))
        )
        numbers[new] = self._new_numbers(int(np.count_nonzero(new)))
        self._free = np.concatenate([self._free, numbers[gone]])
        moved = gone | new | (stays & ((self.rows[numbers] != row) | (self.cols[numbers] != col)))
        there = numbers[stays]
        self._counts[there], self.rows[there], self.cols[there] = count[stays], row[stays], col[stays]
        change = place[gone], place[new]
        self.numbers = exchanged(self.numbers, *change, numbers[new])
        self._keys = exchanged(self._keys, *change, keys[new])
        return box_of_keys(keys[moved]), box_of_keys(keys[gone | new]), there

    def _tallied(self, came: Places, went: Places) -> tuple[Keys, NDArray[np.float64]]:
        """Return the squares of some cells, sorted, and by how much the number of cells of each and their sums grow."""
        row, col = (np.concatenate(both) for both in zip(came, went, strict=True))
        if len(row) == 0:
            return np.empty(0, np.int64), np.empty((3, 0))
        square_row, square_col = self.squares.of(row), self.squares.of(col)
        top, left = int(square_row.min()), int(square_col.min())
        cols = int(square_col.max()) - left + 1
        member = (square_row - top) * cols + (square_col - left)
        sign = np.ones(len(row))
        sign[len(came[0]) :] = -1.0
        touched = np.flatnonzero(np.bincount(member))
        sums: NDArray[np.float64] = np.empty((3, len(touched)))
        for sum_of, values in zip(sums, (sign, sign * row, sign * col), strict=True):
            sum_of[:] = np.bincount(member, weights=values)[touched]
        return keys_of(touched // cols + top, touched % cols + left), sums

    def _new_numbers(self, count: int) -> Numbers:
        """Return numbers that no wall has, those of walls that are gone first."""
        short = count - len(self._free)
        if short > 0:
            # more than are needed now, so that the arrays seldom grow
            first, more = len(self.rows), short + len(self.rows) // _SPARE
            self._free = np.concatenate([self._free, np.arange(first, first + more, dtype=np.int32)])
            self.rows, self.cols = (np.concatenate([values, np.zeros(more)]) for values in (self.rows, self.cols))
            self._counts = np.concatenate([self._counts, np.zeros(more, np.int32)])
            self._directions = np.concatenate([self._directions, np.zeros((more, 2), np.float32)])
        numbers, self._free = self._free[:count], self._free[count:]
        return numbers

    def _within(self, box: Box) -> tuple[Whole, Whole, Numbers]:
        """Return row and column of the squares of a box that hold walls, and the numbers of these."""
        span = span_of_rows(self._keys, box)
        row, col = places_of(self._keys[span])
        inside = (col >= box.left) & (col < box.right)
        return row[inside] - box.top, col[inside] - box.left, self.numbers[span][inside]

    def _direct(self, box: Box) -> None:
        """Find which way each wall of some squares runs, from the spread of the walls around it."""
        around = box.padded(DIRECTION_SQUARES // 2)
        row, col, numbers = self._within(around)
        side = self.squares.cells * _FRACTIONS
        # fractions of a cell, in whole numbers: sums are exact wherever counting begins
        x = np.rint(self.cols[numbers] * _FRACTIONS) - math.floor(around.left * side)
        y = np.rint(self.rows[numbers] * _FRACTIONS) - math.floor(around.top * side)
        half = DIRECTION_SQUARES // 2
        chosen = (row >= half) & (row < around.shape[0] - half) & (col >= half) & (col < around.shape[1] - half)
        place = row * around.shape[1] + col
        first = _summed_around(place, np.stack([np.ones_like(x), x, y], axis=1), around)[chosen]
        second = _summed_around(place, np.stack([x * x, y * y, x * y], axis=1), around)[chosen]
        (count, sum_x, sum_y), (sum_xx, sum_yy, sum_xy), numbers = first.T, second.T, numbers[chosen]
        xx, yy, xy = count * sum_xx - sum_x**2, count * sum_yy - sum_y**2, count * sum_xy - sum_x * sum_y
        total = np.maximum(xx + yy, 1.0)
        self._directions[numbers] = np.stack([(xx - yy) / total, 2 * xy / total], axis=1).astype(np.float32)

    def _find_nearest(self, box: Box) -> None:
        """Find the wall that is nearest to each square of a box."""
        around = box.padded(self._reach)
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
        target[:] = number_of.take(labels[inner].astype(np.intp))
        target[distance[inner] > self.reach_squares] = NO_WALL


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


def _summed_around(place: Whole, values: NDArray[np.float64], box: Box) -> NDArray[np.float64]:
    """Return the sums of values, shape (N, 3), over the squares around each of their places, by index in a box."""
    # three at a time: one by one, or all six, takes more than twice as long
    image = np.zeros((*box.shape, 3))
    image.reshape(-1, 3)[place] = values
    size = (DIRECTION_SQUARES, DIRECTION_SQUARES)
    sums = cv2.boxFilter(image, cv2.CV_64F, size, normalize=False, borderType=cv2.BORDER_CONSTANT)
    return np.asarray(sums.reshape(-1, 3).take(place, axis=0), np.float64)


def _in_rows(cells: Places, first: int, last: int) -> Places:
    """Return the cells of some rows, the last excluded."""
    begin, end = np.searchsorted(cells[0], (first, last))
    return cells[0][begin:end], cells[1][begin:end]
