"""Translations between two maps, for a given rotation, from the correlation of coarse maps."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmerge.config import SearchConfig
from mapmerge.prepare import PreparedMap
from mapmerge.sim2 import Points, Sim2

Surface = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Peak:
    """A candidate: where the source would lie, and the value of the correlation there."""

    target_from_source: Sim2
    value: float


@dataclass(frozen=True, slots=True, eq=False)
class CorrelationSurface:
    """Score of every shift for one rotation, as found; evidence for the reader.

    Parameters
    ----------
    yaw_rad
        The rotation.
    values
        Shape (rows, columns): score in metres of wall; a row or column is one step of the shift in y or x.
    origin_m
        The shift of the first value.
    step_m
        Shift between two values.
    """

    yaw_rad: float
    values: Surface
    origin_m: tuple[float, float]
    step_m: float


class TranslationSearch:
    """Correlates one target map with turned sources: the target's transforms are computed once."""

    def __init__(self, target: PreparedMap, source: PreparedMap, config: SearchConfig) -> None:
        self._config = config
        self._source = source
        self._reach_m = float(np.hypot(*source.extent_m))
        sides_m = [side_m + self._reach_m for side_m in target.extent_m]
        self._cell_m = max(config.cell_m, target.resolution_m, max(sides_m) / config.max_side_cells)
        cols, rows = (int(np.ceil(side_m / self._cell_m)) + 4 for side_m in sides_m)
        self._shape = (cv2.getOptimalDFTSize(rows), cv2.getOptimalDFTSize(cols))
        walls = cv2.GaussianBlur(self._raster(target.walls_m), (3, 3), 0.0)
        free = self._raster(target.free_m).astype(bool).astype(np.float32)
        self._walls_spectrum = np.fft.rfft2(walls)
        self._cost_spectrum = np.fft.rfft2(walls - config.free_weight * free)

    def surface(self, yaw_rad: float) -> CorrelationSurface:
        """Return the score of every shift of the source turned by this angle.

        A wall on a wall counts 1 a metre, a wall of either map in the other's free space costs
        `SearchConfig.free_weight`.
        """
        turn = Sim2(yaw_rad=yaw_rad)
        walls_m, free_m = turn.apply(self._source.walls_m), turn.apply(self._source.free_m)
        low = np.vstack([walls_m, free_m]).min(axis=0, initial=self._reach_m)
        walls = self._raster(walls_m - low)
        free = self._raster(free_m - low).astype(bool).astype(np.float32)
        product = self._cost_spectrum * np.conj(np.fft.rfft2(walls))
        product -= self._config.free_weight * self._walls_spectrum * np.conj(np.fft.rfft2(free))
        values = np.fft.irfft2(product, self._shape).astype(np.float32)
        # shifts are cyclic: roll so that the most negative one comes first
        back = tuple(min(size - 1, int(np.ceil(self._reach_m / self._cell_m)) + 2) for size in self._shape)
        cell_m = self._cell_m
        origin_m = (-back[1] * cell_m - float(low[0]), -back[0] * cell_m - float(low[1]))
        scale = np.float32(self._source.wall_spacing_m)
        return CorrelationSurface(yaw_rad, np.roll(values, back, axis=(0, 1)) * scale, origin_m, cell_m)

    def _raster(self, points_m: Points) -> Surface:
        rows, cols = self._shape
        cell = np.floor(points_m / self._cell_m).astype(np.intp)
        index = np.clip(cell[:, 1], 0, rows - 1) * cols + np.clip(cell[:, 0], 0, cols - 1)
        return np.bincount(index, minlength=rows * cols).astype(np.float32).reshape(rows, cols)


def surface_peaks(surface: CorrelationSurface, config: SearchConfig) -> list[Peak]:
    """Return the best `SearchConfig.shifts` shifts that are local maxima, best first."""
    reach = max(1, round(config.peak_distance_m / surface.step_m))
    highest = cv2.dilate(surface.values, np.ones((2 * reach + 1, 2 * reach + 1), np.uint8))
    rows, cols = np.nonzero((surface.values >= highest) & (surface.values > 0))
    values = surface.values[rows, cols]
    order = np.argsort(-values, kind="stable")[: config.shifts]
    return [
        Peak(
            Sim2(
                surface.origin_m[0] + int(cols[i]) * surface.step_m,
                surface.origin_m[1] + int(rows[i]) * surface.step_m,
                surface.yaw_rad,
            ),
            float(values[i]),
        )
        for i in order
    ]
