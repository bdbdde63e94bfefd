"""The pages of SQLite files that SQLite refuses, or of which it would return wrong rows.

SQLite has no checksums, and takes whatever page a damaged one points to for the one that it needs. So a row counts here
only if all of it is there: its page is sound in itself, its record has the length that its parts add up to, and its
overflow pages are all in the file, are no other row's, and end where the row does.
"""

from __future__ import annotations

import struct
from array import array
from bisect import bisect, insort
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import BinaryIO

from replay.sources.sqlite3.header import HEADER_BYTES, Header
from replay.sources.sqlite3.page import LEAF, Cell, cells_of, children_of
from replay.sources.sqlite3.places import Places
from replay.sources.sqlite3.record import BadPageError, Value, record_of
from replay.sources.sqlite3.schema import Table, columns_of

_DEEPEST = 20
_TREE = -1


@dataclass(frozen=True, slots=True)
class Gap:
    """Keys above ``low`` and up to ``high`` are lost because of a page; ``high`` is None if it is not known."""

    page: int
    low: int
    high: int | None


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
                tables[str(record[1])] = Table(record[3], columns_of(str(record[4])))
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
            yield from self._leaf(self._page(start), start, HEADER_BYTES if number == 1 else 0, 0, None)

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
            start = HEADER_BYTES if number == 1 else 0
            if page[start] == LEAF:
                cells = self._leaf(page, page_start, start, low, high)
                children: list[tuple[int, int | None]] = []
            else:
                cells, children = [], children_of(page, start, low, high)
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
        return cells_of(page, self._header.usable_bytes, place, start, (low, high))

    def _find_orphans(self, leaves: Leaves, is_row: Callable[[Cell], bool]) -> None:
        """Take in rows of pages whose parent is lost.

        An overflow page is never taken for one: it begins with the number of a page, which is less than 2 ** 24 in any
        file of less than 64 GB.
        """
        if self._places.there >= LEAF << 24:
            return
        # first and last key of each page that was found, in order; the rows of no two pages of a table interleave
        taken: list[tuple[int, int]] = []
        for number in self._places.numbers():
            place, start = self._place(number), self._start(number)
            if self._owners[place]:
                continue
            try:
                page = self._page(start)
                cells = self._leaf(page, start, 0, 0, None) if page[0] == LEAF else []
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
