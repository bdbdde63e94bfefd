"""Alignment of many candidate placements at once: ICP on the walls (paper, equations 23 and 24).

The nearest wall of a point is a look-up, so a step costs a pass over the points, and all candidates take the step
together. Pairs beyond a distance that narrows are left out: plain ICP pulls good alignments away.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapmerge.prepared import NearestWalls, PreparedMap
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
    columns = np.ones((3, len(points_m)), np.float32)
    columns[:2] = points_m.T
    x, y = (_placing(poses).reshape(-1, 3).astype(np.float32) @ columns).reshape(2, len(poses), len(points_m))
    return x, y


def _placing(poses: Poses) -> NDArray[np.float64]:
    """Return what x, y and 1 of a point are multiplied with for its place, shape (2, C, 3): x there, and y."""
    rows = np.empty((2, len(poses), 3))
    rows[0, :, 0] = rows[1, :, 1] = poses[:, 3] * np.cos(poses[:, 2])
    rows[1, :, 0] = poses[:, 3] * np.sin(poses[:, 2])
    rows[0, :, 1] = -rows[1, :, 0]
    rows[:, :, 2] = poses[:, :2].T
    return rows


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
    if len(walls_m) == 0 or len(target.walls_m) == 0 or len(starts) == 0:
        return starts.copy()
    middle_m = walls_m.mean(axis=0)
    points, walls = _points(walls_m - middle_m), _Walls.of(target.nearest)
    to_middle = np.array([[*middle_m, 0.0, 1.0]])
    poses = composed(starts, to_middle)
    for distance_m in reject_m:
        poses = _moved(poses, _pairs(walls, points, poses, distance_m), scales)
    return composed(poses, inverses(to_middle))


@dataclass(frozen=True, slots=True, eq=False)
class _Points:
    """Points about their middle, as what is multiplied with placements, and with weights.

    Parameters
    ----------
    columns
        Shape (3, N): x, y and 1.
    powers
        Shape (N, 4): 1, x, y and x² + y².
    """

    columns: NDArray[np.float32]
    powers: NDArray[np.float32]


def _points(points_m: Points) -> _Points:
    x, y = points_m.T
    one = np.ones(len(points_m))
    return _Points(
        np.stack([x, y, one]).astype(np.float32), np.stack([one, x, y, x * x + y * y], axis=1).astype(np.float32)
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Walls:
    """`NearestWalls`, flat: the number of the wall nearest to each cell, and both coordinates of each wall as one."""

    index: NDArray[np.int32]
    place_m: NDArray[np.complex64]
    shape: tuple[int, int]
    cell_m: float
    corner_m: tuple[float, float]

    @classmethod
    def of(cls, nearest: NearestWalls) -> _Walls:
        rows, cols = nearest.index.shape
        place_m = (nearest.x_m + 1j * nearest.y_m).astype(np.complex64)
        return cls(nearest.index.ravel(), place_m, (rows, cols), nearest.cell_m, nearest.corner_m)

    def at(self, col: NDArray[np.float32], row: NDArray[np.float32]) -> NDArray[np.complex64]:
        """Return the places of the walls nearest to places in cells; these are overwritten."""
        rows, cols = self.shape
        cell = np.clip(row, 0, rows - 1, out=row).astype(np.int32)
        cell *= np.int32(cols)
        cell += np.clip(col, 0, cols - 1, out=col).astype(np.int32)
        return self.place_m.take(self.index.take(cell))


@dataclass(frozen=True, slots=True, eq=False)
class _Pairs:
    """Sums over the pairs of a point and its nearest wall, of each of C placements.

    Parameters
    ----------
    enough
        Whether there are enough pairs, shape (C,).
    arms
        Means of 1, x, y and x² + y² of the points, shape (C, 4).
    error_x, error_y
        Means of how far the wall is from the point, by itself and times x and y of the point, shape (C, 3) each.
    """

    enough: NDArray[np.bool_]
    arms: NDArray[np.float64]
    error_x: NDArray[np.float64]
    error_y: NDArray[np.float64]


def _pairs(walls: _Walls, points: _Points, poses: Poses, reject_m: float) -> _Pairs:
    """Pair each point with its nearest wall, unless that is too far away."""
    in_m = _placing(poses)
    in_cells = in_m / walls.cell_m
    in_cells[:, :, 2] -= np.array(walls.corner_m)[:, None] / walls.cell_m
    # one product for all placements of all points, in metres and in cells of the look-up
    placing = np.concatenate([in_m, in_cells])
    x, y, col, row = (placing.reshape(-1, 3).astype(np.float32) @ points.columns).reshape(
        4, len(poses), len(points.powers)
    )
    nearest = walls.at(col, row)
    error_x, error_y = nearest.real - x, nearest.imag - y
    square = error_x * error_x + error_y * error_y
    is_near = (square <= np.float32(reject_m * reject_m)).astype(np.float32)
    # Cauchy weights: what is far apart says less
    square *= np.float32(1.0 / (_CAUCHY * reject_m) ** 2)
    square += np.float32(1.0)
    weight = np.divide(is_near, square, out=square)
    powers = points.powers
    arms = (weight @ powers).astype(np.float64)
    enough = is_near @ powers[:, 0] >= _MIN_PAIRS
    total = np.where(enough, arms[:, 0], 1.0)[:, None]
    error_x *= weight
    error_y *= weight
    return _Pairs(enough, arms / total, (error_x @ powers[:, :3]) / total, (error_y @ powers[:, :3]) / total)


def _moved(poses: Poses, pairs: _Pairs, scales: tuple[float, float]) -> Poses:
    """Return the poses moved by the motion that brings the pairs together."""
    cos, sin = poses[:, 3] * np.cos(poses[:, 2]), poses[:, 3] * np.sin(poses[:, 2])
    _, middle_x, middle_y, square = pairs.arms.T
    (shift_x, xx, yx), (shift_y, xy, yy) = pairs.error_x.T, pairs.error_y.T
    # of points about their weighted mean
    xx, yx, xy, yy = xx - middle_x * shift_x, yx - middle_y * shift_x, xy - middle_x * shift_y, yy - middle_y * shift_y
    cross = cos * (xy - yx) - sin * (xx + yy)
    along = cos * (xx + yy) + sin * (xy - yx)
    spread = np.maximum(poses[:, 3] ** 2 * (square - middle_x**2 - middle_y**2), 1e-9)
    turn = np.where(pairs.enough, np.arctan2(cross, spread + along), 0.0)
    moved = poses.copy()
    growth = np.ones(len(poses))
    if scales[0] < scales[1]:
        factor = np.hypot(cross, spread + along) / spread
        moved[:, 3] = np.where(pairs.enough, np.clip(poses[:, 3] * factor, *scales), poses[:, 3])
        growth = moved[:, 3] / poses[:, 3]
    arm_x, arm_y = cos * middle_x - sin * middle_y, sin * middle_x + cos * middle_y
    turn_cos, turn_sin = growth * np.cos(turn), growth * np.sin(turn)
    moved[:, 0] += np.where(pairs.enough, shift_x + arm_x - turn_cos * arm_x + turn_sin * arm_y, 0.0)
    moved[:, 1] += np.where(pairs.enough, shift_y + arm_y - turn_sin * arm_x - turn_cos * arm_y, 0.0)
    moved[:, 2] += turn
    return moved
