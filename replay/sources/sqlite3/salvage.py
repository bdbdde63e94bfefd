"""Rows of SQLite files that SQLite refuses, or of which it would return wrong ones: read from the pages themselves.

SQLite has no checksums, and takes whatever page a damaged one points to for the one that it needs. So a row counts here
only if all of it is there: its page is sound in itself, its record has the length that its parts add up to, and its
overflow pages are all in the file, are no other row's, and end where the row does.
"""

from __future__ import annotations

import functools
import itertools
import re
import sqlite3
import struct
from array import array
from bisect import bisect, insort
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from typing import BinaryIO, NamedTuple

from replay.sources.sqlite3.places import Places

_LEAF, _INTERIOR = 0x0D, 0x05
_HEADER_BYTES = 100
_LARGEST_KEY = (1 << 63) - 1
_INTEGER_SIZES = {1: 1, 2: 2, 3: 3, 4: 4, 5: 6, 6: 8}
_DEEPEST = 20
# enough for the numbers that a row begins with
_HEAD_BYTES = 64
_CREATE = re.compile(r"CREATE TABLE [^()]*\(", re.IGNORECASE)
_TREE = -1

Value = int | float | str | bytes | None


class BadPageError(Exception):
    """A page, or a row of it, is not what it should be."""


class Header(NamedTuple):
    """What a file says of its pages; ``pages`` is None where that is not up to date."""

    page_bytes: int
    usable_bytes: int
    pages: int | None


def read_header(file: BinaryIO) -> Header | None:
    """Return what the header of a SQLite file says; None if it cannot be right."""
    file.seek(0)
    head = file.read(_HEADER_BYTES)
    if len(head) < _HEADER_BYTES:
        return None
    # The header stores 65536 as 1, and says at which change its count of pages was right.
    stored, reserved = struct.unpack_from(">H", head, 16)[0], head[20]
    changed, pages = struct.unpack_from(">II", head, 24)
    (valid_for,) = struct.unpack_from(">I", head, 92)
    page_bytes = 65536 if stored == 1 else stored
    if page_bytes < 512 or page_bytes & (page_bytes - 1) or page_bytes - reserved < 480:
        return None
    return Header(page_bytes, page_bytes - reserved, pages if changed == valid_for and pages else None)


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


@dataclass(frozen=True, slots=True)
class Gap:
    """Keys above ``low`` and up to ``high`` are lost because of a page; ``high`` is None if it is not known."""

    page: int
    low: int
    high: int | None


@dataclass(frozen=True, slots=True)
class Table:
    """A table: its first page, and the names of its columns; that of the key is None in each record."""

    root: int
    columns: tuple[str, ...]


@dataclass(slots=True)
class Leaves:
    """The pages with the rows of a table that are there, and what is not.

    Attributes
    ----------
    last_key
        The largest key of a row that is there; 0 if none is.
    """

    pages: array[int] = field(default_factory=lambda: array("Q"))
    gaps: list[Gap] = field(default_factory=list)
    last_key: int = 0

    def add(self, page: int, cells: Sequence[Cell]) -> None:
        """Take in a page with its rows, which are not kept: a recording may have millions."""
        self.pages.append(page)
        self.last_key = max([self.last_key, *(cell.key for cell in cells)])


class Pages:
    """The pages of a SQLite file, as far as they are there."""

    def __init__(self, file: BinaryIO, header: Header, places: Places) -> None:
        self.count = places.count
        self.is_broken = False
        """Whether anything in the file contradicts anything else of it; that it ends early does not."""
        self.sound: list[int] = []
        """Pages that are what the pages that point to them say."""
        self._file = file
        self._header = header
        self._places = places
        # whose the page at each place is: a row's key, or that of no row but of the tree
        self._owners = array("q", bytes(8 * (places.there + 1)))

    def tables(self) -> dict[str, Table]:
        """Return the tables by name.

        Raises
        ------
        BadPageError
            If not all of them can be told.
        """
        leaves = self.leaves(1)
        if leaves.gaps:
            raise BadPageError(f"page {leaves.gaps[0].page}, which lists the tables, is damaged or missing")
        tables = {}
        for _, record in self.records(leaves):
            if len(record) == 5 and record[0] == "table" and isinstance(record[3], int):
                tables[str(record[1])] = Table(record[3], _columns(str(record[4])))
        return tables

    def leaves(self, root: int, is_row: Callable[[Cell], bool] | None = None) -> Leaves:
        """Return the pages with the rows of the table whose first page this is. It may be asked for once.

        Parameters
        ----------
        is_row
            By which rows of this table are known from those of others, to find those of which the pages that point to
            them are lost; None not to look for them.
        """
        leaves = Leaves()
        self._walk(root, 0, None, leaves, _DEEPEST)
        if leaves.gaps and is_row is not None:
            self._find_orphans(leaves, is_row)
        return leaves

    def cells(self, leaves: Leaves) -> Iterator[Cell]:
        """Yield the rows of a table that are there, those of a page at once."""
        for number in leaves.pages:
            start = self._start(number, is_sure=False)
            yield from self._leaf(self._page(start), start, _HEADER_BYTES if number == 1 else 0, 0, None)

    def records(self, leaves: Leaves) -> Iterator[tuple[int, list[Value]]]:
        """Yield key and values of the rows of a table, in order of key; those that are not whole are left out."""
        for cell in sorted(self.cells(leaves), key=lambda each: each.key):
            try:
                yield cell.key, record_of(self.payload(cell))
            except BadPageError:
                continue

    def claim(self, cell: Cell) -> set[int]:
        """Give a row its overflow pages; return the keys of rows that turn out not to be whole.

        That is the row itself if a page is missing or comes twice, and if it is another row's, that other one as well.
        """
        if cell.local_bytes == cell.size:
            return set()
        bad: set[int] = set()
        own: set[int] = set()
        try:
            for page in self._chain(cell):
                place = self._place(page)
                owner = self._owners[place]
                if owner not in {0, cell.key} or page in own:
                    self.is_broken = True
                    bad |= {cell.key, owner} - {_TREE}
                own.add(page)
                self._owners[place] = owner or cell.key
        except BadPageError:
            bad.add(cell.key)
        return bad

    def payload(self, cell: Cell) -> bytes:
        """Return the record of a row.

        Raises
        ------
        BadPageError
            If not all of it is there.
        """
        self._file.seek(cell.start)
        parts, left = [self._file.read(cell.local_bytes)], cell.size - cell.local_bytes
        for page in self._chain(cell):
            self._file.seek(self._start(page) + 4)
            parts.append(self._file.read(min(left, self._header.usable_bytes - 4)))
            left -= len(parts[-1])
        return b"".join(parts)

    def _chain(self, cell: Cell) -> Iterator[int]:
        """Yield the overflow pages of a row."""
        page, left = cell.overflow, cell.size - cell.local_bytes
        if left > self._places.there * self._header.usable_bytes:
            raise BadPageError("it is larger than the file")
        while left > 0:
            if not 2 <= page <= self.count:
                # that of a file that ends early is right all the same
                self.is_broken |= not self.count < page <= (self._header.pages or 0)
                raise BadPageError(f"overflow page {page} is missing")
            start = self._start(page)
            yield page
            self._file.seek(start)
            (page,) = struct.unpack(">I", self._file.read(4))
            left -= self._header.usable_bytes - 4
        if page:
            self.is_broken = True
            raise BadPageError("its overflow pages go on after its end")

    def _start(self, number: int, *, is_sure: bool = True) -> int:
        """Return where in the file a page begins."""
        return (self._place(number, is_sure=is_sure) - 1) * self._header.page_bytes

    def _place(self, number: int, *, is_sure: bool = True) -> int:
        place = self._places.place(number, is_sure=is_sure)
        if place is None:
            raise BadPageError(f"page {number} is missing")
        return place

    def _page(self, start: int) -> bytes:
        self._file.seek(start)
        return self._file.read(self._header.usable_bytes)

    def _walk(self, number: int, low: int, high: int | None, leaves: Leaves, depth: int) -> None:
        """Take in the rows with keys above ``low`` and up to ``high`` that are at and below a page."""
        try:
            # whether it is that page is told by its keys
            place = self._place(number, is_sure=False)
            page_start = self._start(number, is_sure=False)
            page = self._page(page_start)
            if not depth or self._owners[place]:
                raise BadPageError(f"page {number} has two places")
            start = _HEADER_BYTES if number == 1 else 0
            if page[start] == _LEAF:
                cells = self._leaf(page, page_start, start, low, high)
                children: list[tuple[int, int | None]] = []
            else:
                cells, children = [], _children(page, start, low, high)
        except (BadPageError, IndexError, struct.error):
            self.is_broken |= 1 <= number <= self.count
            leaves.gaps.append(Gap(number, low, high))
            return
        self._owners[place] = _TREE
        self.sound.append(number)
        if cells:
            leaves.add(number, cells)
        for child, key in children:
            self._walk(child, low, key, leaves, depth - 1)
            low = key or low

    def _leaf(self, page: bytes, place: int, start: int, low: int, high: int | None) -> list[Cell]:
        """Return the rows of a leaf page that begins at this byte of the file; none unless all of them are sound."""
        (count,) = struct.unpack_from(">H", page, start + 3)
        offsets = struct.unpack_from(f">{count}H", page, start + 8)
        cells, extents = [], []
        for offset in offsets:
            cell, end = self._cell(page, place, offset)
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

    def _cell(self, page: bytes, place: int, offset: int) -> tuple[Cell, int]:
        size, at = varint(page, offset)
        key, at = varint(page, at)
        local_bytes = self._local_bytes(size)
        end = at + local_bytes
        head = page[at : min(end, at + _HEAD_BYTES)]
        layout_of(head, size)
        start = place + at
        if local_bytes == size:
            return Cell(key, size, start, local_bytes, 0, head), end
        (overflow,) = struct.unpack_from(">I", page, end)
        return Cell(key, size, start, local_bytes, overflow, head), end + 4

    def _local_bytes(self, size: int) -> int:
        """Return how much of a row of this length is in its own page, as the file format has it."""
        usable = self._header.usable_bytes
        most, least = usable - 35, (usable - 12) * 32 // 255 - 23
        if size <= most:
            return size
        fitting = least + (size - least) % (usable - 4)
        return fitting if fitting <= most else least

    def _find_orphans(self, leaves: Leaves, is_row: Callable[[Cell], bool]) -> None:
        """Take in rows of pages whose parent is lost.

        An overflow page is never taken for one: it begins with the number of a page, which is less than 2 ** 24 in any
        file of less than 64 GB.
        """
        if self._places.there >= _LEAF << 24:
            return
        # first and last key of each page that was found, in order; the rows of no two pages of a table interleave
        taken: list[tuple[int, int]] = []
        for number in self._places.numbers():
            place, start = self._place(number), self._start(number)
            if self._owners[place]:
                continue
            try:
                page = self._page(start)
                cells = self._leaf(page, start, 0, 0, None) if page[0] == _LEAF else []
            except (BadPageError, IndexError, struct.error):
                continue
            if cells and all(map(is_row, cells)) and _belong(cells, leaves.gaps, taken):
                self._owners[place] = _TREE
                leaves.add(number, cells)
                insort(taken, (cells[0].key, cells[-1].key))


def _belong(cells: Sequence[Cell], gaps: Sequence[Gap], taken: Sequence[tuple[int, int]]) -> bool:
    """Tell whether all these rows are among those that are lost."""
    first, last = cells[0].key, cells[-1].key
    within = any(gap.low < first and (gap.high is None or last <= gap.high) for gap in gaps)
    place = bisect(taken, (first, first))
    is_apart = (not place or taken[place - 1][1] < first) and (place == len(taken) or last < taken[place][0])
    return within and is_apart


def _children(page: bytes, start: int, low: int, high: int | None) -> list[tuple[int, int | None]]:
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


def _columns(sql: str) -> tuple[str, ...]:
    """Return the names of a table's columns, as SQLite understands what made it."""
    if not _CREATE.match(sql) or len(sql) > 1 << 16:
        return ()
    with closing(sqlite3.connect(":memory:")) as database:
        try:
            database.execute(sql)
            (name,) = database.execute("SELECT name FROM sqlite_master WHERE type = 'table'").fetchone()
            quoted = str(name).replace('"', '""')
            return tuple(row[1] for row in database.execute(f'PRAGMA table_info("{quoted}")'))
        except (sqlite3.Error, TypeError):
            return ()
