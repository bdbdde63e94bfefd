"""Alignment of many candidate placements at once: ICP on the walls (paper, equations 23 and 24).

The nearest wall of a point is a look-up, so a step costs a pass over the points, and all candidates take the step
together. Pairs beyond a distance that narrows are left out: plain ICP pulls good alignments away.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mapmerge.prepared import PreparedMap
from mapmerge.sim2 import Points, Sim2

Poses = NDArray[np.float64]
"""Placements ``target_from_source`` of one pair between its grid frames, shape (C, 4): x_m, y_m, yaw_rad, scale."""

_MIN_PAIRS = 12
_CAUCHY = 0.35


def poses_of(placements: Sequence[Sim2]) -> Poses:
    """Return placements as an array, shape (C, 4)."""
    rows = [(pose.x_m, pose.y_m, pose.yaw_rad, pose.scale) for pose in placements]
    return np.array(rows, np.float64).reshape(-1, 4)


def placement_of(pose: NDArray[np.float64]) -> Sim2:
    """Return one row of `Poses` as a transform."""
    x_m, y_m, yaw_rad, scale = pose.tolist()
    return Sim2(x_m, y_m, yaw_rad, scale)


def composed(one: Poses, other: Poses) -> Poses:
    """Return ``one @ other`` row by row; a single row is used for all of the other array."""
    cos, sin = one[:, 3] * np.cos(one[:, 2]), one[:, 3] * np.sin(one[:, 2])
    x_m, y_m = other[:, 0], other[:, 1]
    rows = (
        cos * x_m - sin * y_m + one[:, 0],
        sin * x_m + cos * y_m + one[:, 1],
        one[:, 2] + other[:, 2],
        one[:, 3] * other[:, 3],
    )
    return np.stack(np.broadcast_arrays(*rows), axis=1)


def inverses(poses: Poses) -> Poses:
    """Return ``source_from_target`` for each ``target_from_source``."""
    cos, sin, scale = np.cos(poses[:, 2]), np.sin(poses[:, 2]), poses[:, 3]
    x_m, y_m = poses[:, 0], poses[:, 1]
    return np.stack(
        [-(cos * x_m + sin * y_m) / scale, (sin * x_m - cos * y_m) / scale, -poses[:, 2], 1 / scale], axis=1
    )


def placed(poses: Poses, points_m: Points) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return x and y of points, shape (N, 2), at each of the placements, each of shape (C, N)."""
    cos = (poses[:, 3] * np.cos(poses[:, 2])).astype(np.float32)[:, None]
    sin = (poses[:, 3] * np.sin(poses[:, 2])).astype(np.float32)[:, None]
    x, y = points_m.astype(np.float32).T
    return (
        cos * x - sin * y + poses[:, :1].astype(np.float32),
        sin * x + cos * y + poses[:, 1:2].astype(np.float32),
    )


def evenly(points_m: Points, most: int) -> Points:
    """Return at most so many of the points, evenly spread over their order."""
    if len(points_m) <= most:
        return points_m
    chosen: NDArray[np.intp] = np.linspace(0, len(points_m) - 1, most).astype(np.intp)
    return points_m[chosen]


def align(
    target: PreparedMap,
    walls_m: Points,
    starts: Poses,
    reject_m: Sequence[float],
    *,
    scales: tuple[float, float] = (1.0, 1.0),
) -> Poses:
    """Return the placements aligned with the target's walls, shape (C, 4).

    Parameters
    ----------
    target
        The map that stays.
    walls_m
        Wall points of the source in its grid frame, shape (N, 2).
    starts
        Where to begin, shape (C, 4).
    reject_m
        For each step, the distance beyond which pairs are left out.
    scales
        Least and largest scale; equal ones keep that of the starts.
    """
    poses = starts.copy()
    if len(walls_m) == 0 or len(target.walls_m) == 0 or len(poses) == 0:
        return poses
    for distance_m in reject_m:
        poses = _step(target, walls_m, poses, distance_m, scales)
    return poses


def _step(target: PreparedMap, walls_m: Points, poses: Poses, reject_m: float, scales: tuple[float, float]) -> Poses:
    """Pair each point with its nearest wall; return the poses moved by the motion that brings the pairs together."""
    x, y = placed(poses, walls_m)
    wall = target.nearest.wall_at(x, y)
    error_x, error_y = target.nearest.x_m[wall] - x, target.nearest.y_m[wall] - y
    square = error_x * error_x + error_y * error_y
    # Cauchy weights: what is far apart says less
    weight = 1.0 / (1.0 + square * np.float32(1.0 / (_CAUCHY * reject_m) ** 2))
    weight[square > reject_m * reject_m] = 0.0
    total = weight.sum(axis=1, dtype=np.float64)
    enough = np.count_nonzero(weight, axis=1) >= _MIN_PAIRS
    safe = np.where(enough, total, 1.0)

    def mean(values: NDArray[np.float32]) -> NDArray[np.float64]:
        return np.asarray(np.einsum("cn,cn->c", weight, values) / safe, np.float64)

    pivot_x, pivot_y, shift_x, shift_y = mean(x), mean(y), mean(error_x), mean(error_y)
    arm_x, arm_y = x - pivot_x[:, None].astype(np.float32), y - pivot_y[:, None].astype(np.float32)
    cross = mean(arm_x * error_y - arm_y * error_x)
    along = mean(arm_x * error_x + arm_y * error_y)
    spread = np.maximum(mean(arm_x * arm_x + arm_y * arm_y), 1e-9)
    turn = np.where(enough, np.arctan2(cross, spread + along), 0.0)
    moved = poses.copy()
    growth = np.ones(len(poses))
    if scales[0] < scales[1]:
        factor = np.hypot(cross, spread + along) / spread
        moved[:, 3] = np.where(enough, np.clip(poses[:, 3] * factor, *scales), poses[:, 3])
        growth = moved[:, 3] / poses[:, 3]
    cos, sin = growth * np.cos(turn), growth * np.sin(turn)
    from_x, from_y = poses[:, 0] - pivot_x, poses[:, 1] - pivot_y
    moved[:, 0] = np.where(enough, pivot_x + shift_x + cos * from_x - sin * from_y, poses[:, 0])
    moved[:, 1] = np.where(enough, pivot_y + shift_y + sin * from_x + cos * from_y, poses[:, 1])
    moved[:, 2] = poses[:, 2] + turn
    return moved
