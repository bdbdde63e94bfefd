"""The rows of one page of a SQLite file, and the pages below one."""

from __future__ import annotations

import struct
from typing import NamedTuple

from replay.sources.sqlite3.record import BadPageError, layout_of, varint

LEAF, _INTERIOR = 0x0D, 0x05
_LARGEST_KEY = (1 << 63) - 1
# enough for the numbers that a row begins with
_HEAD_BYTES = 64


class Cell(NamedTuple):
    """Where a row is.

    Parameters
    ----------
    size
        Length of its record.
    start, local_bytes
        Where in the file its record begins, and how much of it is there.
    overflow
        The page with what follows; 0 if nothing does.
    head
        How its record begins.
    """

    key: int
    size: int
    start: int
    local_bytes: int
    overflow: int
    head: bytes


def cells_of(page: bytes, usable_bytes: int, place: int, start: int, between: tuple[int, int | None]) -> list[Cell]:
    """Return the rows of a leaf page; none unless all of them are sound.

    Parameters
    ----------
    usable_bytes
        How many bytes of a page are used for rows.
    place
        Byte of the file at which it begins.
    start
        Where in it the list of its rows begins.
    between
        Its keys are above the one, and up to the other, if that is known.

    Raises
    ------
    BadPageError, IndexError, struct.error
        If it is not sound.
    """
    low, high = between
    (count,) = struct.unpack_from(">H", page, start + 3)
    offsets = struct.unpack_from(f">{count}H", page, start + 8)
    cells, extents = [], []
    for offset in offsets:
        cell, end = _cell(page, usable_bytes, place, offset)
        if not low < cell.key <= (_LARGEST_KEY if high is None else high):
            raise BadPageError("keys are not in order")
        low = cell.key
        cells.append(cell)
        extents.append((offset, end))
    extents.sort()
    ends = [start + 8 + 2 * count, *(end for _, end in extents)]
    if any(offset < end for (offset, _), end in zip(extents, ends, strict=False)) or ends[-1] > len(page):
        raise BadPageError("rows overlap")
    return cells


def _cell(page: bytes, usable_bytes: int, place: int, offset: int) -> tuple[Cell, int]:
    size, at = varint(page, offset)
    key, at = varint(page, at)
    local_bytes = _local_bytes(size, usable_bytes)
    end = at + local_bytes
    head = page[at : min(end, at + _HEAD_BYTES)]
    layout_of(head, size)
    start = place + at
    if local_bytes == size:
        return Cell(key, size, start, local_bytes, 0, head), end
    (overflow,) = struct.unpack_from(">I", page, end)
    return Cell(key, size, start, local_bytes, overflow, head), end + 4


def _local_bytes(size: int, usable: int) -> int:
    """Return how much of a row of this length is in its own page, as the file format has it."""
    most, least = usable - 35, (usable - 12) * 32 // 255 - 23
    if size <= most:
        return size
    fitting = least + (size - least) % (usable - 4)
    return fitting if fitting <= most else least


def children_of(page: bytes, start: int, low: int, high: int | None) -> list[tuple[int, int | None]]:
    """Return the pages below an interior page, each with the largest key that it may have."""
    if page[start] != _INTERIOR:
        raise BadPageError("it is no page of a table")
    count, _, _, last = struct.unpack_from(">HHBI", page, start + 3)
    children: list[tuple[int, int | None]] = []
    for place in struct.unpack_from(f">{count}H", page, start + 12):
        (child,) = struct.unpack_from(">I", page, place)
        key, _ = varint(page, place + 4)
        if not low < key <= (_LARGEST_KEY if high is None else high):
            raise BadPageError("keys are not in order")
        children.append((child, key))
        low = key
    return [*children, (last, high)]
