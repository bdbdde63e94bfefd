"""Log odds of cells, and the entropy filter: what several maps say of the same cells (paper, equations 12 to 14)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmerge.config import CellConfig
from mapmerge.grid import MAX_PERCENT, UNKNOWN, UNKNOWN_BYTE, Cells, Mask
from mapmerge.warp import Bytes

_UNIT = 1_000_000
_P_MIN = 0.01
# what two layers say of a cell: the first or the second knows it, or both do, and then agree or contradict each other
_FIRST, _SECOND, _BOTH, _AGREE, _DISAGREE = (np.uint8(1 << bit) for bit in range(5))

Whole = NDArray[np.int32]


@dataclass(frozen=True, slots=True)
class Counts:
    """Cells counted over some tiles for one layer.

    Parameters
    ----------
    known
        That it knows.
    overlap
        That another one knows as well.
    agree, disagree
        Of these, both occupied or both free; one occupied, the other free.
    """

    known: int = 0
    overlap: int = 0
    agree: int = 0
    disagree: int = 0

    def plus(self, other: Counts, sign: int = 1) -> Counts:
        """Return these and the other cells or, with a sign of −1, these without the others."""
        return Counts(
            self.known + sign * other.known,
            self.overlap + sign * other.overlap,
            self.agree + sign * other.agree,
            self.disagree + sign * other.disagree,
        )


@dataclass(frozen=True, slots=True)
class Fused:
    """How each layer agrees with the others on a tile, and how many cells any of them knows there."""

    counts: Mapping[str, Counts]
    known: int


class LogOdds:
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
        self._pairs = self._of_pairs()

    def fuse(self, tiles: Mapping[str, Bytes]) -> tuple[Cells, Fused]:
        """Fuse the cells of a tile, given by layer, at least one; return them, and how the layers agree there."""
        if len(tiles) == 1:
            ((name, tile),) = tiles.items()
            count = int(np.count_nonzero(tile <= MAX_PERCENT))
            return tile.view(np.int8), Fused({name: Counts(known=count)}, count)
        return self._fuse_pair(tiles) if len(tiles) == 2 else self._fuse_many(tiles)

    def _fuse_pair(self, tiles: Mapping[str, Bytes]) -> tuple[Cells, Fused]:
        """Fuse two layers: a look-up."""
        one, other = tiles.values()
        looked_up = np.asarray(cv2.LUT(one.astype(np.uint16) * np.uint16(256) + other, self._pairs), np.uint16)
        said = np.right_shift(looked_up, 8).astype(np.uint8)
        bits = (_FIRST, _SECOND, _BOTH, _AGREE, _DISAGREE)
        known, others_known, overlap, agree, disagree = [int(np.count_nonzero(said & bit)) for bit in bits]
        counts = [Counts(known, overlap, agree, disagree), Counts(others_known, overlap, agree, disagree)]
        fused = Fused(dict(zip(tiles, counts, strict=True)), known + others_known - overlap)
        return looked_up.astype(np.uint8).view(np.int8), fused

    def _of_pairs(self) -> NDArray[np.uint16]:
        """Return for all pairs of bytes what the cell becomes, as the lower byte, and what they say, as the upper."""
        one, other = np.divmod(np.arange(1 << 16), 1 << 8)
        first, second = one <= MAX_PERCENT, other <= MAX_PERCENT
        both = first & second
        positive, negative = self._sums([one, other])
        agree, disagree = self._compared(one, positive, negative)
        alone = np.where(first, one, np.where(second, other, UNKNOWN_BYTE))
        cells = np.where(both, _fused_percent(positive, negative).view(np.uint8), alone)
        said = first * _FIRST | second * _SECOND | both * (_BOTH | agree * _AGREE | disagree * _DISAGREE)
        return np.asarray(cells + said.astype(np.uint16) * np.uint16(256), np.uint16)

    def _fuse_many(self, tiles: Mapping[str, Bytes]) -> tuple[Cells, Fused]:
        """Fuse more than two layers, counting which cells at least two of them know."""
        known = {name: tile <= MAX_PERCENT for name, tile in tiles.items()}
        layers_known = np.zeros(next(iter(tiles.values())).shape, np.uint8 if len(tiles) < 256 else np.int32)
        cells: Cells = np.full(layers_known.shape, UNKNOWN, np.int8)
        for name, tile in tiles.items():
            layers_known += known[name]
            np.maximum(cells, tile.view(np.int8), out=cells)
        shared = np.flatnonzero(layers_known > 1)
        own = {name: tile.ravel()[shared] for name, tile in tiles.items()}
        counts = {name: Counts(known=int(np.count_nonzero(known[name]))) for name in tiles}
        if len(shared):
            positive, negative = self._sums(list(own.values()))
            cells.ravel()[shared] = _fused_percent(positive, negative)
            counts = {name: counts[name].plus(self._count(own[name], positive, negative)) for name in tiles}
        return cells, Fused(counts, int(np.count_nonzero(layers_known)))

    def _sums(self, layers: Sequence[NDArray[np.integer]]) -> tuple[Whole, Whole]:
        positive, negative = self._positive[layers[0]], self._negative[layers[0]]
        for layer in layers[1:]:
            positive += self._positive[layer]
            negative += self._negative[layer]
        return positive, negative

    def _count(self, own: Bytes, positive: Whole, negative: Whole) -> Counts:
        """Compare one layer with the others together, where at least two layers know something."""
        known = own != UNKNOWN_BYTE
        agree, disagree = self._compared(own, positive, negative)
        return Counts(
            overlap=int(np.count_nonzero(known)),
            agree=int(np.count_nonzero(agree & known)),
            disagree=int(np.count_nonzero(disagree & known)),
        )

    def _compared(self, own: NDArray[np.integer], positive: Whole, negative: Whole) -> tuple[Mask, Mask]:
        """Tell where a layer and the others together agree, and where they contradict each other."""
        own_up, own_down = self._positive[own], self._negative[own]
        theirs, mine = _kept(positive - own_up, negative - own_down), own_up + own_down
        occupied = (mine >= self._occupied, theirs >= self._occupied)
        free = (mine <= self._free, theirs <= self._free)
        return (occupied[0] & occupied[1]) | (free[0] & free[1]), (occupied[0] & free[1]) | (free[0] & occupied[1])


def _kept(positive: Whole, negative: Whole) -> Whole:
    """Return the sum of larger magnitude, 0 for a tie."""
    kept = np.where(positive > -negative, positive, negative)
    return np.where(positive == -negative, 0, kept).astype(np.int32)


def _fused_percent(positive: Whole, negative: Whole) -> Cells:
    """Return cell values of summed log odds; a tie is unknown."""
    kept = _kept(positive, negative)
    percent = np.rint(100.0 / (1.0 + np.exp(-kept.astype(np.float64) / _UNIT)))
    return np.where(kept == 0, -1, percent).astype(np.int8)
