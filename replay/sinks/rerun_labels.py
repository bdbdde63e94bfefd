"""Where the names of placed maps stand: each on ground that only its robot knows, away from the other names."""

from __future__ import annotations

from collections.abc import Mapping

import cv2
import numpy as np

from mapmerge.grid import Grid
from mapmerge.sim2 import Points, Sim2

PointM = tuple[float, float]

_SIDE_CELLS = 32
_SURE = 0.9
_FROM_LABELS = 0.5


def known_places_m(grid: Grid) -> Points:
    """Return a few hundred places of what a map knows, in its map frame, shape (N, 2).

    They are the middles of squares that it knows altogether or, where it knows none so, of those that it knows best.
    """
    known = (grid.cells >= 0).astype(np.float32)
    if known.size == 0:
        return np.empty((0, 2))
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
    merged_m = {robot: pose.apply(places_m[robot]) for robot, pose in poses.items()}
    found: dict[str, PointM] = {}
    for robot, own_m in merged_m.items():
        others = [each for name, each in merged_m.items() if name != robot]
        worth = _nearest_m(own_m, np.concatenate(others)) if others else -_nearest_m(own_m, own_m.mean(axis=0)[None])
        if found:
            worth = worth + _FROM_LABELS * _nearest_m(own_m, np.array(list(found.values())))
        x_m, y_m = own_m[int(np.argmax(worth))]
        found[robot] = float(x_m), float(y_m)
    return found


def _nearest_m(points_m: Points, others_m: Points) -> Points:
    """Return how far each point is from the nearest of some others."""
    squared = ((points_m[:, None, :] - others_m[None, :, :]) ** 2).sum(axis=2)
    return np.asarray(np.sqrt(squared.min(axis=1)))
