"""Translations between two maps, for a given rotation, from the correlation of coarse maps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmerge.align import Poses
from mapmerge.config import SearchConfig
from mapmerge.prepared import PreparedMap
from mapmerge.sim2 import Points, Sim2

Surface = NDArray[np.float32]
Indices = NDArray[np.intp]

_FEW_TURNS = 16
"""So many turns of all points take less time than finding those on their hull."""

_EASY_SIZE = 8
_NOTHING_M = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class CorrelationSurface:
    """Score of every shift for one rotation.

    Parameters
    ----------
    turn
        The rotation, and the scale.
    values
        Shape (rows, columns): score in metres of wall; a row or column is one step of the shift in y or x.
    origin_m
        The shift of the first value, the lowest.
    step_m
        Shift between two values.
    """

    turn: Sim2
    values: Surface
    origin_m: tuple[float, float]
    step_m: float

    def shift_m(self, rows: Indices, cols: Indices) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the shifts in x and y of some values."""
        x_m, y_m = self.origin_m
        return cols.astype(np.float64) * self.step_m + x_m, rows.astype(np.float64) * self.step_m + y_m

    def index(self, target_from_source: Sim2) -> tuple[int, int]:
        """Return row and column of the shift that is nearest to that of a placement."""
        row = round((target_from_source.y_m - self.origin_m[1]) / self.step_m)
        return row, round((target_from_source.x_m - self.origin_m[0]) / self.step_m)


@dataclass(frozen=True, slots=True)
class CoarseCells:
    """How large the cells of the coarse maps are, see `SearchConfig.cell_m`.

    Parameters
    ----------
    cell_m, large_cell_m
        Side of a cell, and where there would be many of them.
    many_side_cells, max_side_cells
        So many a side are many, and the most.
    """

    cell_m: float
    large_cell_m: float
    many_side_cells: int
    max_side_cells: int

    @classmethod
    def of(cls, config: SearchConfig, cell_m: float) -> CoarseCells:
        """Return what the settings say, for cells of this side where there are not many."""
        return cls(cell_m, config.large_cell_m, config.many_side_cells, config.max_side_cells)

    def side_m(self, extent_m: float, least_m: float) -> float:
        """Return the side of the cells of a coarse map that is so large, of maps whose own cells are not smaller."""
        larger_m = min(self.large_cell_m, extent_m / self.many_side_cells)
        return max(self.cell_m, least_m, larger_m, extent_m / self.max_side_cells)


class TranslationSearch:
    """Correlates one target map with turned sources: the target's transforms are computed once.

    Parameters
    ----------
    target, source
        The maps.
    cells
        How large the cells of the coarse maps are.
    free_weights
        What a wall of either map in the other's free space costs, against 1 for a wall on a wall: there is a surface
        for each of these.
    turns
        Those that surfaces are asked for. The coarse maps have room for the source turned, and scaled, by each of them,
        and no more: what is transformed is often a third smaller than with room for any turn.
    """

    def __init__(
        self,
        target: PreparedMap,
        source: PreparedMap,
        cells: CoarseCells,
        free_weights: tuple[float, ...],
        turns: Sequence[Sim2],
    ) -> None:
        self._walls, self._columns_m = len(source.walls_m), _columns(source)
        self._wall_spacing_m = source.wall_spacing_m
        spans_m = _spans_m(self._columns_m, turns)
        sides_m = [side_m + span_m for side_m, span_m in zip(target.extent_m, spans_m, strict=True)]
        self._cell_m = cells.side_m(max(sides_m), target.resolution_m)
        cols, rows = (math.ceil(side_m / self._cell_m) + 4 for side_m in sides_m)
        self._shape = (_transformed_size(rows), _transformed_size(cols))
        # shifts are cyclic: no source meets the target further up than at its last cell, so that what lies beyond is
        # below the first one
        highest = [math.ceil(side_m / self._cell_m) + 1 for side_m in reversed(target.extent_m)]
        self._below = (self._shape[0] - highest[0], self._shape[1] - highest[1])
        walls, free = map(self._padded, self._rasters(_columns(target), len(target.walls_m)))
        walls_spectrum, free_spectrum = cv2.dft(cv2.GaussianBlur(walls, (3, 3), 0.0)), cv2.dft(free)
        # what the source's walls meet, and what its free space meets
        self._spectra = [
            (walls_spectrum - np.float32(weight) * free_spectrum, np.float32(-weight) * walls_spectrum)
            for weight in free_weights
        ]

    def surfaces(self, turn: Sim2) -> tuple[CorrelationSurface, ...]:
        """Return the scores of every shift of the source turned, and scaled, by ``turn``, for each free weight.

        They are followed by those of the source turned by another 180°, whose transforms are the same.
        """
        columns_m = turn.linear @ self._columns_m
        low_m = columns_m.min(axis=1, keepdims=True) if columns_m.size else np.zeros((2, 1))
        columns_m -= low_m
        length_m = np.float32(self._wall_spacing_m * turn.scale)
        rasters = self._rasters(columns_m, self._walls)
        walls, free = (np.asarray(cv2.dft(self._padded(raster * length_m)), np.float32) for raster in rasters)
        low_x_m, low_y_m = low_m.ravel().tolist()
        half = Sim2(0.0, 0.0, turn.yaw_rad + math.pi, turn.scale)
        cell_m, (below_y, below_x) = self._cell_m, self._below
        first_m = (-low_x_m - below_x * cell_m, -low_y_m - below_y * cell_m)
        ahead = [
            CorrelationSurface(
                turn,
                _rolled(_correlated(spectra, walls, free, True), *self._below),
                first_m,
                cell_m,
            )
            for spectra in self._spectra
        ]
        # turned by 180°, cell k becomes cell −k, whose far corner is the near one of before: none is below the first
        corner_m = (low_x_m + cell_m, low_y_m + cell_m)
        back = [
            CorrelationSurface(half, _correlated(spectra, walls, free, False), corner_m, cell_m)
            for spectra in self._spectra
        ]
        return (*ahead, *back)

    def _rasters(self, columns_m: Points, walls: int) -> tuple[Surface, Surface]:
        """Return the count of walls, and which cells are free and not beside a wall, where a cell tells nothing.

        They are as large as what is on them. Of the points, shape (2, N), so many are walls, and the others free.
        """
        col, row = (columns_m * (1.0 / self._cell_m)).astype(np.intp)
        rows, cols = int(row.max(initial=0)) + 1, int(col.max(initial=0)) + 1
        index = row * cols + col
        count = np.bincount(index[:walls], minlength=rows * cols).astype(np.float32).reshape(rows, cols)
        free = np.zeros(rows * cols, np.float32)
        free[index[walls:]] = 1.0
        return count, free.reshape(rows, cols) * (cv2.dilate(count, np.ones((3, 3), np.uint8)) == 0.0)

    def _padded(self, raster: Surface) -> Surface:
        padded = np.zeros(self._shape, np.float32)
        padded[: raster.shape[0], : raster.shape[1]] = raster
        return padded


def _transformed_size(cells: int) -> int:
    """Return a size that is transformed fast: products of small numbers, odd ones above all, may take twice as long."""
    return _EASY_SIZE * int(cv2.getOptimalDFTSize(math.ceil(cells / _EASY_SIZE)))


def _columns(prepared: PreparedMap) -> Points:
    """Return the points on walls, then those in free space, shape (2, N)."""
    return np.ascontiguousarray(np.concatenate([prepared.walls_m, prepared.free_m]).T)


def _hull(columns_m: Points) -> Points:
    return cv2.convexHull(columns_m.T.astype(np.float32)).reshape(-1, 2).T.astype(np.float64)


def _spans_m(columns_m: Points, turns: Sequence[Sim2]) -> tuple[float, float]:
    """Return the largest width and height of some points, shape (2, N), at any of the turns."""
    if columns_m.size == 0:
        return 0.0, 0.0
    points_m = columns_m if len(turns) <= _FEW_TURNS else _hull(columns_m)
    spans_m = np.array([np.ptp(turn.linear @ points_m, axis=1) for turn in turns]).reshape(-1, 2)
    width_m, height_m = spans_m.max(axis=0, initial=0.0).tolist()
    return width_m, height_m


def surface_peaks(surface: CorrelationSurface, peak_distance_m: float) -> tuple[Poses, NDArray[np.float32]]:
    """Return the shifts that are local maxima, and their values, best first.

    Parameters
    ----------
    surface
        Scores of one rotation.
    peak_distance_m
        Least distance of two peaks.
    """
    reach = max(1, round(peak_distance_m / surface.step_m))
    highest = cv2.dilate(surface.values, np.ones((2 * reach + 1, 2 * reach + 1), np.uint8))
    # where maps do not meet, there is nothing but rounding
    np.maximum(highest, np.float32(_NOTHING_M), out=highest)
    # flat: of two dimensions it takes ten times as long to find a few among many
    found = np.flatnonzero(surface.values >= highest)
    values = surface.values.ravel()[found]
    order = np.argsort(-values, kind="stable")
    rows, cols = np.divmod(found[order], surface.values.shape[1])
    poses = np.empty((len(rows), 4))
    poses[:, 0], poses[:, 1] = surface.shift_m(rows, cols)
    poses[:, 2:] = surface.turn.yaw_rad, surface.turn.scale
    return poses, values[order]


def _rolled(values: Surface, rows: int, cols: int) -> Surface:
    """Return `numpy.roll` by so many rows and columns, without its overhead, which is most of it for small surfaces."""
    below, right = values.shape[0] - rows, values.shape[1] - cols
    rolled = np.empty_like(values)
    rolled[:rows, :cols], rolled[:rows, cols:] = values[below:, right:], values[below:, :right]
    rolled[rows:, :cols], rolled[rows:, cols:] = values[:below, right:], values[:below, :right]
    return rolled


def _correlated(target: tuple[Surface, Surface], walls: Surface, free: Surface, conjugate: bool) -> Surface:
    product = cv2.mulSpectrums(target[0], walls, 0, conjB=conjugate)
    product = product + cv2.mulSpectrums(target[1], free, 0, conjB=conjugate)
    return np.asarray(cv2.idft(product, flags=cv2.DFT_REAL_OUTPUT | cv2.DFT_SCALE), np.float32)
