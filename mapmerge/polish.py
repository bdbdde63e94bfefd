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
    reach = math.ceil(3.0 * blur_cells)
    around = np.arange(-reach, reach + 1)
    rows, cols = target.classes.shape
    place = points_m / target.resolution_m + target.margin
    cell = np.floor(place).astype(np.intp)
    row, col = cell[:, 1, None] + around, cell[:, 0, None] + around
    kernel_y = np.exp(-0.5 * np.square((row + 0.5 - place[:, 1, None]) / blur_cells))
    kernel_x = np.exp(-0.5 * np.square((col + 0.5 - place[:, 0, None]) / blur_cells))
    inside = ((row >= 0) & (row < rows))[:, :, None] & ((col >= 0) & (col < cols))[:, None, :]
    index = np.clip(row, 0, rows - 1)[:, :, None] * cols + np.clip(col, 0, cols - 1)[:, None, :]
    walls = (target.classes.ravel()[index] == CELL_OCCUPIED) & inside
    pull = walls * kernel_y[:, :, None] * kernel_x[:, None, :]
    weight = pull.sum(axis=(1, 2))
    drawn = weight > 0
    if int(np.count_nonzero(drawn)) < _MIN_PAIRS:
        return None
    pull, weight, place = pull[drawn], weight[drawn], place[drawn]
    error: Points = np.empty_like(place)
    error[:, 0] = (pull * (col[drawn] + 0.5)[:, None, :]).sum(axis=(1, 2)) / weight - place[:, 0]
    error[:, 1] = (pull * (row[drawn] + 0.5)[:, :, None]).sum(axis=(1, 2)) / weight - place[:, 1]
    points = points_m[drawn]
    centre = points.mean(axis=0)
    return _rigid_motion(points - centre, error * target.resolution_m, weight, centre)


def _is_still(step: Sim2) -> bool:
    return math.hypot(step.x_m, step.y_m) < _CONVERGED_M and abs(step.yaw_rad) < _CONVERGED_RAD


def _rigid_motion(arms: Points, error: Points, weight: NDArray[np.float64], centre: Points) -> Sim2:
    """Return the motion about ``centre`` that best moves the points by their errors (weighted, closed form)."""
    total = weight.sum()
    mean_arm = (weight[:, None] * arms).sum(axis=0) / total
    mean_error = (weight[:, None] * error).sum(axis=0) / total
    before, after = arms - mean_arm, arms + error - (mean_arm + mean_error)
    cross = float((weight * (before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0])).sum())
    dot = float((weight * (before * after).sum(axis=1)).sum())
    yaw_rad = math.atan2(cross, dot)
    turned = Sim2(yaw_rad=yaw_rad)
    pivot = centre + mean_arm
    moved_x, moved_y = turned.apply_point(float(pivot[0]), float(pivot[1]))
    shift = pivot + mean_error
    return Sim2(float(shift[0]) - moved_x, float(shift[1]) - moved_y, yaw_rad)
