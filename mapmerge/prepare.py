"""What a map is turned into before it is matched: walls as points, distance to the nearest wall, free space.

All of it is in the frame of the map's grid, cropped to what is known: metres from the outer corner of its first cell.
"""

from __future__ import annotations

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

CELL_UNKNOWN, CELL_FREE, CELL_OCCUPIED = 0, 1, 2


@dataclass(frozen=True, slots=True, eq=False)
class PreparedMap:
    """One map, ready to be matched.

    Parameters
    ----------
    grid
        The map at the working resolution, cropped to what is known.
    classes
        Shape (rows, columns), uint8: `CELL_UNKNOWN`, `CELL_FREE` or `CELL_OCCUPIED`; padded by `margin` cells.
    wall_distance_m
        Shape as `classes`: distance of each cell to the nearest occupied one.
    nearest_wall, nearest_wall_too
        Shape as `classes`: row of `wall_cells_m` that is nearest. Where several are, these are one from each end of
        the map, so that their mean prefers no direction.
    wall_cells_m
        Centres of all occupied cells, shape (N, 2).
    walls_m
        The same thinned to one point per `SearchConfig.wall_spacing_m`, shape (M, 2).
    free_m
        Free space, one point per about `FREE_SPACING_M`, shape (K, 2).
    wall_spacing_m, free_spacing_m
        What one of these points stands for: metres of wall, and the side of a square of free space.
    margin
        Cells of padding on each side.
    """

    grid: Grid
    classes: NDArray[np.uint8]
    wall_distance_m: NDArray[np.float32]
    nearest_wall: NDArray[np.int32]
    nearest_wall_too: NDArray[np.int32]
    wall_cells_m: Points
    walls_m: Points
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
    # a point outside of the map is looked up in a corner of the margin, which must be beyond the reach of ICP
    margin = int(np.ceil(max(_MARGIN_M, *config.refine.reject_m) / resolution_m)) + 1
    occupied = np.pad(cropped.cells >= config.cells.min_occupied_percent, margin)
    free = np.pad((cropped.cells >= 0) & (cropped.cells <= config.cells.max_free_percent), margin)
    classes = np.where(occupied, CELL_OCCUPIED, np.where(free, CELL_FREE, CELL_UNKNOWN)).astype(np.uint8)
    distance_m, nearest = _distance_to_walls(occupied, resolution_m)
    _, turned = _distance_to_walls(occupied[::-1, ::-1], resolution_m)
    wall_cells_m = _centres(occupied, margin, resolution_m)
    step = max(1, round(FREE_SPACING_M / resolution_m))
    return PreparedMap(
        grid=cropped,
        classes=classes,
        wall_distance_m=distance_m,
        nearest_wall=nearest,
        nearest_wall_too=np.ascontiguousarray(max(len(wall_cells_m) - 1, 0) - turned[::-1, ::-1]),
        wall_cells_m=wall_cells_m,
        walls_m=thinned(wall_cells_m, config.search.wall_spacing_m),
        free_m=_sampled(free, margin, resolution_m, step),
        wall_spacing_m=max(config.search.wall_spacing_m, resolution_m),
        free_spacing_m=step * resolution_m,
        margin=margin,
    )


def thinned(points_m: Points, spacing_m: float) -> Points:
    """Return the mean point of each occupied square of this side, in a fixed order."""
    if len(points_m) == 0:
        return points_m
    square = np.floor(points_m / spacing_m + 1e-9).astype(np.int64)
    square -= square.min(axis=0)
    key = square[:, 1] * (int(square[:, 0].max()) + 1) + square[:, 0]
    _, member, count = np.unique(key, return_inverse=True, return_counts=True)
    sums = [np.bincount(member, weights=points_m[:, axis], minlength=len(count)) for axis in (0, 1)]
    means: Points = np.stack(sums, axis=1) / count[:, None]
    return means


def _centres(mask: Mask, margin: int, resolution_m: float) -> Points:
    rows, cols = np.nonzero(mask)
    return cell_centres_m(rows - margin, cols - margin, resolution_m)


def _sampled(free: Mask, margin: int, resolution_m: float, step: int) -> Points:
    """Return the centre of every so many cells, along both axes, that is free."""
    rows, cols = np.nonzero(free[step // 2 :: step, step // 2 :: step])
    first = step // 2 - margin
    return cell_centres_m(rows * step + first, cols * step + first, resolution_m)


def _distance_to_walls(occupied: Mask, resolution_m: float) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Distance in metres and index of the nearest occupied cell, in the order of `np.nonzero`."""
    if not occupied.any():
        shape = occupied.shape
        return np.full(shape, np.float32(np.inf), np.float32), np.zeros(shape, np.int32)
    distance, labels = cv2.distanceTransformWithLabels(
        np.where(occupied, 0, 255).astype(np.uint8),
        cv2.DIST_L2,
        cv2.DIST_MASK_5,
        labelType=cv2.DIST_LABEL_PIXEL,
    )
    rank = np.zeros(int(labels.max()) + 1, np.int32)
    rank[labels[occupied]] = np.arange(int(np.count_nonzero(occupied)), dtype=np.int32)
    return np.asarray(distance, np.float32) * np.float32(resolution_m), rank[labels]
