"""How much memory a map takes while it is merged, and the merged map: told beforehand, so that it can be refused.

The constants are upper bounds of what was measured for maps with few and many walls, finer and coarser than they are
matched at; `tests/mapmerge/test_footprint.py` holds them against what is really taken. What a search takes besides
does not grow with the maps: about half a gigabyte at most.
"""

from __future__ import annotations

import numpy as np

from mapmerge.config import MergeConfig
from mapmerge.grid import Grid
from mapmerge.prepare import FREE_SPACING_M

CELL_BYTES = 3
"""Of each cell of a map as it came: itself, and its copy on the merged map."""
POOLED_CELL_BYTES = 20
"""Of each cell of a map that is finer than it is matched at: what pooling takes on the way."""
WORKING_CELL_BYTES = 12
"""Of each cell at the resolution at which maps are matched: its class, and what a point there meets."""
FREE_BYTES = 80
"""Of each square of `FREE_SPACING_M`: a point of free space."""
WALL_BYTES = 200
"""Of each square of `SearchConfig.wall_spacing_m` with a wall in it: where it is, how it runs, what is near."""
CANVAS_CELL_BYTES = 8
"""Of each cell of the merged map: itself, the copy of it that was given away, and those that are written."""


def needed_bytes(grid: Grid, config: MergeConfig) -> int:
    """Return about how much memory it takes to merge a map; at least what it really takes."""
    walls = int(np.count_nonzero(grid.cells >= config.cells.min_occupied_percent))
    return _needed_bytes(grid, walls, config)


def may_need_bytes(grid: Grid, config: MergeConfig) -> int:
    """Return what a map of this size takes at most, whatever its cells say: told at once."""
    return _needed_bytes(grid, grid.cells.size, config)


def _needed_bytes(grid: Grid, walls: int, config: MergeConfig) -> int:
    area_m2 = grid.cells.size * grid.resolution_m**2
    working_m = max(config.search.working_cell_m, grid.resolution_m)
    spacing_m = max(config.search.wall_spacing_m, working_m)
    squares = min(walls, area_m2 / spacing_m**2)
    working_cells = area_m2 / working_m**2
    samples = working_cells / max(1, round(FREE_SPACING_M / working_m)) ** 2
    cell_bytes = CELL_BYTES + (POOLED_CELL_BYTES if grid.resolution_m < working_m else 0)
    kept_bytes = working_cells * WORKING_CELL_BYTES + samples * FREE_BYTES + squares * WALL_BYTES
    return int(grid.cells.size * cell_bytes + kept_bytes)
