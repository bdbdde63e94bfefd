"""The second alignment: ICP on the occupied cells of the original maps (equations 23 and 24)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from mapmerge.prepare import PreparedMap
from mapmerge.sim2 import Points, Sim2

_MIN_PAIRS = 12
_STILL_M = 1e-4
_STILL_RAD = 1e-5


def least_squares(p_m: Points, q_m: Points) -> Sim2:
    """Return R, t of least Σ ‖q_i − (R p_i + t)‖² (equation 24), in closed form."""
    p_mean, q_mean = p_m.mean(axis=0), q_m.mean(axis=0)
    p, q = p_m - p_mean, q_m - q_mean
    yaw_rad = math.atan2(float((p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]).sum()), float((p * q).sum()))
    turned_x, turned_y = Sim2(yaw_rad=yaw_rad).apply_point(*p_mean.tolist())
    return Sim2(float(q_mean[0]) - turned_x, float(q_mean[1]) - turned_y, yaw_rad)


def icp(target: PreparedMap, occupied_m: Points, start: Sim2, reject_m: Sequence[float], iterations: int) -> Sim2:
    """Return T_ICP × T_RANSAC, which brings the occupied cells of two maps together.

    Parameters
    ----------
    target
        The map that stays.
    occupied_m
        The source's occupied cells P_occ in its grid frame, shape (N, 2).
    start
        T_RANSAC, ``target_from_source``; its scale is kept.
    reject_m
        Pairs further apart than this are left out, in turn. The paper states no such distance; without one, walls
        that only one map shows pull good alignments away.
    iterations
        At most so many at each of these distances.
    """
    pose = start
    if len(target.wall_cells_m) == 0 or len(occupied_m) == 0:
        return pose
    for limit_m in reject_m:
        for _ in range(iterations):
            points_m = pose.apply(occupied_m)  # equation 23
            nearest_m = nearest_walls(target, points_m)
            near = np.square(nearest_m - points_m).sum(axis=1) <= limit_m**2
            if int(np.count_nonzero(near)) < _MIN_PAIRS:
                return pose
            step = least_squares(points_m[near], nearest_m[near])
            moved = step @ pose
            pose = Sim2(moved.x_m, moved.y_m, moved.yaw_rad, start.scale)
            if math.hypot(*(step.apply(points_m[near]) - points_m[near]).mean(axis=0)) < _STILL_M and (
                abs(step.yaw_rad) < _STILL_RAD
            ):
                break
    return pose


def nearest_walls(target: PreparedMap, points_m: Points) -> Points:
    """Return the target's occupied cell that is nearest to each point, its correspondence.

    It is looked up in the labelled distance transform; for a point beyond the map, at the border nearest to it.
    """
    rows, cols = target.classes.shape
    cell = np.floor(points_m / target.resolution_m).astype(np.intp) + target.margin
    index = np.clip(cell[:, 1], 0, rows - 1) * cols + np.clip(cell[:, 0], 0, cols - 1)
    one, other = target.nearest_wall.ravel()[index], target.nearest_wall_too.ravel()[index]
    nearest: Points = 0.5 * (target.wall_cells_m[one] + target.wall_cells_m[other])
    return nearest
