"""Alignment of a placement to a fraction of a cell.

ICP cannot tell where in a cell it ends. `polish` can: it maximises the correlation of both maps' walls, each blurred by
about a cell, which is smooth and treats the two maps alike.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mapmerge.align import evenly
from mapmerge.config import RefineConfig
from mapmerge.prepared import CELL_OCCUPIED, PreparedMap
from mapmerge.sim2 import Points, Sim2

Floats = NDArray[np.float32]

_CONVERGED_M = 2e-4
_CONVERGED_RAD = 2e-5
_MIN_PAIRS = 12


def polish(target: PreparedMap, wall_cells_m: Points, start: Sim2, config: RefineConfig) -> Sim2:
    """Return ``target_from_source`` aligned to a fraction of a cell, searched from a placement that is right to a cell.

    Parameters
    ----------
    target
        The map that stays.
    wall_cells_m
        Centres of the source's occupied cells in its grid frame, shape (N, 2).
    start
        ``target_from_source`` that ICP returned; its scale is kept.
    """
    cells_m = evenly(wall_cells_m, config.max_polish_points)
    pose = start
    for _ in range(config.iterations):
        step = _blurred_step(target, pose.apply(cells_m), config.blur_cells)
        if step is None:
            return pose
        pose = step @ pose
        if _is_still(step):
            break
    return pose


def _blurred_step(target: PreparedMap, points_m: Points, blur_cells: float) -> Sim2 | None:
    """One step: draw each point to the mean of the walls around it, near ones counting more.

    Each point counts as much as there are walls around it, so that the pulls of two equal maps cancel out exactly.
    """
    place = points_m.T / target.resolution_m + target.margin
    weight, pull_x, pull_y = _pulls(target, place, blur_cells)
    drawn = np.flatnonzero(weight > 0)
    if len(drawn) < _MIN_PAIRS:
        return None
    drawn_weight, points = weight[drawn].astype(np.float64), points_m[drawn]
    error = np.stack([pull_x[drawn], pull_y[drawn]], axis=1).astype(np.float64) / drawn_weight[:, None]
    centre = points.mean(axis=0)
    return _rigid_motion(points - centre, error * target.resolution_m, drawn_weight, centre)


def _pulls(target: PreparedMap, place: Points, blur_cells: float) -> tuple[Floats, Floats, Floats]:
    """Return how much wall is around each place, in cells, shape (2, N), and the sums of the ways to it in x and y."""
    reach = math.ceil(3.0 * blur_cells)
    rows, cols = target.classes.shape
    # a window that would leave the map lies in its margin instead, where there is no wall
    largest = np.array([[cols - 1 - reach], [rows - 1 - reach]])
    cell = np.clip(np.floor(place), reach, largest).astype(np.intp)
    around = np.arange(-reach, reach + 1)
    # shapes (2R + 1, N): the way from the place to the middles of the window's columns and rows
    way_x, way_y = ((cell - place)[:, None] + (around + 0.5)[:, None]).astype(np.float32)
    near_x, near_y = (np.exp(np.square(way) * np.float32(-0.5 / blur_cells**2)) for way in (way_x, way_y))
    window = (around[:, None] * cols + around)[:, :, None] + (cell[1] * cols + cell[0])
    walls = (target.classes.ravel().take(window) == CELL_OCCUPIED).astype(np.float32)
    # sums over the columns of each row of the window, then over its rows
    in_rows, along_rows = (walls * near_x).sum(axis=1), (walls * (near_x * way_x)).sum(axis=1)
    return (
        np.asarray((in_rows * near_y).sum(axis=0), np.float32),
        np.asarray((along_rows * near_y).sum(axis=0), np.float32),
        np.asarray((in_rows * (near_y * way_y)).sum(axis=0), np.float32),
    )


def _is_still(step: Sim2) -> bool:
    return math.hypot(step.x_m, step.y_m) < _CONVERGED_M and abs(step.yaw_rad) < _CONVERGED_RAD


def _rigid_motion(arms: Points, error: Points, weight: NDArray[np.float64], centre: Points) -> Sim2:
    """Return the motion about ``centre`` that best moves the points by their errors (weighted, closed form)."""
    total = weight.sum()
    mean_arm = weight @ arms / total
    mean_error = weight @ error / total
    before, after = arms - mean_arm, arms + error - (mean_arm + mean_error)
    cross = float(weight @ (before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]))
    dot = float(weight @ (before[:, 0] * after[:, 0] + before[:, 1] * after[:, 1]))
    yaw_rad = math.atan2(cross, dot)
    turned = Sim2(yaw_rad=yaw_rad)
    pivot = centre + mean_arm
    moved_x, moved_y = turned.apply_point(float(pivot[0]), float(pivot[1]))
    shift = pivot + mean_error
    return Sim2(float(shift[0]) - moved_x, float(shift[1]) - moved_y, yaw_rad)
