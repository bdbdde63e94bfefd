"""How well two maps agree if they may bend a little: drift bends maps, so that no rigid placement fits all of one.

A smooth field of shifts is found for one placement, which moves the source's walls on the target's: a non-rigid ICP
along the walls' normals. Drift bends a map by decimetres over many metres, which the field follows; walls that one of
two look-alike places lacks are not mended by it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmerge.align import evenly, placed, poses_of
from mapmerge.config import SlackConfig
from mapmerge.prepared import PreparedMap
from mapmerge.score import Tally, far_share, met_at, tally
from mapmerge.sim2 import Points, Sim2

Floats = NDArray[np.float32]

_ENOUGH_WALLS = 5_000
_MOST_SQUARES = 2_048
"""Of the field, a side: in a map of more than 1 km its squares are larger, so that memory is bounded."""


@dataclass(frozen=True, slots=True, eq=False)
class Slack:
    """Agreement of two maps that may bend.

    Parameters
    ----------
    ahead, back
        What the walls of the source, and of the target, meet once they are shifted.
    """

    ahead: Tally
    back: Tally

    @property
    def share(self) -> float:
        """Share of the walls that agree, in the worse direction."""
        return float(min(self.ahead.share[0], self.back.share[0]))

    @property
    def contradicted_m(self) -> float:
        """Length of the walls in the other map's free space, mean of both directions."""
        return float(self.ahead.violated_m[0] + self.back.violated_m[0]) / 2

    @property
    def far_share(self) -> float:
        """Share of the walls that stand amid the other map's free space, far from its walls."""
        return far_share(self.ahead, self.back)


@dataclass(frozen=True, slots=True, eq=False)
class _Field:
    """Shifts in the target's grid frame, one for each square."""

    x_m: Floats
    y_m: Floats
    corner_m: tuple[float, float]
    cell_m: float

    def index(self, x_m: Floats, y_m: Floats) -> NDArray[np.intp]:
        rows, cols = self.x_m.shape
        col = ((x_m - self.corner_m[0]) / self.cell_m).astype(np.intp).clip(0, cols - 1)
        row = ((y_m - self.corner_m[1]) / self.cell_m).astype(np.intp).clip(0, rows - 1)
        return np.asarray(row * cols + col, np.intp)

    def at(self, x_m: Floats, y_m: Floats) -> tuple[Floats, Floats]:
        index = self.index(x_m, y_m)
        return self.x_m.ravel().take(index), self.y_m.ravel().take(index)


def slack(target: PreparedMap, source: PreparedMap, target_from_source: Sim2, config: SlackConfig) -> Slack:
    """Return how well two maps agree at a placement between their grid frames if both may bend a little."""
    (walls_m, wall_m), (others_m, other_m) = _sample(source), _sample(target)
    wall_m *= target_from_source.scale
    x, y = (values[0] for values in placed(poses_of([target_from_source]), walls_m))
    field = _bent(target, x, y, wall_m, config)
    shift_x, shift_y = field.at(x, y)
    ahead = tally(met_at(target, x + shift_x, y + shift_y), wall_m)
    wall_x, wall_y = others_m.astype(np.float32).T
    back_x, back_y = field.at(wall_x, wall_y)
    unbent = np.stack([wall_x - back_x, wall_y - back_y], axis=1).astype(np.float64)
    in_source = target_from_source.inverse().apply(unbent).astype(np.float32)
    back = tally(met_at(source, in_source[:, 0], in_source[:, 1]), other_m)
    return Slack(ahead, back)


def _sample(prepared: PreparedMap) -> tuple[Points, float]:
    """Return the walls of a map, of very many some that are evenly spread, and how much wall one stands for."""
    walls_m = evenly(prepared.walls_m, _ENOUGH_WALLS)
    return walls_m, prepared.wall_spacing_m * len(prepared.walls_m) / max(1, len(walls_m))


def _bent(target: PreparedMap, x: Floats, y: Floats, spacing_m: float, config: SlackConfig) -> _Field:
    """Return the smooth field of shifts that brings walls at these places, each so long, on the target's."""
    corner = float(x.min()), float(y.min())
    sides_m = float(x.max()) - corner[0], float(y.max()) - corner[1]
    cell_m = max(config.cell_m, max(sides_m) / _MOST_SQUARES)
    cols, rows = (int(side_m / cell_m) + 1 for side_m in sides_m)
    still = np.zeros((rows, cols), np.float32)
    field = _Field(still, still, corner, cell_m)
    index = field.index(x, y)
    nearest = target.nearest
    for reach_m in config.reject_m:
        shift_x, shift_y = field.at(x, y)
        at_x, at_y = x + shift_x, y + shift_y
        wall = nearest.wall_at(at_x, at_y)
        error_x, error_y = nearest.x_m.take(wall) - at_x, nearest.y_m.take(wall) - at_y
        square = np.square(error_x) + np.square(error_y)
        near = np.flatnonzero(square <= reach_m**2)
        error_x, error_y, square = error_x.take(near), error_y.take(near), square.take(near)
        weight = spacing_m / (1.0 + square / (0.35 * reach_m) ** 2)
        # of a straight wall only the shift across it is known: n nᵀ for its normal n
        cos, sin = nearest.directions.take(wall.take(near), axis=0).T
        xx, xy, yy = 0.5 * weight * (1.0 - cos), -0.5 * weight * sin, 0.5 * weight * (1.0 + cos)
        asked = np.stack([xx, xy, yy, xx * error_x + xy * error_y, xy * error_x + yy * error_y], axis=1)
        step_x, step_y = _solved(
            _spread(_summed(asked, index.take(near), (rows, cols)), config.length_m / cell_m), config.stiffness_m
        )
        field = _limited(field, step_x, step_y, config.most_m)
    return field


def _summed(values: Floats, square: NDArray[np.intp], shape: tuple[int, int]) -> Floats:
    """Return the sums of values, shape (N, K), over what lies in each square, shape (rows, columns, K)."""
    kinds = values.shape[1]
    bins = (square * kinds)[:, None] + np.arange(kinds)
    sums = np.bincount(bins.ravel(), values.ravel(), math.prod(shape) * kinds)
    return sums.astype(np.float32).reshape(*shape, kinds)


def _spread(values: Floats, sigma: float) -> Floats:
    """Return sums over the squares around each, near ones counting more."""
    blurred = cv2.GaussianBlur(values, (0, 0), sigma, borderType=cv2.BORDER_CONSTANT)
    return np.asarray(blurred * np.float32(2 * np.pi * sigma**2), np.float32)


def _solved(sums: Floats, stiffness_m: float) -> tuple[Floats, Floats]:
    """Solve the normal equations of each square for one step, damped where there is little wall."""
    xx, xy, yy, right_x, right_y = sums.transpose(2, 0, 1)
    xx, yy = xx + np.float32(stiffness_m), yy + np.float32(stiffness_m)
    determinant = xx * yy - xy * xy
    step_x, step_y = (yy * right_x - xy * right_y) / determinant, (xx * right_y - xy * right_x) / determinant
    return step_x.astype(np.float32), step_y.astype(np.float32)


def _limited(field: _Field, step_x: Floats, step_y: Floats, most_m: float) -> _Field:
    x, y = field.x_m + step_x, field.y_m + step_y
    factor = np.minimum(1.0, most_m / np.maximum(np.hypot(x, y), 1e-9)).astype(np.float32)
    return _Field(x * factor, y * factor, field.corner_m, field.cell_m)
