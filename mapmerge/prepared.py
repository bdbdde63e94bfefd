"""What a map is turned into before it is matched: walls as points, the nearest wall of each place, free space.

All of it is in the frame of the map's grid, cropped to what is known: metres from the outer corner of its first cell.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapmerge.grid import Grid, cell_centres_m
from mapmerge.sim2 import Points

CELL_UNKNOWN, CELL_FREE, CELL_OCCUPIED, CELL_UNSURE = 0, 1, 2, 3
MEETS_FREE, MEETS_WALL, MEETS_NEAR = 1, 2, 4

_BAND_ROWS = 512


@dataclass(frozen=True, slots=True, eq=False)
class NearestWalls:
    """Which wall is nearest to a place, as a look-up.

    Parameters
    ----------
    index
        Shape (rows, columns): for each cell the number of the wall that is nearest; 0, which is no wall's, if none is
        within reach.
    x_m, y_m
        Where these walls are, shape (S,) each, in the order of their numbers. Number 0 is far from everything.
    directed
        Returns `directions`; called when they are needed, as only searches do.
    cell_m
        Side of a cell: `PreparedMap.wall_spacing_m`, so that each cell holds at most one of these walls.
    corner_m
        Outer corner of the first cell. The cells reach so far around the map that no wall is near beyond them.
    """

    index: NDArray[np.int32]
    x_m: NDArray[np.float32]
    y_m: NDArray[np.float32]
    directed: Callable[[], NDArray[np.float32]]
    cell_m: float
    corner_m: tuple[float, float]

    @property
    def directions(self) -> NDArray[np.float32]:
        """Which way these walls run, shape (S, 2), see `PreparedMap.directions`."""
        return self.directed()

    def wall_at(self, x_m: NDArray[np.float32], y_m: NDArray[np.float32]) -> NDArray[np.int32]:
        """Return the number of the nearest wall for places of any shape."""
        rows, cols = self.index.shape
        inverse = np.float32(1.0 / self.cell_m)
        first_col, first_row = (np.float32(-corner_m / self.cell_m) for corner_m in self.corner_m)
        col = (x_m * inverse + first_col).clip(0, cols - 1).astype(np.int32)
        row = (y_m * inverse + first_row).clip(0, rows - 1).astype(np.int32)
        row *= np.int32(cols)
        row += col
        return self.index.ravel().take(row)

    def distance_m(
        self, wall: NDArray[np.int32], x_m: NDArray[np.float32], y_m: NDArray[np.float32]
    ) -> NDArray[np.float32]:
        """Return how far places are from the walls of these numbers, each from one."""
        away_x, away_y = self.x_m.take(wall) - x_m, self.y_m.take(wall) - y_m
        return np.asarray(np.sqrt(away_x * away_x + away_y * away_y), np.float32)


@dataclass(frozen=True, slots=True, eq=False)
class PreparedMap:
    """One map, ready to be matched.

    The arrays belong to the `mapmerge.prepare.LiveMap` that keeps them up to date; its next update may change them.

    Parameters
    ----------
    grid
        The map at the working resolution, cropped to what is known.
    known_area_m2
        Area of its known cells.
    classes
        Shape (rows, columns), uint8: `CELL_UNKNOWN`, `CELL_FREE`, `CELL_OCCUPIED` or, where known as neither,
        `CELL_UNSURE`; padded by `margin` cells.
    meets
        Shape as `classes`, uint8: what a point there meets, bits `MEETS_FREE`, `MEETS_WALL` and `MEETS_NEAR`.
    nearest
        The nearest of `walls_m` for each place.
    walls_m
        The middles of occupied cells, thinned to one point per `SearchConfig.wall_spacing_m`, shape (M, 2).
    numbers
        The number of each of `walls_m` in `nearest`, shape (M,).
    free_m
        Free space, one point per about `FREE_SPACING_M`, shape (K, 2).
    wall_spacing_m, free_spacing_m
        What one of these points stands for: metres of wall, and the side of a square of free space.
    margin
        Cells of padding on each side.
    """

    grid: Grid
    known_area_m2: float
    classes: NDArray[np.uint8]
    meets: NDArray[np.uint8]
    nearest: NearestWalls
    walls_m: Points
    numbers: NDArray[np.int32]
    free_m: Points
    wall_spacing_m: float
    free_spacing_m: float
    margin: int

    @property
    def resolution_m(self) -> float:
        """Side of a cell."""
        return self.grid.resolution_m

    @property
    def wall_cells_m(self) -> Points:
        """Centres of all occupied cells, row by row, shape (N, 2): found anew each time, as they are rarely needed."""
        parts = []
        for first in range(0, len(self.classes), _BAND_ROWS):
            is_wall = self.classes[first : first + _BAND_ROWS] == CELL_OCCUPIED
            row, col = np.divmod(np.flatnonzero(is_wall), is_wall.shape[1])
            parts.append(cell_centres_m(row + (first - self.margin), col - self.margin, self.resolution_m))
        return np.concatenate(parts)

    @property
    def directions(self) -> NDArray[np.float32]:
        """For each of `walls_m` which way the wall runs, shape (M, 2).

        Cosine and sine of twice the angle; shorter than 1 where the wall is no straight line.
        """
        return self.nearest.directions[self.numbers]

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
