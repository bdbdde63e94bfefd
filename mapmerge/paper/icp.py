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


def least_squares(p_m: Points, q_m: Points, *, scaled: bool = False) -> Sim2:
    """Return R, t of least Σ ‖q_i − (R p_i + t)‖² (equation 24), in closed form; with ``scaled``, s as well."""
    p_mean, q_mean = p_m.mean(axis=0), q_m.mean(axis=0)
    p, q = p_m - p_mean, q_m - q_mean
    cross, dot = float((p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]).sum()), float((p * q).sum())
    spread = float(np.square(p).sum())
    scale = math.hypot(cross, dot) / spread if scaled and spread > 0.0 else 1.0
    turn = Sim2(yaw_rad=math.atan2(cross, dot), scale=scale or 1.0)
    x_m, y_m = turn.apply_point(*p_mean.tolist())
    return Sim2(float(q_mean[0]) - x_m, float(q_mean[1]) - y_m, turn.yaw_rad, turn.scale)


def icp(
    target: PreparedMap,
    occupied_m: Points,
    start: Sim2,
    reject_m: Sequence[float],
    iterations: int,
    *,
    scale_range: tuple[float, float] | None = None,
) -> Sim2:
    """Return T_ICP × T_RANSAC, which brings the occupied cells of two maps together.

    Parameters
    ----------
    target
        The map that stays.
    occupied_m
        The source's occupied cells P_occ in its grid frame, shape (N, 2).
    start
        T_RANSAC, ``target_from_source``.
    reject_m
        Pairs further apart than this are left out, in turn. The paper states no such distance; without one, walls
        that only one map shows pull good alignments away.
    iterations
        At most so many at each of these distances.
    scale_range
        If given, the scale is aligned as well, as long as it stays within; else that of ``start`` is kept, as in
        equation 24.
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
            motion = least_squares(points_m[near], nearest_m[near], scaled=scale_range is not None)
            if scale_range is not None and not scale_range[0] <= (motion @ pose).scale <= scale_range[1]:
                motion = least_squares(points_m[near], nearest_m[near])
            pose = motion @ pose
            if _is_still(motion, points_m[near]):
                break
    return pose


def _is_still(motion: Sim2, points_m: Points) -> bool:
    shift_m = (motion.apply(points_m) - points_m).mean(axis=0)
    turned = abs(motion.yaw_rad) + abs(motion.scale - 1.0)
    return float(np.hypot(*shift_m)) < _STILL_M and turned < _STILL_RAD


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
