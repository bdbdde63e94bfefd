"""Maps bent as by a SLAM's drift, with the rigid truth that fits them best."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmerge.grid import Grid
from mapmerge.sim2 import Points, Sim2
from samples.mission import known_at
from samples.pairs import Pair
from samples.world import Rng

BENT_SHARE = 0.35
MOST_M = 0.7
_LENGTH_M = (4.0, 12.0)
_MOST_POINTS = 4000


@dataclass(frozen=True, slots=True, eq=False)
class Bend:
    """A smooth field of shifts over a grid, in cells: what stands at a cell was seen at the cell less the shift."""

    col: NDArray[np.float32]
    row: NDArray[np.float32]

    def of(self, grid: Grid) -> Grid:
        """Return the bent map."""
        rows, cols = grid.cells.shape
        at_row, at_col = np.mgrid[0:rows, 0:cols].astype(np.float32)
        image = grid.cells.view(np.uint8)
        unknown = int(np.int8(-1).view(np.uint8))
        moved = cv2.remap(
            image,
            at_col - self.col,
            at_row - self.row,
            cv2.INTER_NEAREST,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=unknown,
        )
        return Grid(np.ascontiguousarray(moved).view(np.int8), grid.resolution_m, grid.map_from_grid)

    def moved(self, points_m: Points, grid: Grid) -> Points:
        """Return where points of the map frame are in the bent map."""
        in_cells = grid.map_from_grid.inverse().apply(points_m) / grid.resolution_m
        index = np.clip(in_cells.astype(np.intp), 0, (grid.cols - 1, grid.rows - 1))
        shift = np.stack([self.col[index[:, 1], index[:, 0]], self.row[index[:, 1], index[:, 0]]], axis=1)
        return grid.map_from_grid.apply((in_cells + shift) * grid.resolution_m)


def random_bend(grid: Grid, most_m: float, rng: Rng) -> Bend:
    """Return a random field whose shifts have about half of this standard deviation, along each axis."""
    length_cells = float(rng.uniform(*_LENGTH_M)) / grid.resolution_m
    coarse = tuple(max(3, math.ceil(side / length_cells) + 2) for side in grid.cells.shape)
    parts = []
    for _ in range(2):
        knots = rng.normal(0.0, 0.5 * most_m / grid.resolution_m, coarse).astype(np.float32)
        parts.append(np.asarray(cv2.resize(knots, grid.cells.shape[::-1], interpolation=cv2.INTER_CUBIC), np.float32))
    return Bend(parts[0], parts[1])


def bent(pair: Pair, rng: Rng) -> Pair:
    """Return the pair with both maps bent by the same law, and the truth that fits the bent maps best."""
    most_m = float(rng.uniform(0.1, MOST_M))
    bends = [random_bend(grid, most_m, rng) for grid in (pair.target, pair.source)]
    target, source = (bend.of(grid) for bend, grid in zip(bends, (pair.target, pair.source), strict=True))
    name = f"{pair.name} bent"
    if pair.truth is None:
        return replace(pair, name=name, target=target, source=source)
    points_m = pair.source.centres_m(pair.source.known)
    points_m = points_m[known_at(pair.target, pair.truth.apply(points_m))]
    points_m = points_m[:: max(1, len(points_m) // _MOST_POINTS)]
    seen_m = bends[1].moved(points_m, pair.source)
    truth = _rigid(bends[0].moved(pair.truth.apply(points_m), pair.target), seen_m)
    x_m, y_m = seen_m.mean(axis=0).tolist()
    return replace(pair, name=name, target=target, source=source, truth=truth, centre_m=(x_m, y_m))


def _rigid(target_m: Points, source_m: Points) -> Sim2:
    """Return the rigid transform of least squares between matched points."""
    here, there = source_m - source_m.mean(axis=0), target_m - target_m.mean(axis=0)
    cross = float((here[:, 0] * there[:, 1] - here[:, 1] * there[:, 0]).sum())
    turn = Sim2(yaw_rad=math.atan2(cross, float((here * there).sum())))
    shift = target_m.mean(axis=0) - turn.apply(source_m.mean(axis=0)[None])[0]
    return Sim2(float(shift[0]), float(shift[1]), turn.yaw_rad)
