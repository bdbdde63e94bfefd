"""The tables of a ROS 2 bag from what is left of the pages of its file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import BinaryIO

from replay.skip_cause import SkipCause
from replay.sources.base import DECODED_TYPES
from replay.sources.boundary import COPY_AGAIN
from replay.sources.lapses import AT_END, Written
from replay.sources.losses import Loss, Losses
from replay.sources.memory import TooLargeError
from replay.sources.sqlite3.header import Header
from replay.sources.sqlite3.losses import displacement, early_end, gap_lapse, key_lapse, lost_messages, page_loss
from replay.sources.sqlite3.page import Cell
from replay.sources.sqlite3.pages import Pages
from replay.sources.sqlite3.places import own_places, told_places
from replay.sources.sqlite3.record import BadPageError, Value, layout_of, record_of
from replay.sources.sqlite3.schema import Table
from replay.sources.sqlite3.tables import BadRowError, NoBagError, Record, Row
from replay.sources.topics import normalised_type
from replay.words import counted

# what the record of a message has besides its data, at most
_MOST_BESIDE_BYTES = 64


def salvaged_tables(file: BinaryIO, size: int, header: Header, losses: Losses) -> SalvagedTables:
    """Return the tables as far as they are there, and name what is lost.

    Parameters
    ----------
    size
        How many bytes of the file are there.

    Raises
    ------
    NoBagError
        If the tables cannot be told.
    """
    there = size // header.page_bytes
    pages, tables, error = Pages(file, header, own_places(there)), None, NoBagError()
    try:
        tables = SalvagedTables(pages)
    except NoBagError as found:
        error = found
    expected_bytes = (header.pages or there) * header.page_bytes
    if size != expected_bytes:
        places = told_places(file, header.page_bytes, there, header.pages, pages.sound)
        # A file that merely ends early does not contradict itself.
        if tables is None or pages.is_broken or places.is_displaced or size > expected_bytes:
            tables = SalvagedTables(Pages(file, header, places))
            tables.name_losses(losses, displacement(places))
            return tables
    if tables is None:
        raise error
    missing = (header.pages or 0) - there
    tables.name_losses(losses, early_end(size, missing, header) if missing > 0 else None)
    return tables


class SalvagedTables:
    """The tables as far as they are there."""

    def __init__(self, pages: Pages) -> None:
        self._pages = pages
        self._losses: list[Loss] = []
        try:
            self._tables = pages.tables()
        except BadPageError as error:
            raise NoBagError(str(error)) from error
        if not {"topics", "messages"} <= self._tables.keys():
            raise NoBagError("'topics' and 'messages' were expected")
        # before the messages, because what they take is theirs
        self._topics = self._records("topics")
        self._definitions = self._records("message_definitions") if "message_definitions" in self._tables else []
        if not self._topics:
            raise NoBagError("none of its topics is left")
        table = self._tables["messages"]
        known = {row.get("id") for row in self._topics}
        self._leaves = self._pages.leaves(table.root, lambda cell: _is_message(table, cell, known))
        self._bad: set[int] = set()
        self._found = self._collected({key for row in self._topics if (key := _used_topic(row)) is not None})

    def name_losses(self, losses: Losses, whole: Loss | None = None) -> None:
        """Name what is lost.

        Parameters
        ----------
        whole
            What is wrong with the file as a whole, if that is known: then messages are not named one by one.
        """
        for loss in self._losses:
            losses.add(loss)
        gaps, count = self._leaves.gaps, self._found.counts.total()
        # keys are counted up as messages are written
        rows = self._found.rows if gaps or self._bad else []
        written = Written(((row.key, 0), row.log_time_ns) for row in rows)
        if whole is not None:
            detail = f"{whole.detail}; {counted(count, 'message')} could be read; {COPY_AGAIN}"
            losses.add(replace(whole, detail=detail, messages=lost_messages(self._leaves, count), lapse=AT_END))
            for lapse in (*(gap_lapse(written, gap) for gap in gaps), *(key_lapse(written, key) for key in self._bad)):
                losses.add_lapse("", lapse)
            return
        for gap in gaps:
            losses.add(replace(page_loss(gap, "messages"), lapse=gap_lapse(written, gap)))
        for key in sorted(self._bad):
            if key > 0:
                detail = "its pages are missing, another message's, or no message's"
                losses.add(Loss(SkipCause.DAMAGED, f"message {key}", detail, 1, lapse=key_lapse(written, key)))

    def topics(self) -> list[Record]:
        """Return the rows of ``topics`` that are there."""
        return self._topics

    def definitions(self) -> list[Record]:
        """Return the rows of ``message_definitions`` that are there."""
        return self._definitions

    def counts(self) -> Mapping[Value, int]:
        """Return how many messages of each topic are there."""
        return self._found.counts

    def indexed(self) -> int:
        """Return how many messages are there; what is lost is named already."""
        return sum(self._found.counts.values())

    def times_ns(self) -> tuple[int, int] | None:
        """Return the times of the first and last message that are there."""
        return self._found.times_ns

    def rows(self, topic_ids: Collection[int]) -> Iterator[Row]:
        """Yield where the messages of these topics are, in order."""
        if not self._found.kept.issuperset(each for each in topic_ids if self._found.counts[each]):
            self._found = self._collected(self._found.kept.union(topic_ids))
        return (row for row in self._found.rows if row.topic_id in topic_ids)

    def data(self, row: Row, most_bytes: int) -> bytes:
        """Return the data of a message."""
        cell = self._found.cells[row.key]
        if cell.size - _MOST_BESIDE_BYTES > most_bytes:
            raise TooLargeError(most_bytes)
        columns = self._tables["messages"].columns
        try:
            data = record_of(self._pages.payload(cell))[columns.index("data")]
        except (BadPageError, IndexError) as error:
            raise BadRowError(str(error)) from error
        if not isinstance(data, bytes):
            raise BadRowError(f"its data is {type(data).__name__}, not bytes")
        return data

    def _records(self, name: str) -> list[Record]:
        table = self._tables[name]
        leaves = self._pages.leaves(table.root)
        for gap in leaves.gaps:
            # what is beyond the end of the file is named as that
            if gap.page <= self._pages.count:
                self._losses.append(page_loss(gap, f"a part of the table '{name}'"))
        return [_named(table, key, record) for key, record in self._pages.records(leaves)]

    def _collected(self, topic_ids: Collection[int]) -> _Found:
        """Return how many messages are there and, of these topics, where they are."""
        while True:
            found, is_final = _Found(frozenset(topic_ids)), True
            for cell in self._pages.cells(self._leaves):
                bad = self._pages.claim(cell) - self._bad
                # A row that was added may turn out to share a page with a later one.
                is_final &= bad <= {cell.key}
                self._bad |= bad
                if cell.key not in self._bad:
                    self._add(found, cell)
            if is_final:
                found.rows.sort()
                return found

    def _add(self, found: _Found, cell: Cell) -> None:
        try:
            found.add(_row(self._tables["messages"], cell), cell)
        except BadPageError:
            self._bad.add(cell.key)


@dataclass(slots=True)
class _Found:
    """The messages that are there.

    Parameters
    ----------
    kept
        Topics of which it is kept where the messages are; of the others, how many there are.
    """

    kept: frozenset[int]
    counts: Counter[Value] = field(default_factory=Counter)
    times_ns: tuple[int, int] | None = None
    rows: list[Row] = field(default_factory=list)
    cells: dict[int, Cell] = field(default_factory=dict)

    def add(self, row: Row, cell: Cell) -> None:
        """Take in a message."""
        first_ns, last_ns = self.times_ns or (row.log_time_ns, row.log_time_ns)
        self.times_ns = min(first_ns, row.log_time_ns), max(last_ns, row.log_time_ns)
        self.counts[row.topic_id] += 1
        if row.topic_id in self.kept:
            self.rows.append(row)
            self.cells[row.key] = cell


def _named(table: Table, key: int, record: list[Value]) -> Record:
    """Return a row with the names of its columns; the one that is the key is not in its record."""
    named = dict(zip(table.columns, record, strict=False))
    return {**named, "id": key} if named.get("id") is None else named


def _row(table: Table, cell: Cell) -> Row:
    layout = layout_of(cell.head, cell.size)
    try:
        time_ns = layout.value(cell.head, table.columns.index("timestamp"))
        topic_id = layout.value(cell.head, table.columns.index("topic_id"))
    except ValueError as error:
        raise BadPageError("its table has no such column") from error
    if not isinstance(time_ns, int) or not isinstance(topic_id, int):
        raise BadPageError("it is no message")
    return Row(time_ns, cell.key, topic_id)


def _is_message(table: Table, cell: Cell, topic_ids: Collection[Value]) -> bool:
    try:
        return _row(table, cell).topic_id in topic_ids
    except BadPageError:
        return False


def _used_topic(row: Record) -> int | None:
    """Return the id of a topic whose messages may be asked for: of maps and transforms."""
    key, msgtype = row.get("id"), row.get("type")
    return key if isinstance(key, int) and normalised_type(str(msgtype)) in DECODED_TYPES else None
