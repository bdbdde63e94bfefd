"""The alignment of two maps by trying all: slow and thorough, for maps whose truth nobody published.

Every rotation in steps of 1.5° and every shift by FFT correlation of walls and free space in cells of 0.2 m; the best
are aligned finely against the distances to the other map's walls; the one that most wall supports is returned. Whether
it is the truth was looked at once, by eye, for each pair that uses it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmerge.config import MergeConfig, VerifyConfig
from mapmerge.grid import Grid
from mapmerge.prepare import prepare
from mapmerge.prepared import CELL_OCCUPIED, PreparedMap
from mapmerge.sim2 import Points, Sim2
from mapmerge.verify import rank_score_m

_CELL_M = 0.2
_STEP_DEG = 1.5
_FREE_COST = 0.25
_FINALISTS = 40
# its own weights, so that no tuning of a method moves the truth
_RANKED_BY = VerifyConfig(violation_weight=2.0, free_weight=0.5)
_PEAKS_A_ROTATION = 3
_STEPS = ((0.1, 0.75, 0.3), (0.05, 0.4, 0.2), (0.02, 0.1, 0.1), (0.005, 0.02, 0.06))

Image = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class _Candidate:
    score: float
    target_from_source: Sim2


def exhaustive(target: Grid, source: Grid) -> Sim2:
    """Return target_from_source between the two map frames."""
    config = MergeConfig()
    resolution_m = max(target.resolution_m, source.resolution_m)
    maps = prepare(target, resolution_m, config), prepare(source, resolution_m, config)
    finalists = sorted(_coarse(*maps), key=lambda candidate: -candidate.score)[:_FINALISTS]
    fields = _Field(maps[0]), _Field(maps[1])
    aligned = [aligned_finely(*fields, candidate.target_from_source) for candidate in finalists]
    best = max(aligned, key=lambda placement: rank_score_m(*maps, placement, _RANKED_BY))
    return maps[0].grid.map_from_grid @ best @ maps[1].grid.map_from_grid.inverse()


def _coarse(target: PreparedMap, source: PreparedMap) -> list[_Candidate]:
    """Return the best shifts for every rotation, between the frames of the two cropped grids."""
    diagonal_m = math.hypot(*source.extent_m)
    width_m, height_m = target.extent_m
    cols, rows = (math.ceil((size_m + 2.0 * diagonal_m) / _CELL_M) for size_m in (width_m, height_m))
    corner = Sim2(-diagonal_m, -diagonal_m)
    walls, free = (np.fft.rfft2(_drawn(points, corner, rows, cols)) for points in (target.walls_m, target.free_m))
    middle = Sim2(-0.5 * source.extent_m[0], -0.5 * source.extent_m[1])
    found: list[_Candidate] = []
    for degrees in np.arange(0.0, 360.0, _STEP_DEG).tolist():
        turn = Sim2(yaw_rad=math.radians(degrees)) @ middle
        at_corner = Sim2(0.5 * diagonal_m, 0.5 * diagonal_m)
        images = [_drawn((at_corner @ turn).apply(points), Sim2(), rows, cols) for points in _parts(source)]
        source_walls, source_free = (np.conj(np.fft.rfft2(image)) for image in images)
        spectrum = walls * source_walls - _FREE_COST * (free * source_walls + walls * source_free)
        surface = np.fft.irfft2(spectrum, (rows, cols))
        for score, row, col in _peaks(surface):
            shift = corner @ Sim2(col * _CELL_M, row * _CELL_M) @ at_corner @ turn
            found.append(_Candidate(score, shift))
    return found


def _parts(source: PreparedMap) -> tuple[Points, Points]:
    return source.walls_m, source.free_m


def _drawn(points_m: Points, corner: Sim2, rows: int, cols: int) -> Image:
    """Return an image, one where there are points; the corner is that of cell (0, 0)."""
    cells = np.floor(corner.inverse().apply(points_m) / _CELL_M).astype(np.intp)
    image = np.zeros((rows, cols))
    image[np.clip(cells[:, 1], 0, rows - 1), np.clip(cells[:, 0], 0, cols - 1)] = 1.0
    return image


def _peaks(surface: Image) -> list[tuple[float, int, int]]:
    """Return the highest values of a surface, none within a metre of a higher one."""
    found: list[tuple[float, int, int]] = []
    left = surface.copy()
    rows, cols = left.shape
    reach = round(1.0 / _CELL_M)
    for _ in range(_PEAKS_A_ROTATION):
        row, col = divmod(int(left.argmax()), cols)
        found.append((float(left[row, col]), row, col))
        left[max(row - reach, 0) : min(row + reach, rows), max(col - reach, 0) : min(col + reach, cols)] = -np.inf
    return found


class _Field:
    """A map and how far each of its cells is from the nearest wall."""

    def __init__(self, prepared: PreparedMap) -> None:
        self.map = prepared
        is_free = np.where(prepared.classes == CELL_OCCUPIED, np.uint8(0), np.uint8(255))
        self._distance_m = cv2.distanceTransform(is_free, cv2.DIST_L2, cv2.DIST_MASK_5) * prepared.resolution_m

    def near(self, walls_m: Points, width_m: float) -> float:
        """Return how many walls are near walls; the nearer, the more one counts."""
        away = self._distance_m.ravel()[self.map.flat_index(walls_m)].astype(np.float64) / width_m
        return float(np.sum(np.exp(-0.5 * away**2)))


def aligned_finely(target: _Field, source: _Field, start: Sim2) -> Sim2:
    """Return a placement nearby at which most walls lie on walls, by steps that get smaller."""
    best = start
    width_m, height_m = source.map.extent_m
    middle_m = start.apply_point(0.5 * width_m, 0.5 * height_m)
    around, back = Sim2(*middle_m), Sim2(-middle_m[0], -middle_m[1])
    for step_m, step_deg, blur_m in _STEPS:
        score = _closeness(target, source, best, blur_m)
        improved = True
        while improved:
            improved = False
            for dx, dy, turn in ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)):
                move = around @ Sim2(dx * step_m, dy * step_m, math.radians(turn * step_deg)) @ back
                moved = move @ best
                moved_score = _closeness(target, source, moved, blur_m)
                if moved_score > score + 1e-9:
                    best, score, improved = moved, moved_score, True
    return best


def _closeness(target: _Field, source: _Field, placement: Sim2, width_m: float) -> float:
    """Return how much wall lies near wall, in both directions; the nearer, the more it counts."""
    near = target.near(placement.apply(source.map.walls_m), width_m)
    return near + source.near(placement.inverse().apply(target.map.walls_m), width_m)
