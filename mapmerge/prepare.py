"""What a map is turned into before it is matched: walls as points, distance to the nearest wall, free space.

All of it is in the frame of the map's grid, cropped to what is known: metres from the outer corner of its first cell.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmerge.config import MergeConfig
from mapmerge.grid import Grid, Mask, cell_centres_m
from mapmerge.resample import at_resolution
from mapmerge.sim2 import Points

FREE_SPACING_M = 0.25
_MARGIN_M = 1.0
_MARGIN_SLACK_M = 0.1
_DIRECTION_SQUARES = 7

CELL_UNKNOWN, CELL_FREE, CELL_OCCUPIED, CELL_UNSURE = 0, 1, 2, 3
MEETS_FREE, MEETS_WALL, MEETS_NEAR = 1, 2, 4
NO_WALL = 0
_FAR_M = 1e6


@dataclass(frozen=True, slots=True, eq=False)
class NearestWalls:
    """Which wall is nearest to a place, as a look-up.

    Parameters
    ----------
    index
        Shape (rows, columns): for each cell the number of the wall that is nearest; `NO_WALL` if none is within reach.
    x_m, y_m
        Where these walls are, shape (S,) each, in the order of their numbers. `NO_WALL` is far from everything.
    directions
        `PreparedMap.directions` in the order of these numbers, shape (S, 2).
    cell_m
        Side of a cell: `PreparedMap.wall_spacing_m`, so that each cell holds at most one of these walls.
    margin
        Cells of padding on each side: a place beyond is looked up in the padding, out of the reach of ICP.
    """

    index: NDArray[np.int32]
    x_m: NDArray[np.float32]
    y_m: NDArray[np.float32]
    directions: NDArray[np.float32]
    cell_m: float
    margin: int

    def wall_at(self, x_m: NDArray[np.float32], y_m: NDArray[np.float32]) -> NDArray[np.int32]:
        """Return the number of the nearest wall for places of any shape."""
        rows, cols = self.index.shape
        inverse, margin = np.float32(1.0 / self.cell_m), np.float32(self.margin)
        col = np.clip(x_m * inverse + margin, 0, cols - 1).astype(np.int32)
        row = np.clip(y_m * inverse + margin, 0, rows - 1).astype(np.int32)
        found: NDArray[np.int32] = self.index.ravel()[row * cols + col]
        return found

    def distance_m(
        self, wall: NDArray[np.int32], x_m: NDArray[np.float32], y_m: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        """Return how far places are from the walls of these numbers, each from one."""
        return np.asarray(np.hypot(self.x_m[wall] - x_m, self.y_m[wall] - y_m), np.float32)


@dataclass(frozen=True, slots=True, eq=False)
class PreparedMap:
    """One map, ready to be matched.

    Parameters
    ----------
    grid
        The map at the working resolution, cropped to what is known.
    classes
        Shape (rows, columns), uint8: `CELL_UNKNOWN`, `CELL_FREE`, `CELL_OCCUPIED` or, where known as neither,
        `CELL_UNSURE`; padded by `margin` cells.
    meets
        Shape as `classes`, uint8: what a point there meets, bits `MEETS_FREE`, `MEETS_WALL` and `MEETS_NEAR`.
    nearest
        The nearest of `walls_m` for each place.
    wall_cells_m
        Centres of all occupied cells, shape (N, 2).
    walls_m
        The same thinned to one point per `SearchConfig.wall_spacing_m`, shape (M, 2).
    directions
        For each of `walls_m` which way the wall runs, shape (M, 2): cosine and sine of twice the angle, shorter than 1
        where it is no straight line.
    free_m
        Free space, one point per about `FREE_SPACING_M`, shape (K, 2).
    wall_spacing_m, free_spacing_m
        What one of these points stands for: metres of wall, and the side of a square of free space.
    margin
        Cells of padding on each side.
    """

    grid: Grid
    classes: NDArray[np.uint8]
    meets: NDArray[np.uint8]
    nearest: NearestWalls
    wall_cells_m: Points
    walls_m: Points
    directions: NDArray[np.float32]
    free_m: Points
    wall_spacing_m: float
    free_spacing_m: float
    margin: int

    @property
    def resolution_m(self) -> float:
        """Side of a cell."""
        return self.grid.resolution_m

    @property
    def extent_m(self) -> tuple[float, float]:
        """Width and height of what is known."""
        return self.grid.cols * self.resolution_m, self.grid.rows * self.resolution_m

    def flat_index(self, points_m: Points) -> NDArray[np.intp]:
        """Return the index into the raveled padded arrays of the cell at each point.

        Points outside get index 0, a corner of the padding: unknown and far from any wall.
        """
        rows, cols = self.classes.shape
        col = np.floor(points_m[:, 0] / self.resolution_m).astype(np.intp) + self.margin
        row = np.floor(points_m[:, 1] / self.resolution_m).astype(np.intp) + self.margin
        inside = (col >= 0) & (col < cols) & (row >= 0) & (row < rows)
        return np.where(inside, row * cols + col, 0)


def prepare(grid: Grid, resolution_m: float, config: MergeConfig) -> PreparedMap:
    """Prepare a map for matching at a resolution that is not finer than its own."""
    cropped = at_resolution(grid.cropped_to_known(), resolution_m, config.cells)
    reach_m = max(_MARGIN_M, *config.refine.rough_reject_m, *config.refine.reject_m) + _MARGIN_SLACK_M
    margin = math.ceil(reach_m / resolution_m) + 1
    classes = np.pad(_classes_of(cropped.cells, config), margin, constant_values=CELL_UNKNOWN)
    occupied = classes == CELL_OCCUPIED
    distance_m = _distance_to_walls_m(occupied, resolution_m)
    wall_cells_m = _centres(occupied, margin, resolution_m)
    spacing_m = max(config.search.wall_spacing_m, resolution_m)
    walls_m = thinned(wall_cells_m, spacing_m)
    directions = _directions(walls_m, spacing_m)
    nearest = _nearest(walls_m, directions, spacing_m, reach_m)
    step = max(1, round(FREE_SPACING_M / resolution_m))
    free = classes == CELL_FREE
    tolerance_m = max(config.verify.tolerance_m, resolution_m)
    return PreparedMap(
        grid=cropped,
        classes=classes,
        meets=(
            free.view(np.uint8) * np.uint8(MEETS_FREE)
            + (distance_m <= tolerance_m).view(np.uint8) * np.uint8(MEETS_WALL)
            + (distance_m <= config.verify.near_m).view(np.uint8) * np.uint8(MEETS_NEAR)
        ),
        nearest=nearest,
        wall_cells_m=wall_cells_m,
        walls_m=walls_m,
        directions=directions,
        free_m=_sampled(free, margin, resolution_m, step),
        wall_spacing_m=spacing_m,
        free_spacing_m=step * resolution_m,
        margin=margin,
    )


def thinned(points_m: Points, spacing_m: float) -> Points:
    """Return the mean point of each occupied square of this side, row by row."""
    if len(points_m) == 0:
        return points_m
    square = np.floor(points_m / spacing_m + 1e-9).astype(np.intp)
    square -= square.min(axis=0)
    member = square[:, 1] * (int(square[:, 0].max()) + 1) + square[:, 0]
    count = np.bincount(member)
    key = np.flatnonzero(count)
    sums = [np.bincount(member, weights=points_m[:, axis])[key] for axis in (0, 1)]
    means: Points = np.stack(sums, axis=1) / count[key][:, None]
    return means


def _directions(walls_m: Points, spacing_m: float) -> NDArray[np.float32]:
    """Return which way each wall runs, from the spread of the walls around it."""
    if len(walls_m) == 0:
        return np.zeros((0, 2), np.float32)
    square = np.floor(walls_m / spacing_m + 1e-9).astype(np.intp)
    cols, rows = (square.max(axis=0) + 1).tolist()
    centre_m = walls_m.mean(axis=0)
    x, y = (walls_m - centre_m).T
    moments = np.zeros((6, rows, cols))
    moments[:, square[:, 1], square[:, 0]] = (np.ones_like(x), x, y, x * x, y * y, x * y)
    size = (_DIRECTION_SQUARES, _DIRECTION_SQUARES)
    around = [
        cv2.boxFilter(image, cv2.CV_64F, size, normalize=False, borderType=cv2.BORDER_CONSTANT) for image in moments
    ]
    count, sum_x, sum_y, sum_xx, sum_yy, sum_xy = (image[square[:, 1], square[:, 0]] for image in around)
    xx, yy, xy = sum_xx - sum_x**2 / count, sum_yy - sum_y**2 / count, sum_xy - sum_x * sum_y / count
    total = np.maximum(xx + yy, 1e-9)
    return np.stack([(xx - yy) / total, 2 * xy / total], axis=1).astype(np.float32)


def _classes_of(cells: NDArray[np.int8], config: MergeConfig) -> NDArray[np.uint8]:
    value = np.arange(256, dtype=np.uint8).view(np.int8)
    known = np.where(value <= config.cells.max_free_percent, CELL_FREE, CELL_UNSURE)
    table = np.where(
        value < 0, CELL_UNKNOWN, np.where(value >= config.cells.min_occupied_percent, CELL_OCCUPIED, known)
    )
    return table.astype(np.uint8)[np.ascontiguousarray(cells).view(np.uint8)]


def _nearest(walls_m: Points, directions: NDArray[np.float32], spacing_m: float, reach_m: float) -> NearestWalls:
    """Return the nearest wall for each square of the side by which walls are thinned, if it is within reach."""
    margin = math.ceil(reach_m / spacing_m) + 1
    x_m, y_m = np.vstack([(_FAR_M, _FAR_M), walls_m]).astype(np.float32).T
    numbered = np.vstack([np.zeros((1, 2), np.float32), directions])
    if len(walls_m) == 0:
        return NearestWalls(np.zeros((1, 1), np.int32), x_m, y_m, numbered, spacing_m, margin)
    square = np.floor(walls_m / spacing_m + 1e-9).astype(np.intp) + margin
    cols, rows = (square.max(axis=0) + margin + 1).tolist()
    is_empty = np.full((rows, cols), 255, np.uint8)
    is_empty[square[:, 1], square[:, 0]] = 0
    distance, labels = cv2.distanceTransformWithLabels(
        is_empty, cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    number_of = np.zeros(len(walls_m) + 1, np.int32)
    number_of[labels[square[:, 1], square[:, 0]]] = np.arange(1, len(walls_m) + 1, dtype=np.int32)
    index = np.where(distance <= reach_m / spacing_m, number_of[labels], np.int32(NO_WALL))
    return NearestWalls(index, x_m, y_m, numbered, spacing_m, margin)


def _centres(mask: Mask, margin: int, resolution_m: float) -> Points:
    rows, cols = np.nonzero(mask)
    return cell_centres_m(rows - margin, cols - margin, resolution_m)


def _sampled(free: Mask, margin: int, resolution_m: float, step: int) -> Points:
    """Return the centre of every so many cells, along both axes, that is free."""
    rows, cols = np.nonzero(free[step // 2 :: step, step // 2 :: step])
    first = step // 2 - margin
    return cell_centres_m(rows * step + first, cols * step + first, resolution_m)


def _distance_to_walls_m(occupied: Mask, resolution_m: float) -> NDArray[np.float32]:
    if not occupied.any():
        return np.full(occupied.shape, np.float32(np.inf), np.float32)
    free = np.where(occupied, np.uint8(0), np.uint8(255))
    distance = cv2.distanceTransform(free, cv2.DIST_L2, cv2.DIST_MASK_5)
    return np.asarray(distance, np.float32) * np.float32(resolution_m)
