"""One robot's walls in the Rerun recording, tile by tile: a map that grows shows new walls in few tiles."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import rerun as rr

from mapmerge.config import CellConfig
from mapmerge.grid import Grid
from mapmerge.lattice import changed_box, offset_cells
from mapmerge.plane import Box
from mapmerge.sim2 import Points
from mapmerge.walls import thinned
from replay.sinks.rerun_entities import RobotEntities
from replay.sinks.rerun_stream import RrdStream

POINTS_ACROSS = 2000
"""About how many points across a map its walls are thinned to."""
TILE_POINTS = 256
"""Points across a tile."""

_HEIGHT_M = 0.04
_STEP_M = 0.005

# Sizes in points of the screen, which the library tells from metres by their sign. The reference's walls are drawn
# wide, so that those of the others are seen on them.
_REFERENCE_RADIUS = rr.Radius.ui_points(1.4)
_RADIUS = rr.Radius.ui_points(0.75)

_Tile = tuple[int, int]


class WallScene:
    """Logs where a robot's map is occupied; only tiles in which that changed.

    Parameters
    ----------
    stream
        The recording.
    entities
        The robot.
    cells
        When a cell counts as occupied.
    """

    def __init__(self, stream: RrdStream, entities: RobotEntities, cells: CellConfig) -> None:
        self._stream = stream
        self._entities = entities
        self._occupied_percent = cells.min_occupied_percent
        self._height_m = _HEIGHT_M + _STEP_M * entities.index
        self._radius = _RADIUS if entities.index else _REFERENCE_RADIUS
        self._grid: Grid | None = None
        self._first = (0, 0)
        self._step = 1
        self._shown: set[_Tile] = set()

    def show(self, grid: Grid) -> None:
        """Log what differs from the map before; cells are counted on its lattice for as long as maps keep it."""
        before, self._grid = self._grid, grid
        step = max(1, round(max(grid.cells.shape) / POINTS_ACROSS))
        offset = None if before is None else offset_cells(before, grid)
        changed = None if before is None else changed_box(before, grid)
        if before is None or offset is None or changed is None or step != self._step:
            self._first, self._step = (0, 0), step
            self._show_all(grid)
            return
        first, self._first = self._first, (self._first[0] + offset[0], self._first[1] + offset[1])
        for tile in self._tiles(changed.shifted(*self._first)):
            rows_cols = self._occupied(grid, tile, self._first)
            if not np.array_equal(rows_cols, self._occupied(before, tile, first)):
                self._log(tile, grid, rows_cols)

    def _show_all(self, grid: Grid) -> None:
        whole = set(self._tiles(Box(0, 0, *grid.cells.shape)))
        for tile in sorted(whole | self._shown):
            self._log(tile, grid, self._occupied(grid, tile, self._first))

    def _tiles(self, box: Box) -> Iterator[_Tile]:
        """Yield the tiles that a box of the lattice touches, as row and column of tiles."""
        side = TILE_POINTS * self._step
        if not box.is_empty:
            for row in range(box.top // side, (box.bottom - 1) // side + 1):
                yield from ((row, col) for col in range(box.left // side, (box.right - 1) // side + 1))

    def _occupied(self, grid: Grid, tile: _Tile, first: tuple[int, int]) -> Points:
        """Return rows and columns on the lattice of a tile's occupied cells, shape (2, N)."""
        side = TILE_POINTS * self._step
        whole = Box(0, 0, *grid.cells.shape).shifted(*first)
        part = Box(tile[0] * side, tile[1] * side, (tile[0] + 1) * side, (tile[1] + 1) * side).within(whole)
        if part.is_empty:
            return np.empty((2, 0))
        found = np.flatnonzero(grid.cells[part.slices(whole)] >= self._occupied_percent)
        row, col = np.divmod(found, part.shape[1])
        return np.stack([row + float(part.top), col + float(part.left)])

    def _log(self, tile: _Tile, grid: Grid, rows_cols: Points) -> None:
        path = [*self._entities.walls, f"{tile[0]}_{tile[1]}"]
        if rows_cols.size == 0:
            if tile in self._shown:
                self._shown.remove(tile)
                self._stream.log(path, rr.Clear(recursive=False))
            return
        self._shown.add(tile)
        points = rows_cols[::-1].T + 0.5
        if self._step > 1:
            points = thinned(points, self._step)
        row, col = self._first
        points_m = grid.map_from_grid.apply((points - (col, row)) * grid.resolution_m)
        self._stream.log(
            path,
            rr.Points3D(
                np.column_stack([points_m, np.full(len(points_m), self._height_m)]).astype(np.float32),
                radii=self._radius,
                colors=[self._entities.colour],
                point_shading=rr.components.PointShading.Flat,
            ),
        )
