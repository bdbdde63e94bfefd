"""The second alignment: ICP on the occupied cells of the original maps (equations 23 and 24)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmerge.sim2 import Points, Sim2

_MARGIN_M = 1.0
_MIN_PAIRS = 12
_STILL_M = 1e-4
_STILL_RAD = 1e-5


@dataclass(frozen=True, slots=True, eq=False)
class OccupiedCells:
    """The occupied cells Q_occ of a map, and for each place the nearest of them.

    Parameters
    ----------
    cells_m
        Their centres in the frame of the map's grid, shape (N, 2).
    nearest, nearest_too
        Shape (rows, columns): row of `cells_m` that is nearest. Where several are, these are one from each end of the
        map, so that their mean prefers no direction.
    cell_m
        Side of a cell.
    low
        Column and row, in the grid, of the first cell of `nearest`.
    """

    cells_m: Points
    nearest: NDArray[np.int32]
    nearest_too: NDArray[np.int32]
    cell_m: float
    low: tuple[int, int]

    def nearest_to(self, points_m: Points) -> Points:
        """Return the occupied cell that is nearest to each point; for one beyond the map, to the border next to it."""
        rows, cols = self.nearest.shape
        cell = np.floor(points_m / self.cell_m).astype(np.intp) - self.low
        index = np.clip(cell[:, 1], 0, rows - 1) * cols + np.clip(cell[:, 0], 0, cols - 1)
        one, other = self.nearest.ravel()[index], self.nearest_too.ravel()[index]
        middle: Points = 0.5 * (self.cells_m[one] + self.cells_m[other])
        return middle


def occupied_cells(cells_m: Points, cell_m: float) -> OccupiedCells:
    """Return the look-up of a map's occupied cells, given as their centres, row by row."""
    if len(cells_m) == 0:
        nothing = np.zeros((1, 1), np.int32)
        return OccupiedCells(cells_m, nothing, nothing, cell_m, (0, 0))
    margin = math.ceil(_MARGIN_M / cell_m)
    cell = np.floor(cells_m / cell_m).astype(np.intp)
    low = cell.min(axis=0) - margin
    cols, rows = (cell.max(axis=0) + margin + 1 - low).tolist()
    occupied = np.zeros((rows, cols), np.bool_)
    occupied[cell[:, 1] - low[1], cell[:, 0] - low[0]] = True
    turned = _nearest(occupied[::-1, ::-1])[::-1, ::-1]
    too = np.ascontiguousarray(len(cells_m) - 1 - turned)
    return OccupiedCells(cells_m, _nearest(occupied), too, cell_m, (int(low[0]), int(low[1])))


def _nearest(occupied: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Return for each cell the number of the nearest occupied one, in the order of `np.nonzero`."""
    _, labels = cv2.distanceTransformWithLabels(
        np.where(occupied, 0, 255).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    rank = np.zeros(int(labels.max()) + 1, np.int32)
    rank[labels[occupied]] = np.arange(int(np.count_nonzero(occupied)), dtype=np.int32)
    nearest: NDArray[np.int32] = rank[labels]
    return nearest


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
    target: OccupiedCells,
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
        The occupied cells Q_occ of the map that stays.
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
    if len(target.cells_m) == 0 or len(occupied_m) == 0:
        return pose
    for limit_m in reject_m:
        for _ in range(iterations):
            points_m = pose.apply(occupied_m)  # equation 23
            nearest_m = target.nearest_to(points_m)
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
