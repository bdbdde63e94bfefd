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

Complex = NDArray[np.complex128]

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


def placed(
    poses: Poses, points_m: Points, cell_m: float = 1.0, margin: int = 0
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return x and y of points, shape (N, 2), at each of the placements, each of shape (C, N).

    They are in cells of a side of ``cell_m``, of which so many lie before the origin.
    """
    columns = np.ones((3, len(points_m)), np.float32)
    columns[:2] = points_m.T
    place = poses[:, 0] / cell_m + margin + 1j * (poses[:, 1] / cell_m + margin)
    turn = poses[:, 3] / cell_m * np.exp(1j * poses[:, 2])
    x, y = (_placing(place, turn).reshape(-1, 3).astype(np.float32) @ columns).reshape(2, len(poses), len(points_m))
    return x, y


def _placing(place: Complex, turn: Complex) -> NDArray[np.float64]:
    """Return what x, y and 1 of a point are multiplied with for its place, shape (2, C, 3): x there, and y.

    Parameters
    ----------
    place
        Where the points' origin is placed, x + iy, shape (C,).
    turn
        The scale times the turn, as a complex number, shape (C,).
    """
    rows = np.empty((2, len(place), 3))
    rows[0, :, 0], rows[0, :, 1], rows[0, :, 2] = turn.real, -turn.imag, place.real
    rows[1, :, 0], rows[1, :, 1], rows[1, :, 2] = turn.imag, turn.real, place.imag
    return rows


def evenly(points_m: Points, most: int) -> Points:
    """Return at most so many of the points, evenly spread over their order."""
    if len(points_m) <= most:
        return points_m
    chosen: NDArray[np.intp] = np.arange(most) * (len(points_m) - 1) // max(1, most - 1)
    return points_m.take(chosen, axis=0)


def middle_of(points_m: Points) -> Points:
    """Return the mean of points, shape (N, 2); `numpy.mean` takes twenty times as long for this shape."""
    return np.asarray(np.ones(len(points_m)) @ points_m / len(points_m), np.float64)


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
    x_m, y_m = middle_of(walls_m).tolist()
    points, walls = _points(walls_m - (x_m, y_m)), _Walls.of(target.nearest)
    turn = starts[:, 3] * np.exp(1j * starts[:, 2])
    place = starts[:, 0] + 1j * starts[:, 1] + turn * complex(x_m, y_m)
    for distance_m in reject_m:
        place, turn = _moved(place, turn, _pairs(walls, points, place, turn, distance_m), scales)
    place -= turn * complex(x_m, y_m)
    size = np.abs(turn) if scales[0] < scales[1] else starts[:, 3]
    return np.stack([place.real, place.imag, np.angle(turn), size], axis=1)


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
    """`NearestWalls`, flat: the number of the wall nearest to each cell, and where each wall is, x + iy, in cells."""

    index: NDArray[np.int32]
    place: NDArray[np.complex64]
    shape: tuple[int, int]
    cell_m: float
    corner: complex

    @classmethod
    def of(cls, nearest: NearestWalls) -> _Walls:
        rows, cols = nearest.index.shape
        corner = complex(*nearest.corner_m) / nearest.cell_m
        place = (nearest.x_m + 1j * nearest.y_m).astype(np.complex64)
        place *= np.float32(1.0 / nearest.cell_m)
        place -= np.complex64(corner)
        return cls(nearest.index.ravel(), place, (rows, cols), nearest.cell_m, corner)

    def at(self, col: NDArray[np.float32], row: NDArray[np.float32]) -> NDArray[np.complex64]:
        """Return the places of the walls nearest to some places, all in cells."""
        rows, cols = self.shape
        cell = row.clip(0, rows - 1).astype(np.int32)
        cell *= np.int32(cols)
        cell += col.clip(0, cols - 1).astype(np.int32)
        # none is outside: looking for such ones would take a quarter of the time
        return self.place.take(self.index.take(cell, mode="wrap"), mode="wrap")


@dataclass(frozen=True, slots=True, eq=False)
class _Pairs:
    """Weighted means over the pairs of a point and its nearest wall, of each of C placements: shape (C,) each.

    Points and errors are complex, x + iy; points are in the source's frame, about the middle of all, errors are the way
    to the wall, in the target's.

    Parameters
    ----------
    enough
        Whether there are enough pairs.
    point, square
        Of the points, and of the square of how far they are from the middle.
    error, pull
        Of the errors, and of each times its point, conjugate.
    """

    enough: NDArray[np.bool_]
    point: Complex
    square: NDArray[np.float64]
    error: Complex
    pull: Complex


def _pairs(walls: _Walls, points: _Points, place: Complex, turn: Complex, reject_m: float) -> _Pairs:
    """Pair each point with its nearest wall, unless that is too far away."""
    # one product for all placements of all points, in cells of the look-up
    placing = _placing(place / walls.cell_m - walls.corner, turn / walls.cell_m).astype(np.float32)
    shape = len(place), len(points.powers)
    col, row = (placing.reshape(-1, 3) @ points.columns).reshape(2, *shape)
    nearest, reject = walls.at(col, row), reject_m / walls.cell_m
    weighted = np.empty((3, *shape), np.float32)
    weight, error_x, error_y = weighted
    np.subtract(nearest.real, col, out=error_x)
    np.subtract(nearest.imag, row, out=error_y)
    square = error_x * error_x
    square += error_y * error_y
    is_near = (square <= np.float32(reject * reject)).astype(np.float32)
    # Cauchy weights: what is far apart says less
    square *= np.float32(1.0 / (_CAUCHY * reject) ** 2)
    square += np.float32(1.0)
    np.divide(is_near, square, out=weight)
    weighted[1:] *= weight
    sums = (weighted.reshape(-1, shape[1]) @ points.powers).astype(np.float64).reshape(3, shape[0], 4)
    enough = is_near @ points.powers[:, 0] >= _MIN_PAIRS
    total = np.where(enough, sums[0, :, 0], 1.0)
    (_, arm_x, arm_y, arm_square), (along_x, xx, yx, _), (along_y, xy, yy, _) = sums.transpose(0, 2, 1) / total
    error, pull = along_x + 1j * along_y, xx + yy + 1j * (xy - yx)
    return _Pairs(enough, arm_x + 1j * arm_y, arm_square, walls.cell_m * error, walls.cell_m * pull)


def _moved(place: Complex, turn: Complex, pairs: _Pairs, scales: tuple[float, float]) -> tuple[Complex, Complex]:
    """Return the placements moved by the motion that brings the pairs together."""
    # of points about their weighted mean, turned as they are
    arm = turn * pairs.point
    pull = turn.conj() * (pairs.pull - pairs.point.conj() * pairs.error)
    size = np.abs(turn)
    spread = np.maximum(size**2 * (pairs.square - np.abs(pairs.point) ** 2), 1e-9)
    factor = (spread + pull) / spread
    growth = np.abs(factor)
    factor /= np.where(growth > 0.0, growth, 1.0)
    if scales[0] < scales[1]:
        factor *= np.clip(size * growth, *scales) / size
    moved = place + arm + pairs.error - factor * arm
    return np.where(pairs.enough, moved, place), np.where(pairs.enough, factor * turn, turn)
