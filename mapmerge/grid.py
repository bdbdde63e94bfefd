"""Occupancy grid maps as values."""

from __future__ import annotations

import math
from dataclasses import InitVar, dataclass, field

import numpy as np
from numpy.typing import NDArray

from mapmerge.checks import is_finite, is_number, shown
from mapmerge.errors import GridError
from mapmerge.sim2 import IDENTITY, Points, Sim2

Cells = NDArray[np.int8]
Mask = NDArray[np.bool_]
Counted = NDArray[np.int32]
"""Rows or columns of many cells, in no more bytes than they need."""
Indices = NDArray[np.intp] | NDArray[np.int64] | NDArray[np.int32]

UNKNOWN = -1
UNKNOWN_BYTE = 255
MAX_PERCENT = 100
MAX_SIDE_CELLS = 100_000


def cell_centres_m(rows: Indices, cols: Indices, resolution_m: float) -> Points:
    """Return the centres of cells in the frame of their grid, shape (N, 2), as x and y."""
    centres: Points = np.empty((len(rows), 2), np.float64)
    centres[:, 0], centres[:, 1] = cols, rows
    centres += 0.5
    centres *= resolution_m
    return centres


@dataclass(frozen=True, slots=True, eq=False)
class Grid:
    """One occupancy grid map.

    Parameters
    ----------
    cells
        Shape (rows, columns), int8: probability of being occupied in percent, 0 to 100, or −1 for unknown.
        Row 0 has the lowest y, as in ``nav_msgs/OccupancyGrid``. Copied, unless they are read-only, so that a buffer
        which is written to again changes no grid.
    resolution_m
        Side of a cell.
    map_from_grid
        Pose in the map frame of the outer corner of cell (0, 0), rigid: ``info.origin`` of the message.
    is_own
        Whether the cells are from other grids, or nobody else writes to them: they are neither checked nor copied.

    Raises
    ------
    GridError
        If the shape, a cell's value, the resolution or the origin is not that of a map, or no value of its kind.
    """

    cells: Cells
    resolution_m: float
    map_from_grid: Sim2 = field(default=IDENTITY)
    is_own: InitVar[bool] = False

    def __post_init__(self, is_own: bool) -> None:
        self._check_kinds()
        if self.cells.ndim != 2 or self.cells.dtype != np.int8:
            raise GridError(
                f"cells are {self.cells.dtype} of shape {self.cells.shape}; expected int8 [rows, columns], such as "
                "cells.astype(np.int8)"
            )
        if not (is_finite(self.resolution_m) and self.resolution_m > 0.0):
            raise GridError(f"resolution is {shown(self.resolution_m)} m; expected a positive number")
        if max(self.cells.shape) > MAX_SIDE_CELLS:
            rows, cols = self.cells.shape
            raise GridError(f"the grid has {cols} × {rows} cells; a side of at most {MAX_SIDE_CELLS} is expected")
        if self.cells.size and not is_own:
            self._check_values()
        self._check_pose()
        if self.cells.flags.writeable:
            cells = self.cells.view() if is_own else self.cells.copy()
            cells.flags.writeable = False
            object.__setattr__(self, "cells", cells)

    def __repr__(self) -> str:
        """Return its size and place; the cells would fill the screen."""
        return f"<Grid of {self.cols} × {self.rows} cells of {self.resolution_m:g} m, corner at {self.map_from_grid}>"

    def _check_kinds(self) -> None:
        if not isinstance(self.cells, np.ndarray):
            raise GridError(f"cells are {shown(self.cells)}; expected an array of int8 [rows, columns]")
        if not is_number(self.resolution_m):
            raise GridError(f"resolution is {shown(self.resolution_m)}; expected a number of metres")

    def _check_values(self) -> None:
        low, high = self.cells.min(), self.cells.max()
        if low < UNKNOWN or high > MAX_PERCENT:
            raise GridError(f"cells are between {low} and {high}; expected {UNKNOWN} (unknown) or 0 to {MAX_PERCENT}")

    def _check_pose(self) -> None:
        pose = self.map_from_grid
        if not isinstance(pose, Sim2):
            raise GridError(f"the origin is {shown(pose)}; expected Sim2(x_m, y_m, yaw_rad)")
        if not all(map(math.isfinite, (pose.x_m, pose.y_m, pose.yaw_rad))):
            raise GridError(f"the origin is ({pose.x_m}, {pose.y_m}, {pose.yaw_rad}); finite numbers are expected")
        if pose.scale != 1.0:
            raise GridError(f"the origin has scale {pose.scale}; a rigid pose is expected")

    @property
    def rows(self) -> int:
        """Number of rows, along y of the grid frame."""
        return int(self.cells.shape[0])

    @property
    def cols(self) -> int:
        """Number of columns, along x of the grid frame."""
        return int(self.cells.shape[1])

    @property
    def known(self) -> Mask:
        """Cells that are known, shape (rows, columns)."""
        return self.cells >= 0

    @property
    def known_area_m2(self) -> float:
        """Area of the known cells."""
        return int(np.count_nonzero(self.cells >= 0)) * self.resolution_m**2

    def covers_as(self, other: Grid) -> bool:
        """Tell whether both grids have the very same cells, whatever these say."""
        return (
            self.resolution_m == other.resolution_m
            and self.map_from_grid == other.map_from_grid
            and self.cells.shape == other.cells.shape
        )

    def same_as(self, other: Grid) -> bool:
        """Tell whether both grids say the same of the same place."""
        return self.covers_as(other) and bool(np.array_equal(self.cells, other.cells))

    def centres_m(self, mask: Mask) -> Points:
        """Return the centres of the chosen cells in the map frame, shape (N, 2), row by row."""
        rows, cols = np.nonzero(mask)
        return self.map_from_grid.apply(cell_centres_m(rows, cols, self.resolution_m))

    @property
    def middle_m(self) -> tuple[float, float]:
        """Middle of the rectangle that holds all known cells, in the map frame."""
        known = self.cropped_to_known()
        return known.map_from_grid.apply_point(known.cols * self.resolution_m / 2, known.rows * self.resolution_m / 2)

    def cropped_to_known(self) -> Grid:
        """Return the smallest part of this grid that holds all its known cells; 0 × 0 if there is none."""
        if self.cells.size and all(edge.max() >= 0 for edge in self._edges()):
            return self
        rows = np.flatnonzero(self.cells.max(axis=1, initial=UNKNOWN) >= 0)
        cols = np.flatnonzero(self.cells.max(axis=0, initial=UNKNOWN) >= 0)
        if rows.size == 0:
            return Grid(self.cells[:0, :0], self.resolution_m, self.map_from_grid)
        row, col = int(rows[0]), int(cols[0])
        corner = Sim2(col * self.resolution_m, row * self.resolution_m)
        cells = self.cells[row : int(rows[-1]) + 1, col : int(cols[-1]) + 1]
        return Grid(cells, self.resolution_m, self.map_from_grid @ corner, is_own=True)

    def _edges(self) -> tuple[Cells, ...]:
        return self.cells[0], self.cells[-1], self.cells[:, 0], self.cells[:, -1]
