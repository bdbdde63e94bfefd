"""Places on a lattice as sorted keys, row by row: one whole number each, so that they are found and exchanged fast."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from mapmerge.grid import Counted
from mapmerge.plane import NOTHING, Box

Whole = NDArray[np.int64]
Keys = NDArray[np.int64]
Indices = NDArray[np.intp]
Places = tuple[Counted, Counted]
"""Rows and columns, shape (N,) each, row by row."""

_Item = TypeVar("_Item", bound=np.generic)

_BITS = 32
_HALF = 1 << (_BITS - 1)


def keys_of(rows: Whole | Counted, cols: Whole | Counted) -> Keys:
    """Return the key of each place."""
    return (np.asarray(rows, np.int64) << _BITS) + cols


def places_of(keys: Keys) -> tuple[Whole, Whole]:
    """Return the row and the column of each key."""
    rows = (keys + _HALF) >> _BITS
    return rows, keys - (rows << _BITS)


def span_of_rows(keys: Keys, box: Box) -> slice:
    """Return where the keys of the rows of a box are."""
    begin, end = np.searchsorted(keys, ((box.top << _BITS) - _HALF, (box.bottom << _BITS) - _HALF))
    return slice(int(begin), int(end))


def box_of_keys(keys: Keys) -> Box:
    """Return the smallest box that holds all keys."""
    if len(keys) == 0:
        return NOTHING
    row, col = places_of(keys)
    return Box(int(row.min()), int(col.min()), int(row.max()) + 1, int(col.max()) + 1)


def exchanged(values: NDArray[_Item], gone: Indices, before: Indices, new: NDArray[_Item]) -> NDArray[_Item]:
    """Return values without those at some indices, and with new ones before those at others; both sorted."""
    if len(gone) + len(before) == 0:
        return values
    if len(values) == 0:
        return new
    # what changes is near to each other: all else is copied as it is
    begin = int(min(*gone[:1], *before[:1], len(values)))
    end = int(max(*gone[-1:] + 1, *before[-1:], begin))
    part = np.delete(values[begin:end], gone - begin)
    part = np.insert(part, before - begin - np.searchsorted(gone, before), new)
    return np.concatenate([values[:begin], part, values[end:]])
