"""Fusion of placed maps: log odds with the entropy filter (paper, equations 12 to 14), for any number of maps.

Taken pair by pair, the paper's filter depends on the order of the maps. Here the positive and the negative log odds
are summed apart and the sum of larger magnitude is kept, a tie being unknown: for two maps that *is* the paper's
filter, and for more it does not depend on their order. Sums are kept in whole numbers, so that they are exact.

The canvas is worked on in tiles: memory is that of the outcome and a few tiles.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapmerge.config import CellConfig
from mapmerge.grid import MAX_PERCENT, Cells, Grid
from mapmerge.resample import at_resolution
from mapmerge.sim2 import Sim2

_TILE_CELLS = 2048
_UNIT = 1_000_000
_P_MIN = 0.01
_UNKNOWN_BYTE = 255

Bytes = NDArray[np.uint8]
Whole = NDArray[np.int32]


@dataclass(frozen=True, slots=True, eq=False)
class Layer:
    """One placed map: the grid and where its map frame lies in the merged frame."""

    grid: Grid
    merged_from_map: Sim2


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


@dataclass(frozen=True, slots=True, eq=False)
class _Warp:
    """A layer on the canvas: its cells as bytes, and the affine map from canvas cells to its own."""

    cells: Bytes
    cell_from_canvas: NDArray[np.float64]
    box: tuple[int, int, int, int]


@dataclass(slots=True)
class _Counts:
    """Cells counted over all tiles for one layer."""

    known: int = 0
    others_known: int = 0
    overlap: int = 0
    agree: int = 0
    disagree: int = 0


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
    warps = [_warp(layer, lattice, config) for layer in layers]
    boxes = np.array([warp.box for warp in warps if warp.cells.size], dtype=np.int64).reshape(-1, 4)
    if len(boxes) == 0:
        empty = Grid(lattice.cells[:0, :0], lattice.resolution_m, lattice.map_from_grid)
        return Fusion(empty, tuple(Agreement(0.0, 0.0, 0.0) for _ in layers))
    row, col = int(boxes[:, 0].min()), int(boxes[:, 1].min())
    cells = np.full((int(boxes[:, 2].max()) - row, int(boxes[:, 3].max()) - col), -1, np.int8)
    odds = _LogOdds(config)
    counts = [_Counts() for _ in layers]
    for top, left, bottom, right in _tiles(*cells.shape):
        tiles = [_tile(warp, (row + top, col + left, row + bottom, col + right)) for warp in warps]
        if any(tile is not None for tile in tiles):
            cells[top:bottom, left:right] = odds.fuse(tiles, counts)
    corner = Sim2(col * lattice.resolution_m, row * lattice.resolution_m)
    grid = Grid(cells, lattice.resolution_m, lattice.map_from_grid @ corner)
    return Fusion(grid, tuple(_agreement(count, lattice.resolution_m**2) for count in counts))


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

    def fuse(self, tiles: Sequence[Bytes | None], counts: Sequence[_Counts]) -> Cells:
        """Return the fused cells of one tile that some layer reaches, and count how the layers agree."""
        present = [(tile, count) for tile, count in zip(tiles, counts, strict=True) if tile is not None]
        positive, negative = self._sums([tile for tile, _ in present])
        layers_known = np.zeros(present[0][0].shape, np.int32)
        for tile, _ in present:
            layers_known += tile <= MAX_PERCENT
        for tile, count in present:
            self._count(tile, positive, negative, layers_known, count)
        anything = int(np.count_nonzero(layers_known))
        for absent in (count for tile, count in zip(tiles, counts, strict=True) if tile is None):
            absent.others_known += anything
        return self._values([tile for tile, _ in present], positive, negative, layers_known)

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

    def _count(self, tile: Bytes, positive: Whole, negative: Whole, layers_known: Whole, count: _Counts) -> None:
        known = tile <= MAX_PERCENT
        others = layers_known - known
        count.known += int(np.count_nonzero(known))
        count.others_known += int(np.count_nonzero(others))
        both = known & (others > 0)
        shared = int(np.count_nonzero(both))
        count.overlap += shared
        if not shared:
            return
        own = tile[both]
        own_up, own_down = self._positive[own], self._negative[own]
        up, down = positive[both] - own_up, negative[both] - own_down
        theirs, mine = _kept(up, down), own_up + own_down
        occupied = (mine >= self._occupied, theirs >= self._occupied)
        free = (mine <= self._free, theirs <= self._free)
        count.agree += int(np.count_nonzero((occupied[0] & occupied[1]) | (free[0] & free[1])))
        count.disagree += int(np.count_nonzero((occupied[0] & free[1]) | (free[0] & occupied[1])))


def _kept(positive: Whole, negative: Whole) -> Whole:
    """Return the sum of larger magnitude, 0 for a tie."""
    kept = np.where(positive > -negative, positive, negative)
    return np.where(positive == -negative, 0, kept).astype(np.int32)


def _fused_percent(positive: Whole, negative: Whole) -> Cells:
    """Return cell values of summed log odds; a tie is unknown."""
    kept = _kept(positive, negative)
    percent = np.rint(100.0 / (1.0 + np.exp(-kept.astype(np.float64) / _UNIT)))
    return np.where(kept == 0, -1, percent).astype(np.int8)


def _warp(layer: Layer, lattice: Grid, config: CellConfig) -> _Warp:
    """Place a layer's known part on the lattice; a finer map is pooled first, so that thin walls stay."""
    scale = layer.merged_from_map.scale
    known = layer.grid.cropped_to_known()
    coarse_m = lattice.resolution_m / scale
    grid = at_resolution(known, coarse_m, config) if coarse_m > known.resolution_m else known
    lattice_from_grid = lattice.map_from_grid.inverse() @ layer.merged_from_map @ grid.map_from_grid
    linear = lattice_from_grid.linear * (grid.resolution_m / lattice.resolution_m)
    shift = np.array([lattice_from_grid.x_m, lattice_from_grid.y_m]) / lattice.resolution_m
    linear, shift = _snapped(linear, shift)
    corners = np.array([[0, 0], [grid.cols, 0], [0, grid.rows], [grid.cols, grid.rows]]) @ linear.T + shift
    low, high = np.floor(corners.min(axis=0) + 1e-6), np.ceil(corners.max(axis=0) - 1e-6)
    inverse = np.linalg.inv(linear)
    cell_from_canvas = np.hstack([inverse, (-inverse @ shift)[:, None]])
    box = (int(low[1]), int(low[0]), int(high[1]), int(high[0]))
    return _Warp(grid.cells.view(np.uint8), cell_from_canvas, box)


def _snapped(
    linear: NDArray[np.float64], shift: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a map that is a whole shift but for rounding errors as exactly that, so that cells are copied as is."""
    whole = np.rint(shift)
    if np.allclose(linear, np.eye(2), rtol=0, atol=1e-7) and np.allclose(shift, whole, rtol=0, atol=1e-3):
        return np.eye(2), whole
    return linear, shift


def _tiles(rows: int, cols: int) -> Iterator[tuple[int, int, int, int]]:
    for top in range(0, rows, _TILE_CELLS):
        for left in range(0, cols, _TILE_CELLS):
            yield top, left, min(rows, top + _TILE_CELLS), min(cols, left + _TILE_CELLS)


def _tile(warp: _Warp, box: tuple[int, int, int, int]) -> Bytes | None:
    """Return a layer's cells on a box of the canvas, or None if it does not reach there."""
    top, left, bottom, right = box
    if not (warp.box[0] < bottom and top < warp.box[2] and warp.box[1] < right and left < warp.box[3]):
        return None
    if warp.cells.size == 0:
        return None
    (a, b, x), (c, d, y) = warp.cell_from_canvas
    across, up = np.arange(left, right) + 0.5, np.arange(top, bottom)[:, None] + 0.5
    # from the canvas' own numbers, so that the outcome does not depend on where tiles begin
    col, row = np.floor(a * across + x + b * up).astype(np.int32), np.floor(c * across + y + d * up).astype(np.int32)
    rows, cols = warp.cells.shape
    inside = (col >= 0) & (col < cols) & (row >= 0) & (row < rows)
    if not inside.any():
        return None
    tile = np.full(inside.shape, _UNKNOWN_BYTE, np.uint8)
    tile[inside] = warp.cells[row[inside], col[inside]]
    return tile


def _agreement(count: _Counts, cell_m2: float) -> Agreement:
    smaller = min(count.known, count.others_known)
    return Agreement(
        acceptance=count.agree / (count.agree + count.disagree) if count.agree else 0.0,
        overlap_m2=count.overlap * cell_m2,
        overlap_fraction=count.overlap / smaller if smaller else 0.0,
    )
