"""One robot's walls in the Rerun recording, tile by tile: a map that grows shows new walls in few tiles."""

from __future__ import annotations

import numpy as np
import rerun as rr

from mapmerge.config import CellConfig
from mapmerge.grid import Grid
from mapmerge.sim2 import Points
from mapmerge.walls import thinned
from replay.sinks.rerun_entities import RobotEntities
from replay.sinks.rerun_lattice import Change, Corner, Tile, covered, tile_box, tile_name, tiles_of
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
        self._step = 1
        self._shown: set[Tile] = set()

    def show(self, change: Change) -> None:
        """Log what differs from the map before."""
        grid, before = change.grid, change.before
        step = max(1, round(max(grid.cells.shape) / POINTS_ACROSS))
        if before is None or step != self._step:
            self._step = step
            self._show_all(change)
            return
        for tile in tiles_of(change.box, self._side):
            rows_cols = self._occupied(grid, tile, change.first)
            if not np.array_equal(rows_cols, self._occupied(before, tile, change.first_before)):
                self._log(tile, change, rows_cols)

    @property
    def _side(self) -> int:
        """Cells across a tile."""
        return TILE_POINTS * self._step

    def _show_all(self, change: Change) -> None:
        for tile in sorted({*tiles_of(change.whole, self._side), *self._shown}):
            self._log(tile, change, self._occupied(change.grid, tile, change.first))

    def _occupied(self, grid: Grid, tile: Tile, first: Corner) -> Points:
        """Return rows and columns on the lattice of a tile's occupied cells, shape (2, N)."""
        whole = covered(grid, first)
        part = tile_box(tile, self._side).within(whole)
        if part.is_empty:
            return np.empty((2, 0))
        found = np.flatnonzero(grid.cells[part.slices(whole)] >= self._occupied_percent)
        row, col = np.divmod(found, part.shape[1])
        return np.stack([row + float(part.top), col + float(part.left)])

    def _log(self, tile: Tile, change: Change, rows_cols: Points) -> None:
        path = [*self._entities.walls, tile_name(tile)]
        if rows_cols.size == 0:
            if tile in self._shown:
                self._shown.remove(tile)
                self._stream.log(path, rr.Clear(recursive=False))
            return
        self._shown.add(tile)
        points = rows_cols[::-1].T + 0.5
        if self._step > 1:
            points = thinned(points, self._step)
        grid, (row, col) = change.grid, change.first
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
