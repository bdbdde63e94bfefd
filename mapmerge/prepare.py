"""Maps made ready to be matched, and kept ready while they grow: only what changed is computed again.

Walls are thinned and free space is sampled by squares, counted from the corner of what was known at first. With that
corner, what is kept up to date equals, to the bit, what is computed anew: a map prepared at once is one that changed
all over.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmerge.config import MergeConfig
from mapmerge.grid import Grid, Mask, cell_centres_m
from mapmerge.lattice import changed_box, offset_cells
from mapmerge.plane import Box, Plane
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
from mapmerge.walls import NO_WALL, LiveWalls

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
        self._first = self._first[0] + rows, self._first[1] + cols
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
        self._free_rows, self._free_cols = np.empty(0, np.int32), np.empty(0, np.int32)
        self._known = 0

    def _take(self, known: Grid, changed: Box) -> None:
        """Renew what depends on the changed cells, which are counted on the lattice."""
        self._grid = known
        covered = Box(0, 0, *known.cells.shape).shifted(*self._first)
        self._known -= int(np.count_nonzero(self._classes.read(changed.within(self._classes.box))))
        padded = Box(*np.add(covered, (-self._margin, -self._margin, self._margin, self._margin)).tolist())
        for plane in (self._classes, self._meets):
            plane.cover(padded)
        self._classes.part(changed.within(padded))[:] = CELL_UNKNOWN
        for band in changed.within(covered).bands(_BAND_CELLS):
            cells = np.ascontiguousarray(known.cells[band.slices(covered)])
            classes = self._classes_of[cells.view(np.uint8)]
            self._classes.part(band)[:] = classes
            self._known += int(np.count_nonzero(classes))
        for band in changed.padded(self._reach_of_meets).within(padded).bands(_BAND_CELLS):
            self._meet(band)
        self._sample_free(covered, changed)
        self._walls.update(self._occupied, covered, changed)

    def _occupied(self, box: Box) -> Mask:
        return np.asarray(self._classes.part(box) == CELL_OCCUPIED, np.bool_)

    @property
    def _tolerance_m(self) -> float:
        return max(self._config.verify.tolerance_m, self._resolution_m)

    @property
    def _reach_of_meets(self) -> int:
        """How many cells around a wall what a point meets may depend on it."""
        return math.ceil(max(self._config.verify.near_m, self._tolerance_m) / self._resolution_m) + 2

    def _meet(self, box: Box) -> None:
        """Find what a point in each cell of a box meets."""
        around = box.padded(self._reach_of_meets)
        classes = self._classes.read(around)
        inner = box.slices(around)
        distance_m = _distance_to_walls_m(classes == CELL_OCCUPIED, self._resolution_m)[inner]
        free = classes[inner] == CELL_FREE
        self._meets.part(box)[:] = (
            free.view(np.uint8) * np.uint8(MEETS_FREE)
            + (distance_m <= self._tolerance_m).view(np.uint8) * np.uint8(MEETS_WALL)
            + (distance_m <= self._config.verify.near_m).view(np.uint8) * np.uint8(MEETS_NEAR)
        )

    def _sample_free(self, covered: Box, changed: Box) -> None:
        """Collect every so many cells, along both axes, that is free, in the rows of a box."""
        step = self._free_step
        rows = Box(changed.top, covered.left, changed.bottom, covered.right).within(covered)
        first = step // 2 - self._margin
        down, across = (first - rows.top) % step, (first - rows.left) % step
        row, col = np.nonzero(self._classes.part(rows)[down::step, across::step] == CELL_FREE)
        begin, end = np.searchsorted(self._free_rows, (changed.top, changed.bottom))
        parts = (self._free_rows, row * step + rows.top + down), (self._free_cols, col * step + rows.left + across)
        self._free_rows, self._free_cols = (
            np.concatenate([old[:begin], new.astype(np.int32), old[end:]]) for old, new in parts
        )

    def _published(self, known: Grid) -> PreparedMap:
        walls, cell_m = self._walls, self._resolution_m
        row, col = self._first
        x_m, y_m = ((values + (0.5 - first)) * cell_m for values, first in ((walls.cols, col), (walls.rows, row)))
        x_m[NO_WALL], y_m[NO_WALL] = _FAR_M, _FAR_M
        corner_m = (
            (walls.nearest.box.left * walls.squares.cells - col) * cell_m,
            (walls.nearest.box.top * walls.squares.cells - row) * cell_m,
        )
        index = walls.nearest.cells
        nearest = NearestWalls(
            index if index.size else np.full((1, 1), NO_WALL, np.int32),
            x_m.astype(np.float32),
            y_m.astype(np.float32),
            walls.directions,
            self._spacing_m,
            corner_m,
        )
        return PreparedMap(
            grid=known,
            known_area_m2=self._known * cell_m**2,
            classes=self._classes.cells,
            meets=self._meets.cells,
            nearest=nearest,
            # the arrays themselves if possible, as they are never written to
            wall_cells=(
                walls.cell_rows - np.int32(row) if row else walls.cell_rows,
                walls.cell_cols - np.int32(col) if col else walls.cell_cols,
            ),
            walls_m=np.stack([x_m[walls.numbers], y_m[walls.numbers]], axis=1),
            numbers=walls.numbers,
            free_m=cell_centres_m(self._free_rows - np.int32(row), self._free_cols - np.int32(col), cell_m),
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


def _distance_to_walls_m(occupied: Mask, resolution_m: float) -> NDArray[np.float32]:
    if not occupied.any():
        return np.full(occupied.shape, np.float32(np.inf), np.float32)
    free = np.where(occupied, np.uint8(0), np.uint8(255))
    distance = cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_5)
    return np.asarray(distance, np.float32) * np.float32(resolution_m)
