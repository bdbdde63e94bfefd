"""The records of SQLite files: the values of a row, as they are in the file.

A record is believed only if its values add up to its length.
"""

from __future__ import annotations

import functools
import itertools
import struct
from typing import NamedTuple

_INTEGER_SIZES = {1: 1, 2: 2, 3: 3, 4: 4, 5: 6, 6: 8}

Value = int | float | str | bytes | None


class BadPageError(Exception):
    """A page, or a row of it, is not what it should be."""


def varint(data: bytes, at: int) -> tuple[int, int]:
    """Return a number of one to nine bytes, and where what follows it begins."""
    value = data[at]
    if value < 0x80:
        return value, at + 1
    value = 0
    for index in range(8):
        byte = data[at + index]
        value = value << 7 | byte & 0x7F
        if byte < 0x80:
            return value, at + index + 1
    value = value << 8 | data[at + 8]
    return (value - (1 << 64) if value >> 63 else value), at + 9


class Layout(NamedTuple):
    """What the header of a record says: the kinds of its values, where each begins, and where the last one ends."""

    kinds: tuple[int, ...]
    starts: tuple[int, ...]

    def value(self, record: bytes, index: int) -> Value:
        """Return a value of a record, or of the beginning of one.

        Raises
        ------
        BadPageError
            If there is none, or not all of it is there.
        """
        if index >= len(self.kinds) or self.starts[index + 1] > len(record):
            raise BadPageError("it has too few values")
        return _value(self.kinds[index], record[self.starts[index] : self.starts[index + 1]])


def layout_of(record: bytes, size: int) -> Layout:
    """Return the layout of a record of this length, of which the beginning is enough.

    Raises
    ------
    BadPageError
        If it has none, or its values do not add up to its length.
    """
    end, _ = varint(record, 0)
    if not 0 < end <= len(record):
        raise BadPageError("it has no header of a record")
    layout = _layout(record[:end])
    if layout.starts[-1] != size:
        raise BadPageError("its values do not add up to its length")
    return layout


# Most rows of a table begin alike.
@functools.lru_cache(maxsize=1 << 12)
def _layout(header: bytes) -> Layout:
    kinds: list[int] = []
    _, at = varint(header, 0)
    try:
        while at < len(header):
            kind, at = varint(header, at)
            kinds.append(kind)
    except IndexError as error:
        raise BadPageError("its header ends within a number") from error
    starts = itertools.accumulate(map(_value_bytes, kinds), initial=len(header))
    return Layout(tuple(kinds), tuple(starts))


def _value_bytes(kind: int) -> int:
    if kind in {10, 11} or kind < 0:
        raise BadPageError("it has a value of no kind")
    if kind >= 12:
        return (kind - 12) // 2
    return 8 if kind == 7 else _INTEGER_SIZES.get(kind, 0)


def record_of(record: bytes) -> list[Value]:
    """Return the values of a record."""
    layout = layout_of(record, len(record))
    return [layout.value(record, index) for index in range(len(layout.kinds))]


def _value(kind: int, content: bytes) -> Value:
    if kind == 0:
        return None
    if kind in {8, 9}:
        return kind - 8
    if kind == 7:
        return float(struct.unpack(">d", content)[0])
    if kind >= 12:
        return content.decode("utf-8", "replace") if kind % 2 else content
    return int.from_bytes(content, "big", signed=True)
