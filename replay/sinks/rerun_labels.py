"""Where the names of placed maps stand: each on ground that only its robot knows, away from the other names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmerge.grid import Grid
from mapmerge.sim2 import Points, Sim2

PointM = tuple[float, float]

_SIDE_CELLS = 32
_SURE = 0.9
_FROM_LABELS = 0.5
_RASTER_CELLS = 96
_MOST_PLACES = 128
_LEAST_CELL_M = 1e-6
_SAMPLES = 8
"""Cells across a square of which it is told whether it is known, where a map has as many."""


def known_places_m(grid: Grid) -> Points:
    """Return a few hundred places of what a map knows, in its map frame, shape (N, 2).

    They are the middles of squares that it knows altogether or, where it knows none so, of those that it knows best.
    """
    if grid.cells.size == 0:
        return np.empty((0, 2))
    # a sample of a large map does: this is done for each that comes
    stride = max(1, max(grid.cells.shape) // (_SIDE_CELLS * _SAMPLES))
    known = (grid.cells[::stride, ::stride] >= 0).astype(np.float32)
    step = max(grid.cells.shape) / _SIDE_CELLS
    size = max(1, round(grid.cols / step)), max(1, round(grid.rows / step))
    share = cv2.resize(known, size, interpolation=cv2.INTER_AREA)
    rows, cols = np.nonzero(share >= min(_SURE, float(share.max())))
    across = np.array([grid.cols / size[0], grid.rows / size[1]]) * grid.resolution_m
    return grid.map_from_grid.apply((np.stack([cols, rows], axis=1) + 0.5) * across)


def label_places_m(poses: Mapping[str, Sim2], places_m: Mapping[str, Points]) -> dict[str, PointM]:
    """Return where the name of each placed map stands in the merged frame.

    Parameters
    ----------
    poses
        Where the maps are placed: ``merged_from_map``.
    places_m
        What each of them knows, see `known_places_m`; not empty.
    """
    merged_m = [pose.apply(places_m[robot]) for robot, pose in poses.items()]
    if not merged_m:
        return {}
    raster = _Raster.around(merged_m)
    found: list[PointM] = []
    for index, own_m in enumerate(merged_m):
        candidates_m = own_m[:: -(-len(own_m) // _MOST_PLACES)]
        if len(merged_m) == 1:
            worth = -_nearest_m(candidates_m, [tuple(own_m.mean(axis=0))])
        else:
            worth = raster.from_others_m(index, candidates_m)
        if found:
            worth = worth + _FROM_LABELS * _nearest_m(candidates_m, found)
        x_m, y_m = candidates_m[int(np.argmax(worth))]
        found.append((float(x_m), float(y_m)))
    return dict(zip(poses, found, strict=True))


@dataclass(frozen=True, slots=True)
class _Raster:
    """What all maps know, on one coarse raster: what it costs to look up does not grow with the number of maps.

    Parameters
    ----------
    low_m
        Its corner of least x and y.
    cell_m
        Side of its cells.
    counts
        How many places are in each cell.
    cells
        Of each map, the cells that its places are in, as indices of ``counts.ravel()``.
    """

    low_m: Points
    cell_m: float
    counts: NDArray[np.int64]
    cells: Sequence[NDArray[np.int64]]

    @classmethod
    def around(cls, places_m: Sequence[Points]) -> _Raster:
        """Lay it over the places of all maps."""
        low_m = np.min([each.min(axis=0) for each in places_m], axis=0)
        high_m = np.max([each.max(axis=0) for each in places_m], axis=0)
        cell_m = max(float((high_m - low_m).max()) / (_RASTER_CELLS - 1), _LEAST_CELL_M)
        cols, rows = (np.floor((high_m - low_m) / cell_m).astype(int) + 1).tolist()
        cells = []
        for each in places_m:
            col, row = np.floor((each - low_m) / cell_m).astype(np.int64).T
            cells.append(row * cols + col)
        counts = np.bincount(np.concatenate(cells), minlength=rows * cols).reshape(rows, cols)
        return cls(low_m, cell_m, counts, cells)

    def from_others_m(self, index: int, points_m: Points) -> Points:
        """Return how far some places of a map are from the nearest place of another one, to a cell of the raster."""
        own = np.bincount(self.cells[index], minlength=self.counts.size).reshape(self.counts.shape)
        is_only_own = (self.counts == own).astype(np.uint8)
        distances = cv2.distanceTransform(is_only_own, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
        col, row = np.floor((points_m - self.low_m) / self.cell_m).astype(np.int64).T
        return np.asarray(distances[row, col] * self.cell_m, np.float64)


def _nearest_m(points_m: Points, others_m: Sequence[PointM]) -> Points:
    """Return how far each point is from the nearest of a few others."""
    apart_m = np.array(others_m)[:, None, :] - points_m
    return np.asarray(np.hypot(apart_m[..., 0], apart_m[..., 1]).min(axis=0))
