"""Alignment of a placement to a fraction of a cell.

ICP cannot tell where in a cell it ends. `polish` can: it maximises the correlation of both maps' walls, each blurred by
about a cell, which is smooth and treats the two maps alike.
"""

from __future__ import annotations

import cmath
import math

import numpy as np
from numpy.typing import NDArray

from mapmerge.align import evenly, middle_of
from mapmerge.config import RefineConfig
from mapmerge.prepared import CELL_OCCUPIED, PreparedMap
from mapmerge.sim2 import Points, Sim2

Floats = NDArray[np.float32]

_CONVERGED_M = 5e-4
_CONVERGED_RAD = 5e-5
_MIN_PAIRS = 12
_SLACK_CELLS, _SLACK_SQUARES = 3.0, 2.0


def polish(target: PreparedMap, wall_cells_m: Points, start: Sim2, config: RefineConfig) -> Sim2:
    """Return ``target_from_source`` aligned to a fraction of a cell, searched from a placement that is right to a cell.

    Each step draws each point to the mean of the walls around it, near ones counting more. Each point counts as much as
    there are walls around it, so that the pulls of two equal maps cancel out exactly.

    Parameters
    ----------
    target
        The map that stays.
    wall_cells_m
        Centres of the source's occupied cells in its grid frame, shape (N, 2).
    start
        ``target_from_source`` that ICP returned; its scale is kept.
    config
        Settings.
    """
    points_m = _near_walls(target, evenly(wall_cells_m, config.max_polish_points), start, config.blur_cells)
    if len(points_m) < _MIN_PAIRS:
        return start
    windows = _Windows(target, len(points_m), config.blur_cells)
    middle_m = middle_of(points_m)
    powers = _powers(points_m - middle_m)
    middle = complex(*middle_m.tolist())
    turn = start.scale * cmath.exp(1j * start.yaw_rad)
    place = complex(start.x_m, start.y_m) + turn * middle
    for _ in range(config.iterations):
        pulls = windows.pulls(powers[:, 1:3], place, turn)
        if np.count_nonzero(pulls[0]) < _MIN_PAIRS:
            break
        moved, factor = _motion(pulls.astype(np.float64) @ powers, turn, target.resolution_m)
        place, turn = place + moved, turn * factor
        if abs(moved) < _CONVERGED_M and abs(cmath.phase(factor)) < _CONVERGED_RAD:
            break
    corner = place - turn * middle
    return Sim2(corner.real, corner.imag, cmath.phase(turn), start.scale)


def _near_walls(target: PreparedMap, points_m: Points, start: Sim2, blur_cells: float) -> Points:
    """Return the points that have walls around them, or would have if they moved by a few cells: others say nothing."""
    reach_m = (math.sqrt(2.0) * math.ceil(3.0 * blur_cells) + _SLACK_CELLS) * target.resolution_m
    reach_m += _SLACK_SQUARES * target.nearest.cell_m
    if reach_m > (target.margin - 2) * target.resolution_m:
        # of coarse cells, that is further than the nearest wall is known
        return points_m
    x_m, y_m = start.apply(points_m).T.astype(np.float32)
    return points_m[target.nearest.distance_m(target.nearest.wall_at(x_m, y_m), x_m, y_m) <= reach_m]


def _powers(arms_m: Points) -> NDArray[np.float64]:
    """Return 1, x, y and x² + y² of points, shape (N, 4)."""
    return np.concatenate([np.ones((len(arms_m), 1)), arms_m, np.square(arms_m).sum(axis=1, keepdims=True)], axis=1)


class _Windows:
    """The walls of a map in the square of cells around each of some points, which move little from step to step.

    Parameters
    ----------
    target
        The map.
    count
        Number of points.
    blur_cells
        Standard deviation by which walls are blurred: the squares reach three times as far.
    """

    def __init__(self, target: PreparedMap, count: int, blur_cells: float) -> None:
        self._target, self._sharpness = target, np.float32(-0.5 / blur_cells**2)
        self._reach = math.ceil(3.0 * blur_cells)
        self._around = np.arange(-self._reach, self._reach + 1)
        self._middles = (self._around + 0.5).astype(np.float32)[:, None]
        self._cell = np.full((2, count), -1, np.intp)
        side = len(self._around)
        self._walls = np.empty((side, side, count), np.float32)

    def pulls(self, arms_m: Points, place: complex, turn: complex) -> Floats:
        """Return how much wall is around each point, and the sums of the ways to it in x and y, in cells: shape (3, N).

        Parameters
        ----------
        arms_m
            The points from their middle, in the source's frame, shape (N, 2).
        place, turn
            Where their middle is placed, x + iy in metres, and their scale times their turn, as a complex number.
        """
        target, reach = self._target, self._reach
        in_cells = turn / target.resolution_m
        corner = place / target.resolution_m + complex(target.margin, target.margin)
        at = np.array([[in_cells.real, -in_cells.imag], [in_cells.imag, in_cells.real]]) @ arms_m.T
        at += [[corner.real], [corner.imag]]
        rows, cols = target.classes.shape
        # a window that would leave the map lies in its margin instead, where there is no wall
        cell = np.clip(np.floor(at), reach, [[cols - 1 - reach], [rows - 1 - reach]])
        self._look(cell.astype(np.intp))
        # shapes (2R + 1, N): the way from the place to the middles of the window's columns and rows
        way_x, way_y = (cell - at).astype(np.float32)[:, None] + self._middles
        near_x, near_y = np.exp(way_x * way_x * self._sharpness), np.exp(way_y * way_y * self._sharpness)
        # sums over the columns of each row of the window, then over its rows
        in_rows, along_rows = (self._walls * near_x).sum(axis=1), (self._walls * (near_x * way_x)).sum(axis=1)
        along_rows *= near_y
        in_rows *= near_y
        return np.stack([in_rows.sum(axis=0), along_rows.sum(axis=0), (in_rows * way_y).sum(axis=0)])

    def _look(self, cell: NDArray[np.intp]) -> None:
        """Look at the walls again around points that have come to another cell: after the first step, few have."""
        moved = np.flatnonzero((cell != self._cell).any(axis=0))
        cols = self._target.classes.shape[1]
        window = (self._around[:, None] * cols + self._around)[:, :, None] + (cell[1, moved] * cols + cell[0, moved])
        self._walls[:, :, moved] = self._target.classes.ravel().take(window) == CELL_OCCUPIED
        self._cell = cell


def _motion(sums: NDArray[np.float64], turn: complex, resolution_m: float) -> tuple[complex, complex]:
    """Return how far the middle of the points moves, and the turn about it, that best follow the pulls (closed form).

    Parameters
    ----------
    sums
        Of the weight and of the pulls in x and y, in cells, each times `_powers` of the points: shape (3, 4).
    turn
        The points' scale times their turn, as a complex number.
    resolution_m
        Side of a cell.
    """
    (total, arm_x, arm_y, square), (along_x, xx, yx, _), (along_y, xy, yy, _) = sums.tolist()
    arm = complex(arm_x, arm_y) / total
    error = resolution_m * complex(along_x, along_y) / total
    # of points about their weighted middle, turned as they are
    pull = resolution_m * complex(xx + yy, xy - yx) / total
    spread = abs(turn) ** 2 * (square / total - abs(arm) ** 2)
    factor = spread + turn.conjugate() * (pull - arm.conjugate() * error)
    factor /= abs(factor) or 1.0
    return turn * arm + error - factor * turn * arm, factor
