"""Translations between two maps, for a given rotation, from the correlation of coarse maps."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmerge.align import Poses
from mapmerge.prepare import PreparedMap
from mapmerge.sim2 import Points, Sim2

Surface = NDArray[np.float32]
Indices = NDArray[np.intp]


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


class TranslationSearch:
    """Correlates one target map with turned sources: the target's transforms are computed once.

    Parameters
    ----------
    target, source
        The maps.
    cell_m
        Side of the cells of the coarse maps; larger where the target has larger cells, or would need more than
        ``max_side_cells`` of them.
    max_side_cells
        Most cells a side.
    free_weights
        What a wall of either map in the other's free space costs, against 1 for a wall on a wall: there is a surface
        for each of these.
    largest_scale
        Largest scale of the source that is asked for.
    """

    def __init__(
        self,
        target: PreparedMap,
        source: PreparedMap,
        cell_m: float,
        max_side_cells: int,
        free_weights: tuple[float, ...],
        largest_scale: float = 1.0,
    ) -> None:
        self._walls_m, self._free_m = source.walls_m, source.free_m
        self._wall_spacing_m = source.wall_spacing_m
        self._reach_m = largest_scale * float(np.hypot(*source.extent_m))
        sides_m = [side_m + self._reach_m for side_m in target.extent_m]
        self._cell_m = max(cell_m, target.resolution_m, max(sides_m) / max_side_cells)
        cols, rows = (math.ceil(side_m / self._cell_m) + 4 for side_m in sides_m)
        self._shape = (cv2.getOptimalDFTSize(rows), cv2.getOptimalDFTSize(cols))
        # shifts are cyclic: no source meets the target further up than at its last cell, so that what lies beyond is
        # below the first one
        highest = [math.ceil(side_m / self._cell_m) + 1 for side_m in reversed(target.extent_m)]
        self._below = (self._shape[0] - highest[0], self._shape[1] - highest[1])
        walls, free = self._rasters(target.walls_m, target.free_m)
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
        walls_m, free_m = turn.apply(self._walls_m), turn.apply(self._free_m)
        low = np.vstack([walls_m, free_m]).min(axis=0, initial=self._reach_m)
        rasters = self._rasters(walls_m - low, free_m - low)
        length_m = np.float32(self._wall_spacing_m * turn.scale)
        walls, free = (np.asarray(cv2.dft(raster * length_m), np.float32) for raster in rasters)
        low_x_m, low_y_m = low.tolist()
        half = Sim2(0.0, 0.0, turn.yaw_rad + math.pi, turn.scale)
        cell_m, (below_y, below_x) = self._cell_m, self._below
        first_m = (-low_x_m - below_x * cell_m, -low_y_m - below_y * cell_m)
        ahead = [
            CorrelationSurface(
                turn,
                np.roll(_correlated(spectra, walls, free, True), self._below, axis=(0, 1)),
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

    def _rasters(self, walls_m: Points, free_m: Points) -> tuple[Surface, Surface]:
        """Return the count of walls, and which cells are free and not beside a wall, where a cell tells nothing."""
        walls = self._raster(walls_m)
        free = np.minimum(self._raster(free_m), np.float32(1.0))
        free[cv2.dilate(walls, np.ones((3, 3), np.uint8)) > 0] = 0.0
        return walls, free

    def _raster(self, points_m: Points) -> Surface:
        rows, cols = self._shape
        cell = (points_m * (1.0 / self._cell_m)).astype(np.intp)
        index = np.clip(cell[:, 1], 0, rows - 1) * cols + np.clip(cell[:, 0], 0, cols - 1)
        return np.bincount(index, minlength=rows * cols).astype(np.float32).reshape(rows, cols)


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
    # flat: of two dimensions it takes ten times as long to find a few among many
    found = np.flatnonzero((surface.values >= highest) & (surface.values > 0))
    values = surface.values.ravel()[found]
    order = np.argsort(-values, kind="stable")
    rows, cols = np.divmod(found[order], surface.values.shape[1])
    poses = np.empty((len(rows), 4))
    poses[:, 0], poses[:, 1] = surface.shift_m(rows, cols)
    poses[:, 2:] = surface.turn.yaw_rad, surface.turn.scale
    return poses, values[order]


def _correlated(target: tuple[Surface, Surface], walls: Surface, free: Surface, conjugate: bool) -> Surface:
    product = cv2.mulSpectrums(target[0], walls, 0, conjB=conjugate)
    product = product + cv2.mulSpectrums(target[1], free, 0, conjB=conjugate)
    return np.asarray(cv2.idft(product, flags=cv2.DFT_REAL_OUTPUT | cv2.DFT_SCALE), np.float32)
