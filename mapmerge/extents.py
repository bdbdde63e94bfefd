"""How large the merged map would be: told from the corners of the maps, before anything is fused."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from mapmerge.grid import MAX_SIDE_CELLS, Grid
from mapmerge.sim2 import Sim2


@dataclass(frozen=True, slots=True)
class Extent:
    """A rectangle along the axes of a frame, in metres, and the smallest cells of what lies in it."""

    left_m: float
    bottom_m: float
    right_m: float
    top_m: float
    cell_m: float

    @staticmethod
    def of(grid: Grid, frame_from_map: Sim2) -> Extent:
        """Return that of a map which is cropped to what it knows."""
        frame_from_grid = frame_from_map @ grid.map_from_grid
        width_m, height_m = grid.cols * grid.resolution_m, grid.rows * grid.resolution_m
        corners = [frame_from_grid.apply_point(x_m, y_m) for x_m in (0.0, width_m) for y_m in (0.0, height_m)]
        xs, ys = [x_m for x_m, _ in corners], [y_m for _, y_m in corners]
        return Extent(min(xs), min(ys), max(xs), max(ys), grid.resolution_m * frame_from_map.scale)

    def union(self, other: Extent) -> Extent:
        """Return the smallest that holds both."""
        return Extent(
            min(self.left_m, other.left_m),
            min(self.bottom_m, other.bottom_m),
            max(self.right_m, other.right_m),
            max(self.top_m, other.top_m),
            min(self.cell_m, other.cell_m),
        )

    @property
    def sides_cells(self) -> tuple[int, int]:
        """Columns and rows of the smallest cells."""
        return (
            math.ceil((self.right_m - self.left_m) / self.cell_m),
            math.ceil((self.top_m - self.bottom_m) / self.cell_m),
        )

    def fits(self, max_cells: int) -> bool:
        """Tell whether a merged map that covers it has so many cells at most, and no side too many."""
        cols, rows = self.sides_cells
        return cols * rows <= max_cells and max(cols, rows) <= MAX_SIDE_CELLS


def first_too_large(
    grids: Mapping[str, Grid], placed: Sequence[tuple[str, Sim2]], max_cells: int
) -> tuple[str, Extent] | None:
    """Return the first of some placed maps with which their merged map is too large, and how large; None if it is not.

    The first map alone is not too large, whatever its size: its cells are really there. The maps are merged on the
    cells of the first of them, or on those of the largest; these are taken to be as small as those of any.
    """
    poses = dict(placed)
    first = placed[0][0]
    largest = max(poses, key=lambda robot: (grids[robot].cells.size * grids[robot].resolution_m ** 2, robot))
    for base in dict.fromkeys((first, largest)):
        base_from_frame = (poses[base] @ grids[base].map_from_grid).inverse()
        found = _first_too_large(grids, [(robot, base_from_frame @ pose) for robot, pose in placed], max_cells)
        if found is not None:
            return found
    return None


def _first_too_large(
    grids: Mapping[str, Grid], placed: Sequence[tuple[str, Sim2]], max_cells: int
) -> tuple[str, Extent] | None:
    extent: Extent | None = None
    for robot, frame_from_map in placed:
        own = Extent.of(grids[robot], frame_from_map)
        both = own if extent is None else extent.union(own)
        if extent is not None and not both.fits(max_cells):
            return robot, both
        extent = both
    return None
