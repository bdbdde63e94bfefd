"""Where a map that is shown again and again differs from itself before, on the lattice that its cells keep."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from mapmerge.grid import UNKNOWN, Cells, Grid
from mapmerge.lattice import changed_box, offset_cells
from mapmerge.plane import Box, read
from mapmerge.sim2 import Sim2

Corner = tuple[int, int]
"""Row and column of a grid's first cell on the lattice."""
Tile = tuple[int, int]
"""Row and column of a square of the lattice, counted in such squares."""


@dataclass(frozen=True, slots=True)
class Change:
    """A map, and what is new about it.

    Parameters
    ----------
    grid, first
        The map, and where it is on the lattice.
    box
        Cells of the lattice outside of which it says what it said before.
    before, first_before
        The map before; None if there was none on this lattice, so that all is new.
    """

    grid: Grid
    first: Corner
    box: Box
    before: Grid | None
    first_before: Corner

    @property
    def whole(self) -> Box:
        """What the map covers."""
        return covered(self.grid, self.first)

    def own(self, box: Box) -> Box:
        """Return a box of the lattice, counted from the map's first cell."""
        return box.shifted(-self.first[0], -self.first[1])

    def on_lattice(self, box: Box) -> Box:
        """Return a box that is counted from the map's first cell, on the lattice."""
        return box if box.is_empty else box.shifted(*self.first)

    def cells(self, box: Box) -> Cells:
        """Return what the map says in a box of the lattice, unknown where it is beyond the map."""
        return read(self.grid.cells, self.own(box), UNKNOWN)

    def pose(self, box: Box) -> Sim2:
        """Return where the outer corner of a box's first cell lies in the map frame."""
        own = self.own(box)
        cell_m = self.grid.resolution_m
        return self.grid.map_from_grid @ Sim2(own.left * cell_m, own.top * cell_m)


class Lattice:
    """Follows one map; cells are counted from the first one for as long as maps keep its lattice."""

    def __init__(self) -> None:
        self._grid: Grid | None = None
        self._first: Corner = (0, 0)

    def take(self, grid: Grid) -> Change:
        """Return what is new about the map that follows."""
        before, first_before = self._grid, self._first
        self._grid, self._first = grid, (0, 0)
        offset = None if before is None else offset_cells(before, grid)
        box = None if before is None else changed_box(before, grid)
        if before is None or offset is None or box is None:
            return Change(grid, self._first, covered(grid, self._first), None, self._first)
        self._first = (first_before[0] + offset[0], first_before[1] + offset[1])
        return Change(grid, self._first, box.shifted(*self._first), before, first_before)


def covered(grid: Grid, first: Corner) -> Box:
    """Return the cells of the lattice that a grid covers."""
    return Box(0, 0, *grid.cells.shape).shifted(*first)


def tiles_of(box: Box, side: int) -> Iterator[Tile]:
    """Yield the tiles of so many cells a side that a box touches, row by row."""
    if not box.is_empty:
        for row in range(box.top // side, (box.bottom - 1) // side + 1):
            yield from ((row, col) for col in range(box.left // side, (box.right - 1) // side + 1))


def tile_box(tile: Tile, side: int) -> Box:
    """Return the cells of a tile."""
    row, col = tile
    return Box(row * side, col * side, (row + 1) * side, (col + 1) * side)


def tile_name(tile: Tile) -> str:
    """Return what the tile is called in paths of entities."""
    return f"{tile[0]}_{tile[1]}"
