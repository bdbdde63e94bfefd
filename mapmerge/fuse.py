"""Fusion of placed maps: log odds with the entropy filter (paper, equations 12 to 14), for any number of maps.

Taken pair by pair, the paper's filter depends on the order of the maps. Here the positive and the negative log odds
are summed apart and the sum of larger magnitude is kept, a tie being unknown: for two maps that *is* the paper's
filter, and for more it does not depend on their order. Sums are kept in whole numbers, so that they are exact.

The canvas is worked on in tiles: only those under a change are fused again.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mapmerge.config import CellConfig
from mapmerge.grid import UNKNOWN, Cells, Grid
from mapmerge.lattice import changed_box, offset_cells, same_within
from mapmerge.odds import Counts, Fused, LogOdds
from mapmerge.plane import NOTHING, Box, Plane
from mapmerge.sim2 import Sim2
from mapmerge.warp import Layer, Warp, warped

TILE_CELLS = 256


@dataclass(frozen=True, slots=True)
class Agreement:
    """How one placed map agrees with all others together.

    Parameters
    ----------
    acceptance
        Acceptance index ω (equation 3) against the fusion of the others; 0 without overlap.
    overlap_m2
        Area that this map and any other know.
    overlap_fraction
        The same over the smaller of this map's known area and that of all others together.
    """

    acceptance: float
    overlap_m2: float
    overlap_fraction: float


@dataclass(frozen=True, slots=True, eq=False)
class Fusion:
    """The merged map, and for each layer how it agrees with the others."""

    grid: Grid
    agreements: tuple[Agreement, ...]


def fuse(layers: Sequence[Layer], lattice: Grid, config: CellConfig) -> Fusion:
    """Fuse maps on the cells of ``lattice``, extended as far as the maps reach.

    Parameters
    ----------
    layers
        The placed maps, in any order.
    lattice
        The reference's map: the outcome has its resolution, and its cells fall on the lattice's.

    Returns
    -------
    Fusion
        The merged map in the merged frame, and the agreements in the order of the layers.
    """
    return Canvas(config).update({str(number): layer for number, layer in enumerate(layers)}, lattice)


class Canvas:
    """A merged map that is kept up to date.

    Parameters
    ----------
    config
        When a cell is occupied or free.
    """

    def __init__(self, config: CellConfig) -> None:
        self._config = config
        self._odds = LogOdds(config)
        self._lattice: Grid | None = None
        self._warps: dict[str, Warp] = {}
        self._counts: dict[str, Counts] = {}
        self._known = 0
        self._tiles: dict[Box, Fused] = {}
        self._cells = Plane(np.int8, UNKNOWN)
        # what was given away last, until a cell differs
        self._grid: Grid | None = None

    def update(self, layers: Mapping[str, Layer], lattice: Grid, changed: Mapping[str, Box] | None = None) -> Fusion:
        """Return what is fused of these layers, by name; the same grid as before if none of its cells can differ.

        Parameters
        ----------
        layers
            The placed maps, in any order.
        lattice
            The reference's map, as in `fuse`.
        changed
            Cells of layers' maps outside of which they say what they said at the last update, where that is known; see
            `mapmerge.lattice.changed_box`.
        """
        if self._lattice is None or offset_cells(self._lattice, lattice) is None:
            self._lattice, self._grid = lattice, None
            self._warps, self._counts, self._known, self._tiles = {}, {}, 0, {}
            self._cells = Plane(np.int8, UNKNOWN)
        warps = {name: self._warp(name, layer, self._lattice) for name, layer in layers.items()}
        dirty = {
            tile
            for name in {**self._warps, **warps}
            for tile in self._dirty(self._warps.get(name), warps.get(name), (changed or {}).get(name))
        }
        self._warps = warps
        self._counts = {name: self._counts.get(name, Counts()) for name in warps}
        self._cover(warps.values())
        for tile in sorted(dirty):
            self._renew(tile)
        if self._grid is None:
            self._grid = self._published(self._lattice)
        cell_m2 = lattice.resolution_m**2
        return Fusion(self._grid, tuple(_agreement(count, self._known, cell_m2) for count in self._counts.values()))

    def _cover(self, warps: Iterable[Warp]) -> None:
        """Cover just what some layers reach."""
        covered = NOTHING
        for warp in warps:
            covered = covered.union(warp.box)
        if covered != self._cells.box:
            self._cells.cover(covered)
            self._grid = None

    def _warp(self, name: str, layer: Layer, lattice: Grid) -> Warp:
        known = self._warps.get(name)
        if known is not None and known.layer.is_same(layer):
            return known
        return warped(layer, lattice, self._config)

    @staticmethod
    def _dirty(before: Warp | None, after: Warp | None, changed: Box | None) -> Iterator[Box]:
        """Yield the tiles on which one layer may have changed."""
        if before is after:
            return
        if before is not None and after is not None and before.layer.merged_from_map == after.layer.merged_from_map:
            found = changed_box(before.layer.grid, after.layer.grid) if changed is None else changed
            if found is not None and not before.is_pooled and not after.is_pooled:
                yield from _differing(before, after, after.of_map(found))
                return
        for warp in (before, after):
            if warp is not None:
                yield from _tiles(warp.box)

    def _renew(self, tile: Box) -> None:
        """Fuse the cells of a tile, and count them instead of what was there."""
        self._count(self._tiles.pop(tile, None), -1)
        on_tile = {name: own for name, warp in self._warps.items() if (own := warp.tile(tile)) is not None}
        inside = tile.within(self._cells.box)
        if not on_tile:
            self._write(inside, np.full(inside.shape, UNKNOWN, np.int8))
            return
        cells, self._tiles[tile] = self._odds.fuse(on_tile)
        self._count(self._tiles[tile], 1)
        self._write(inside, cells[inside.slices(tile)])

    def _write(self, box: Box, cells: Cells) -> None:
        """Write cells of the merged map: to a copy, if they differ from those of the grid that was given away."""
        if self._grid is not None:
            if np.array_equal(self._cells.part(box), cells):
                return
            self._cells.cells, self._grid = self._cells.cells.copy(), None
        self._cells.part(box)[:] = cells

    def _count(self, fused: Fused | None, sign: int) -> None:
        if fused is None:
            return
        self._known += sign * fused.known
        for name in fused.counts.keys() & self._counts.keys():
            self._counts[name] = self._counts[name].plus(fused.counts[name], sign)

    def _published(self, lattice: Grid) -> Grid:
        box = self._cells.box
        corner = Sim2(box.left * lattice.resolution_m, box.top * lattice.resolution_m)
        return Grid(self._cells.cells, lattice.resolution_m, lattice.map_from_grid @ corner, is_own=True)


def _differing(before: Warp, after: Warp, changed: Box) -> Iterator[Box]:
    """Yield the tiles under which a layer's cells differ, if none does outside of a box of them."""
    offset = offset_cells(before.grid, after.grid)
    for tile in _tiles(after.over(changed)):
        under = after.under(tile).within(changed)
        if offset is None or not same_within(before.grid, after.grid, offset, under):
            yield tile


def _tiles(box: Box) -> Iterator[Box]:
    """Yield the tiles that a box touches: they are always the same ones, so that what is on a tile is, too."""
    side = TILE_CELLS
    if box.is_empty:
        return
    for top in range(box.top // side * side, box.bottom, side):
        for left in range(box.left // side * side, box.right, side):
            yield Box(top, left, top + side, left + side)


def _agreement(count: Counts, known: int, cell_m2: float) -> Agreement:
    """Return how a layer agrees with the others, given how many cells any layer knows."""
    others_known = known - count.known + count.overlap
    smaller = min(count.known, others_known)
    return Agreement(
        acceptance=count.agree / (count.agree + count.disagree) if count.agree else 0.0,
        overlap_m2=count.overlap * cell_m2,
        overlap_fraction=count.overlap / smaller if smaller else 0.0,
    )
