"""Fusion of placed maps: log odds with the entropy filter (paper, equations 12 to 14), for any number of maps.

Taken pair by pair, the paper's filter depends on the order of the maps. Here the positive and the negative log odds
are summed apart and the sum of larger magnitude is kept, a tie being unknown: for two maps that *is* the paper's
filter, and for more it does not depend on their order. Sums are kept in whole numbers, so that they are exact.

The canvas is worked on in tiles: memory is that of the outcome and a few tiles.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapmerge.config import CellConfig
from mapmerge.grid import MAX_PERCENT, Cells, Grid
from mapmerge.lattice import changed_box, offset_cells
from mapmerge.plane import NOTHING, Box, Plane
from mapmerge.sim2 import Sim2
from mapmerge.warp import Bytes, Layer, Warp, warped

_TILE_CELLS = 2048
_UNIT = 1_000_000
_P_MIN = 0.01

Whole = NDArray[np.int32]


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


@dataclass(frozen=True, slots=True)
class _Counts:
    """Cells counted over some tiles for one layer."""

    known: int = 0
    overlap: int = 0
    agree: int = 0
    disagree: int = 0

    def plus(self, other: _Counts, sign: int = 1) -> _Counts:
        """Return these and the other cells or, with a sign of -1, these without the others."""
        return _Counts(
            self.known + sign * other.known,
            self.overlap + sign * other.overlap,
            self.agree + sign * other.agree,
            self.disagree + sign * other.disagree,
        )


@dataclass(frozen=True, slots=True, eq=False)
class _Fused:
    """A tile: its fused cells, how each layer agrees with the others on it, and how many cells any of them knows."""

    cells: Cells
    counts: Mapping[str, _Counts]
    known: int


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
    """A merged map that is kept up to date: only cells under what changed are fused again.

    Parameters
    ----------
    config
        When a cell is occupied or free.
    """

    def __init__(self, config: CellConfig) -> None:
        self._config = config
        self._odds = _LogOdds(config)
        self._lattice: Grid | None = None
        self._warps: dict[str, Warp] = {}
        self._counts: dict[str, _Counts] = {}
        self._known = 0
        self._cells = Plane(np.uint8)  # values of cells and 1, so that 0 is unknown
        self._grid: Grid | None = None

    def update(self, layers: Mapping[str, Layer], lattice: Grid) -> Fusion:
        """Return what is fused of these layers, by name; the same grid as before if none of its cells can differ.

        Parameters
        ----------
        layers
            The placed maps, in any order.
        lattice
            The reference's map, as in `fuse`.
        """
        if self._lattice is None or offset_cells(self._lattice, lattice) is None:
            self._lattice, self._grid = lattice, None
            self._warps, self._counts, self._known, self._cells = {}, {}, 0, Plane(np.uint8)
        warps = {name: self._warp(name, layer, self._lattice) for name, layer in layers.items()}
        dirty = NOTHING
        for name in {**self._warps, **warps}:
            dirty = dirty.union(self._dirty(self._warps.get(name), warps.get(name)))
        covered = NOTHING
        for warp in warps.values():
            covered = covered.union(warp.box)
        before, self._warps = self._warps, warps
        self._counts = {name: self._counts.get(name, _Counts()) for name in warps}
        resized = covered != self._cells.box
        self._cells.cover(covered)
        for tile in _tiles(dirty):
            self._renew(tile, before)
        if self._grid is None or resized or not dirty.is_empty:
            self._grid = self._published(self._lattice)
        cell_m2 = lattice.resolution_m**2
        return Fusion(self._grid, tuple(_agreement(count, self._known, cell_m2) for count in self._counts.values()))

    def _warp(self, name: str, layer: Layer, lattice: Grid) -> Warp:
        known = self._warps.get(name)
        if known is not None and known.layer.is_same(layer):
            return known
        return warped(layer, lattice, self._config)

    def _dirty(self, before: Warp | None, after: Warp | None) -> Box:
        """Return the cells of the canvas that one layer may have changed."""
        if before is after:
            return NOTHING
        both = (before.box if before else NOTHING).union(after.box if after else NOTHING)
        if before is None or after is None or before.layer.merged_from_map != after.layer.merged_from_map:
            return both
        changed = changed_box(before.layer.grid, after.layer.grid)
        if changed is None or before.is_pooled or after.is_pooled:
            return both
        return after.on_canvas(changed).within(both)

    def _renew(self, tile: Box, before: Mapping[str, Warp]) -> None:
        """Fuse the cells of a tile, and count them instead of what was there before."""
        self._count_again(self._odds.fuse(_on(tile, before)), -1)
        fused = self._odds.fuse(_on(tile, self._warps))
        self._count_again(fused, 1)
        inside = tile.within(self._cells.box)
        cells = fused.cells[inside.slices(tile)].view(np.uint8) + np.uint8(1) if fused else np.uint8(0)
        self._cells.part(inside)[:] = cells

    def _count_again(self, fused: _Fused | None, sign: int) -> None:
        if fused is None:
            return
        self._known += sign * fused.known
        for name in fused.counts.keys() & self._counts.keys():
            self._counts[name] = self._counts[name].plus(fused.counts[name], sign)

    def _published(self, lattice: Grid) -> Grid:
        box = self._cells.box
        corner = Sim2(box.left * lattice.resolution_m, box.top * lattice.resolution_m)
        cells = (self._cells.cells - np.uint8(1)).view(np.int8)
        return Grid(cells, lattice.resolution_m, lattice.map_from_grid @ corner)


class _LogOdds:
    """Log odds of a cell's byte in whole units of 1e-6, positive and negative apart."""

    def __init__(self, config: CellConfig) -> None:
        percent = np.arange(101)
        p = np.clip(percent / 100.0, _P_MIN, 1.0 - _P_MIN)
        table = np.zeros(256, np.int32)
        table[:101] = np.rint(np.log(p / (1.0 - p)) * _UNIT).astype(np.int32)
        self._positive: Whole = np.maximum(table, 0)
        self._negative: Whole = np.minimum(table, 0)
        self._occupied = int(table[config.min_occupied_percent])
        self._free = int(table[config.max_free_percent])

    def fuse(self, tiles: Mapping[str, Bytes]) -> _Fused | None:
        """Fuse what is on a tile of the layers that reach it; None if none does."""
        if not tiles:
            return None
        present = list(tiles.values())
        positive, negative = self._sums(present)
        layers_known = np.zeros(present[0].shape, np.int32)
        for tile in present:
            layers_known += tile <= MAX_PERCENT
        cells = self._values(present, positive, negative, layers_known)
        counts = {name: self._count(tile, positive, negative, layers_known) for name, tile in tiles.items()}
        return _Fused(cells, counts, int(np.count_nonzero(layers_known)))

    def _sums(self, tiles: Sequence[Bytes]) -> tuple[Whole, Whole]:
        positive, negative = self._positive[tiles[0]], self._negative[tiles[0]]
        for tile in tiles[1:]:
            positive += self._positive[tile]
            negative += self._negative[tile]
        return positive, negative

    def _values(self, tiles: Sequence[Bytes], positive: Whole, negative: Whole, layers_known: Whole) -> Cells:
        values = tiles[0].view(np.int8).copy()
        for tile in tiles[1:]:
            np.maximum(values, tile.view(np.int8), out=values)
        shared = layers_known > 1
        if shared.any():
            values[shared] = _fused_percent(positive[shared], negative[shared])
        return values

    def _count(self, tile: Bytes, positive: Whole, negative: Whole, layers_known: Whole) -> _Counts:
        known = tile <= MAX_PERCENT
        others = layers_known - known
        both = known & (others > 0)
        own = tile[both]
        own_up, own_down = self._positive[own], self._negative[own]
        up, down = positive[both] - own_up, negative[both] - own_down
        theirs, mine = _kept(up, down), own_up + own_down
        occupied = (mine >= self._occupied, theirs >= self._occupied)
        free = (mine <= self._free, theirs <= self._free)
        return _Counts(
            known=int(np.count_nonzero(known)),
            overlap=len(own),
            agree=int(np.count_nonzero((occupied[0] & occupied[1]) | (free[0] & free[1]))),
            disagree=int(np.count_nonzero((occupied[0] & free[1]) | (free[0] & occupied[1]))),
        )


def _kept(positive: Whole, negative: Whole) -> Whole:
    """Return the sum of larger magnitude, 0 for a tie."""
    kept = np.where(positive > -negative, positive, negative)
    return np.where(positive == -negative, 0, kept).astype(np.int32)


def _fused_percent(positive: Whole, negative: Whole) -> Cells:
    """Return cell values of summed log odds; a tie is unknown."""
    kept = _kept(positive, negative)
    percent = np.rint(100.0 / (1.0 + np.exp(-kept.astype(np.float64) / _UNIT)))
    return np.where(kept == 0, -1, percent).astype(np.int8)


def _tiles(box: Box) -> Iterator[Box]:
    for top in range(box.top, box.bottom, _TILE_CELLS):
        for left in range(box.left, box.right, _TILE_CELLS):
            yield Box(top, left, min(box.bottom, top + _TILE_CELLS), min(box.right, left + _TILE_CELLS))


def _on(tile: Box, warps: Mapping[str, Warp]) -> dict[str, Bytes]:
    """Return what is on a tile of each layer that reaches it."""
    found = {name: warp.tile(tile) for name, warp in warps.items()}
    return {name: cells for name, cells in found.items() if cells is not None}


def _agreement(count: _Counts, known: int, cell_m2: float) -> Agreement:
    """Return how a layer agrees with the others, given how many cells any layer knows."""
    others_known = known - count.known + count.overlap
    smaller = min(count.known, others_known)
    return Agreement(
        acceptance=count.agree / (count.agree + count.disagree) if count.agree else 0.0,
        overlap_m2=count.overlap * cell_m2,
        overlap_fraction=count.overlap / smaller if smaller else 0.0,
    )
