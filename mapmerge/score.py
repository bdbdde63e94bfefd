"""What many candidate placements are ranked by: walls and free space that agree or contradict, in both directions."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmerge.align import Poses, evenly, inverses, placed
from mapmerge.config import VerifyConfig
from mapmerge.prepared import MEETS_FREE, MEETS_NEAR, MEETS_WALL, PreparedMap
from mapmerge.sim2 import Points

Lengths = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Probe:
    """Points of a map that are looked up in another.

    Parameters
    ----------
    walls_m, free_m
        Points on walls and in free space, in the map's grid frame, shapes (N, 2) and (K, 2).
    wall_m, free_m2
        Length of wall and area of free space that one of them stands for.
    """

    walls_m: Points
    free_m: Points
    wall_m: float
    free_m2: float


@dataclass(frozen=True, slots=True, eq=False)
class Tally:
    """What one map's walls meet in the other, for each of C placements, in metres of wall: shape (C,) each.

    Parameters
    ----------
    matched_m
        On a wall.
    near_m
        In free space, off the walls, but not far.
    far_m
        Amid free space: a contradiction.
    """

    matched_m: Lengths
    near_m: Lengths
    far_m: Lengths

    @property
    def violated_m(self) -> Lengths:
        """In free space, near walls or far from them."""
        return self.near_m + self.far_m

    @property
    def share(self) -> Lengths:
        """Matched share of the walls that the other map can judge; 0 if there are none."""
        judged = self.matched_m + self.violated_m
        return np.where(judged > 0, self.matched_m / np.maximum(judged, 1e-12), 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class Agreement:
    """Both directions, and the free space that agrees, for each of C placements."""

    ahead: Tally
    back: Tally
    free_m2: Lengths

    def score_m(self, config: VerifyConfig) -> Lengths:
        """Return what placements are ranked by, see `VerifyConfig.violation_weight`."""
        matched_m = (self.ahead.matched_m + self.back.matched_m) / 2
        violated_m = (self.ahead.violated_m + self.back.violated_m) / 2
        return matched_m - config.violation_weight * violated_m + config.free_weight * self.free_m2


def far_share(ahead: Tally, back: Tally) -> float:
    """Return the share of the walls of both directions, at the first placement, that are far from the other's walls."""
    far_m = float(ahead.far_m[0] + back.far_m[0])
    judged_m = sum(float(tally.matched_m[0] + tally.violated_m[0]) for tally in (ahead, back))
    return far_m / judged_m if judged_m > 0 else 0.0


def probe(prepared: PreparedMap, most_walls: int, most_free: int) -> Probe:
    """Return at most so many points of a map, evenly spread."""
    walls_m, free_m = evenly(prepared.walls_m, most_walls), evenly(prepared.free_m, most_free)
    return Probe(
        walls_m,
        free_m,
        prepared.wall_spacing_m * len(prepared.walls_m) / max(len(walls_m), 1),
        prepared.free_spacing_m**2 * len(prepared.free_m) / max(len(free_m), 1),
    )


def agreement(target: PreparedMap, source: PreparedMap, poses: Poses, ahead: Probe, back: Probe) -> Agreement:
    """Return how well two maps agree at each placement.

    Parameters
    ----------
    target, source
        The maps.
    poses
        ``target_from_source`` between the grid frames, shape (C, 4).
    ahead, back
        Points of the source and of the target.
    """
    inverse = inverses(poses)
    return Agreement(
        tally(_met(target, poses, ahead.walls_m), ahead.wall_m * poses[:, 3]),
        tally(_met(source, inverse, back.walls_m), back.wall_m),
        _count(_met(target, poses, ahead.free_m), MEETS_FREE, MEETS_FREE) * ahead.free_m2 * poses[:, 3] ** 2,
    )


def met_at(prepared: PreparedMap, x_m: NDArray[np.float32], y_m: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return `PreparedMap.meets` at places in the map's grid frame, shape (N,), as one row, shape (1, N)."""
    inverse, margin = np.float32(1.0 / prepared.resolution_m), np.float32(prepared.margin)
    return _looked_up(prepared, x_m[None] * inverse + margin, y_m[None] * inverse + margin)


def _met(prepared: PreparedMap, poses: Poses, points_m: Points) -> NDArray[np.uint8]:
    """Return `PreparedMap.meets` at points placed on the map, shape (C, N)."""
    return _looked_up(prepared, *placed(poses, points_m, prepared.resolution_m, prepared.margin))


def _looked_up(prepared: PreparedMap, col: NDArray[np.float32], row: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return `PreparedMap.meets` at places in cells, which are overwritten."""
    rows, cols = prepared.meets.shape
    cell = row.clip(0, rows - 1, out=row).astype(np.int32)
    cell *= np.int32(cols)
    cell += col.clip(0, cols - 1, out=col).astype(np.int32)
    # no cell is outside: looking for such ones would take a quarter of the time
    return prepared.meets.ravel().take(cell, mode="wrap")


def tally(met: NDArray[np.uint8], wall_m: float | Lengths) -> Tally:
    """Return what walls met, of `PreparedMap.meets` at each, shape (C, N), each for so much wall."""

    def length_m(mask: int, value: int) -> Lengths:
        return np.asarray(_count(met, mask, value) * wall_m, np.float64)

    return Tally(
        matched_m=length_m(MEETS_WALL, MEETS_WALL),
        near_m=length_m(MEETS_FREE | MEETS_NEAR | MEETS_WALL, MEETS_FREE | MEETS_NEAR),
        far_m=length_m(MEETS_FREE | MEETS_NEAR | MEETS_WALL, MEETS_FREE),
    )


def _count(met: NDArray[np.uint8], mask: int, value: int) -> NDArray[np.int32]:
    """Return how many in each row of `PreparedMap.meets`, shape (C, N), have this value in the bits of the mask."""
    if met.size == 0:
        return np.zeros(len(met), np.int32)
    found = ((met & np.uint8(mask)) == np.uint8(value)).view(np.uint8)
    return np.asarray(cv2.reduce(found, 1, cv2.REDUCE_SUM, dtype=cv2.CV_32S), np.int32).ravel()
