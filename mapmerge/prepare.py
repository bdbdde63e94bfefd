"""Maps made ready to be matched, and kept ready while they grow: only what changed is computed again.

Walls are thinned and free space is sampled by squares, counted from the corner of what was known at first. With that
corner, what is kept up to date equals, to the bit, what is computed anew: a map prepared at once is one that changed
all over.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmerge.config import MergeConfig
from mapmerge.discs import Disc
from mapmerge.grid import Grid, Mask, cell_centres_m
from mapmerge.keys import Keys, Places, exchanged, keys_of, places_of
from mapmerge.lattice import changed_box, offset_cells
from mapmerge.plane import NOTHING, Box, Plane
from mapmerge.prepared import (
    CELL_FREE,
    CELL_OCCUPIED,
    CELL_UNKNOWN,
    CELL_UNSURE,
    MEETS_FREE,
    MEETS_NEAR,
    MEETS_WALL,
    NearestWalls,
    PreparedMap,
)
from mapmerge.resample import at_resolution
from mapmerge.sim2 import Points
from mapmerge.walls import NO_WALL, LiveWalls

Classes = NDArray[np.uint8]

FREE_SPACING_M = 0.25
_MARGIN_M = 1.0
_MARGIN_SLACK_M = 0.1
_FAR_M = 1e6
_BAND_CELLS = 512
_ROUNDING = 1e-9


def prepare(grid: Grid, resolution_m: float, config: MergeConfig) -> PreparedMap:
    """Prepare a map for matching at a resolution that is not finer than its own."""
    return LiveMap(resolution_m, config).update(grid)


class LiveMap:
    """One robot's map, kept ready to be matched.

    Parameters
    ----------
    resolution_m
        At which it is matched; not finer than its own.
    config
        Settings.
    """

    def __init__(self, resolution_m: float, config: MergeConfig) -> None:
        self._resolution_m = resolution_m
        self._config = config
        reach_m = max(_MARGIN_M, *config.refine.rough_reject_m, *config.refine.reject_m) + _MARGIN_SLACK_M
        self._margin = math.ceil(max(reach_m, config.verify.near_m, config.verify.tolerance_m) / resolution_m) + 1
        self._spacing_m = max(config.search.wall_spacing_m, resolution_m)
        self._reach_squares = reach_m / self._spacing_m
        self._free_step = max(1, round(FREE_SPACING_M / resolution_m))
        self._classes_of = _class_table(config)
        limits_m = (MEETS_WALL, max(config.verify.tolerance_m, resolution_m)), (MEETS_NEAR, config.verify.near_m)
        self._discs = tuple((bit, Disc.of(limit_m, resolution_m)) for bit, limit_m in limits_m)
        self._grid: Grid | None = None
        self._first = (0, 0)
        self._forget()

    def update(self, grid: Grid) -> PreparedMap:
        """Take in the map as it is now, and return it; what was returned before must not be used any more."""
        known = at_resolution(grid.cropped_to_known(), self._resolution_m, self._config.cells)
        changed = None if self._grid is None else changed_box(self._grid, known)
        if self._grid is None or changed is None:
            return self._anew(known)
        rows, cols = offset_cells(self._grid, known) or (0, 0)
        if rows or cols:
            self._first = self._first[0] + rows, self._first[1] + cols
            # in metres from another corner
            self._x_m = self._y_m = np.empty(0, np.float32)
        self._take(known, changed.shifted(*self._first))
        return self._published(known)

    def renewed(self) -> PreparedMap | None:
        """Return the last map as if it were the first, computed anew; None if that is what it is already.

        So the outcome of a search depends on the maps alone, and not on how they came about.
        """
        if self._grid is None or all(
            first % self._free_step == 0 and self._starts_square(first) for first in self._first
        ):
            return None
        return self._anew(self._grid)

    def _starts_square(self, cell: int) -> bool:
        squares = cell / self._walls.squares.cells
        return abs(squares - round(squares)) < _ROUNDING

    def _anew(self, known: Grid) -> PreparedMap:
        self._forget()
        self._take(known, Box(0, 0, *known.cells.shape))
        return self._published(known)

    def _forget(self) -> None:
        self._first = (0, 0)
        self._classes, self._meets = Plane(np.uint8), Plane(np.uint8)
        self._walls = LiveWalls(self._spacing_m / self._resolution_m, self._reach_squares)
        self._free: Keys = np.empty(0, np.int64)
        self._places_m: Points = np.empty((0, 2))
        self._x_m, self._y_m = np.empty((2, 0), np.float32)
        self._known = 0

    def _take(self, known: Grid, changed: Box) -> None:
        """Renew what depends on the changed cells, which are counted on the lattice."""
        self._grid = known
        covered = Box(0, 0, *known.cells.shape).shifted(*self._first)
        padded = Box(*np.add(covered, (-self._margin, -self._margin, self._margin, self._margin)).tolist())
        walls = self._classify(covered, padded, changed)
        self._meets.cover(padded)
        for band in changed.within(padded).bands(_BAND_CELLS):
            self._meet_free(band)
        for band in walls.box.padded(self._reach_of_meets).within(padded).bands(_BAND_CELLS):
            self._meet_walls(band)
        self._place(self._walls.update(covered, walls.came, walls.went))

    def _place(self, numbers: NDArray[np.int32]) -> None:
        """Find where the walls of these numbers are in metres; where all are, if that is not known of them."""
        walls, cell_m = self._walls, self._resolution_m
        if len(self._x_m) != len(walls.rows):
            numbers = np.arange(len(walls.rows), dtype=np.int32)
            self._places_m = np.empty((len(numbers), 2))
            self._x_m, self._y_m = np.empty((2, len(numbers)), np.float32)
        x_m = (walls.cols[numbers] + (0.5 - self._first[1])) * cell_m
        y_m = (walls.rows[numbers] + (0.5 - self._first[0])) * cell_m
        self._places_m[numbers, 0], self._places_m[numbers, 1] = x_m, y_m
        self._x_m[numbers], self._y_m[numbers] = x_m, y_m
        self._x_m[NO_WALL] = self._y_m[NO_WALL] = _FAR_M

    def _classify(self, covered: Box, padded: Box, changed: Box) -> _Differing:
        """Sort the changed cells into classes; return which became occupied, and which are so no more."""
        # its array stays as it is if other cells are covered now
        before = copy(self._classes)
        self._classes.cover(padded)
        walls, free = [], []
        for band in changed.bands(_BAND_CELLS):
            was, now = before.read(band), self._classes_in(covered, band)
            self._known += cv2.countNonZero(now) - cv2.countNonZero(was)
            walls.append(_Differing.of(was == CELL_OCCUPIED, now == CELL_OCCUPIED, (band.top, band.left)))
            free.append(self._sampled(was, now, band))
            inside = band.within(padded)
            self._classes.part(inside)[:] = now[inside.slices(band)]
        self._renew_free(_Differing.joined(free))
        return _Differing.joined(walls)

    def _classes_in(self, covered: Box, box: Box) -> Classes:
        """Return the classes of the cells of a box."""
        inside = box.within(covered)
        classes = np.full(box.shape, CELL_UNKNOWN, np.uint8)
        if self._grid is not None and not inside.is_empty:
            cells = self._grid.cells[inside.slices(covered)].view(np.uint8)
            classes[inside.slices(box)] = cv2.LUT(cells, self._classes_of)
        return classes

    @property
    def _reach_of_meets(self) -> int:
        """How many cells around a wall what a point meets may depend on it."""
        return max(disc.radius for _, disc in self._discs)

    def _meet_free(self, box: Box) -> None:
        """Find in which cells of a box a point meets free space."""
        met = self._meets.part(box)
        met &= np.uint8(MEETS_WALL | MEETS_NEAR)
        met |= (self._classes.part(box) == CELL_FREE).view(np.uint8) * np.uint8(MEETS_FREE)

    def _meet_walls(self, box: Box) -> None:
        """Find in which cells of a box a point meets walls, or is near to them."""
        around = box.padded(self._reach_of_meets)
        walls = (self._classes.read(around) == CELL_OCCUPIED).view(np.uint8)
        met = self._meets.part(box)
        met &= np.uint8(MEETS_FREE)
        for bit, disc in self._discs:
            met |= disc.spread(walls * np.uint8(bit))[box.slices(around)]

    def _sampled(self, was: Classes, now: Classes, box: Box) -> _Differing:
        """Return where every so many cells, along both axes, free space came or went."""
        step = self._free_step
        first = step // 2 - self._margin
        down, across = (first - box.top) % step, (first - box.left) % step
        was, now = was[down::step, across::step], now[down::step, across::step]
        corner = box.top + down, box.left + across
        return _Differing.of(was == CELL_FREE, now == CELL_FREE, corner, step)

    def _renew_free(self, differing: _Differing) -> None:
        """Take in where sampled free space came or went."""
        went, came = keys_of(*differing.went), keys_of(*differing.came)
        gone, before = np.searchsorted(self._free, went), np.searchsorted(self._free, came)
        self._free = exchanged(self._free, gone, before, came)

    def _published(self, known: Grid) -> PreparedMap:
        walls, cell_m = self._walls, self._resolution_m
        row, col = self._first
        free_rows, free_cols = places_of(self._free)
        corner_m = (
            (walls.nearest.box.left * walls.squares.cells - col) * cell_m,
            (walls.nearest.box.top * walls.squares.cells - row) * cell_m,
        )
        index = walls.nearest.cells
        nearest = NearestWalls(
            index if index.size else np.full((1, 1), NO_WALL, np.int32),
            self._x_m,
            self._y_m,
            lambda: walls.directions,
            self._spacing_m,
            corner_m,
        )
        return PreparedMap(
            grid=known,
            known_area_m2=self._known * cell_m**2,
            classes=self._classes.cells,
            meets=self._meets.cells,
            nearest=nearest,
            walls_m=self._places_m.take(walls.numbers.astype(np.intp), axis=0),
            numbers=walls.numbers,
            free_m=cell_centres_m(free_rows - row, free_cols - col, cell_m),
            wall_spacing_m=self._spacing_m,
            free_spacing_m=self._free_step * cell_m,
            margin=self._margin,
        )


def _class_table(config: MergeConfig) -> NDArray[np.uint8]:
    """Return the class of each value of a cell, by its byte."""
    value = np.arange(256, dtype=np.uint8).view(np.int8)
    known = np.where(value <= config.cells.max_free_percent, CELL_FREE, CELL_UNSURE)
    occupied = np.where(value >= config.cells.min_occupied_percent, CELL_OCCUPIED, known)
    return np.where(value < 0, CELL_UNKNOWN, occupied).astype(np.uint8)


@dataclass(frozen=True, slots=True, eq=False)
class _Differing:
    """Which cells came, and which went."""

    came: Places
    went: Places

    @staticmethod
    def of(was: Mask, now: Mask, corner: tuple[int, int], step: int = 1) -> _Differing:
        """Return where two masks differ, of every so many cells along both axes, the first of which is the corner."""
        index = np.flatnonzero(was != now)
        came = now.ravel()[index]
        row = index // max(1, now.shape[1])
        col = index - row * now.shape[1]
        rows, cols = (
            (values * step + first).astype(np.int32) for values, first in zip((row, col), corner, strict=True)
        )
        return _Differing((rows[came], cols[came]), (rows[~came], cols[~came]))

    @staticmethod
    def joined(parts: Sequence[_Differing]) -> _Differing:
        """Return the cells of several bands, one below the other."""
        return _Differing(_joined([part.came for part in parts]), _joined([part.went for part in parts]))

    @property
    def box(self) -> Box:
        """The smallest box that holds all of these cells."""
        return _box_of(self.came).union(_box_of(self.went))


def _joined(places: Sequence[Places]) -> Places:
    nothing = np.empty(0, np.int32)
    return np.concatenate([nothing, *(rows for rows, _ in places)]), np.concatenate([nothing, *(c for _, c in places)])


def _box_of(places: Places) -> Box:
    rows, cols = places
    return Box(int(rows[0]), int(cols.min()), int(rows[-1]) + 1, int(cols.max()) + 1) if len(rows) else NOTHING
