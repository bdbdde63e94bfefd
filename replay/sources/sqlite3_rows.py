"""The tables of a ROS 2 bag in a SQLite file: by SQLite, or from what is left of the file."""

from __future__ import annotations

import sqlite3
from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from contextlib import suppress
from typing import BinaryIO, NamedTuple, Protocol

from replay.skip_cause import SkipCause
from replay.sources.losses import Loss, Losses
from replay.sources.sqlite3_salvage import BadPageError, Cell, Gap, Header, Pages, Rows, Table, Value, record_of
from replay.words import counted

_TOPICS = "SELECT * FROM topics"
_DEFINITIONS = "SELECT * FROM message_definitions"
# The index on time may be damaged while the table is not.
_COUNTS = "SELECT topic_id, count(*) FROM messages NOT INDEXED GROUP BY topic_id"
# SQLite counts what is smallest, which is an index if there is one.
_INDEXED = "SELECT count(*) FROM messages"
_TIMES = "SELECT min(timestamp), max(timestamp) FROM messages"
# Slower. The index on time may be damaged, and texts and bytes sort after all numbers.
_TIMES_THAT_ARE = f"{_TIMES} NOT INDEXED WHERE typeof(timestamp) = 'integer'"
_ROWS = "SELECT timestamp, id, topic_id FROM messages WHERE topic_id IN ({}) ORDER BY timestamp, id"
_DATA = "SELECT timestamp, topic_id, data FROM messages WHERE id = ?"


class Row(NamedTuple):
    """Where a message is; sorts by time, then as written."""

    log_time_ns: int
    key: int
    topic_id: int


class NoBagError(Exception):
    """The file has not the tables of a ROS 2 bag, or they cannot be told."""


class BadRowError(Exception):
    """The row of a message cannot be read."""


Record = Mapping[str, Value]


class BagTables(Protocol):
    """What is read of the tables."""

    def topics(self) -> list[Record]:
        """Return the rows of ``topics``."""

    def definitions(self) -> list[Record]:
        """Return the rows of ``message_definitions``; none if there is no such table."""

    def counts(self) -> Mapping[Value, int]:
        """Return how many messages each topic has."""

    def indexed(self) -> int:
        """Return how many messages there should be."""

    def times_ns(self) -> tuple[int, int] | None:
        """Return the times of the first and last message."""

    def rows(self, topic_ids: Collection[int]) -> Iterator[Row]:
        """Yield where the messages of these topics are, in order."""

    def data(self, row: Row) -> bytes:
        """Return the data of a message.

        Raises
        ------
        BadRowError
            If it is not there.
        """


class SqliteTables:
    """The tables as SQLite reads them; its errors pass."""

    def __init__(self, database: sqlite3.Connection) -> None:
        self._database = database
        database.text_factory = lambda text: text.decode("utf-8", "replace")
        names = {name for (name,) in database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
        if not {"topics", "messages"} <= names:
            raise NoBagError("'topics' and 'messages' were expected")
        self._has_definitions = "message_definitions" in names

    def topics(self) -> list[Record]:
        """Return the rows of ``topics``."""
        return self._records(_TOPICS)

    def definitions(self) -> list[Record]:
        """Return the rows of ``message_definitions``; none if there is no such table."""
        return self._records(_DEFINITIONS) if self._has_definitions else []

    def counts(self) -> Mapping[Value, int]:
        """Return how many messages each topic has."""
        return dict(self._database.execute(_COUNTS))

    def indexed(self) -> int:
        """Return how many messages the index on time lists; those that are there, without one."""
        (count,) = self._database.execute(_INDEXED).fetchone()
        return int(count)

    def times_ns(self) -> tuple[int, int] | None:
        """Return the times of the first and last message; None if there is none."""
        for query in (_TIMES, _TIMES_THAT_ARE):
            start_ns, stop_ns = self._database.execute(query).fetchone()
            if isinstance(start_ns, int) and isinstance(stop_ns, int):
                return start_ns, stop_ns
        return None

    def rows(self, topic_ids: Collection[int]) -> Iterator[Row]:
        """Yield where the messages of these topics are, in order."""
        rows = self._database.execute(_ROWS.format(", ".join("?" * len(topic_ids))), list(topic_ids))
        return map(Row._make, rows)

    def data(self, row: Row) -> bytes:
        """Return the data of a message."""
        try:
            found = self._database.execute(_DATA, (row.key,)).fetchone()
        except sqlite3.DatabaseError as error:
            raise BadRowError(" ".join(str(error).split())) from error
        if found is None or found[:2] != (row.log_time_ns, row.topic_id):
            raise BadRowError("the index on time lists it otherwise than it is")
        if not isinstance(found[2], bytes):
            raise BadRowError(f"its data is {type(found[2]).__name__}, not bytes")
        return found[2]

    def _records(self, query: str) -> list[Record]:
        rows = self._database.execute(query)
        names = [column[0] for column in rows.description]
        return [dict(zip(names, row, strict=True)) for row in rows]


class SalvagedTables:
    """The tables as far as they are there.

    Parameters
    ----------
    size
        How many bytes of the file are there.
    losses
        Takes what is lost.
    """

    def __init__(self, file: BinaryIO, size: int, header: Header, losses: Losses) -> None:
        self._pages = Pages(file, size, header)
        self._losses = losses
        self._cells: dict[int, Cell] = {}
        self._rows: list[Row] = []
        try:
            self._tables = self._pages.tables()
        except BadPageError as error:
            raise NoBagError(str(error)) from error
        if not {"topics", "messages"} <= self._tables.keys():
            raise NoBagError("'topics' and 'messages' were expected")
        # before the messages, because what they take is theirs
        self._topics = self._records("topics")
        self._definitions = self._records("message_definitions") if "message_definitions" in self._tables else []
        if not self._topics:
            raise NoBagError("none of its topics is left")
        missing = (header.pages or 0) - self._pages.count
        if missing <= 0 and size % header.page_bytes:
            detail = f"the file has {size} bytes, which are not whole pages of {header.page_bytes}: some are too many"
            losses.add(Loss(SkipCause.DAMAGED, "the file", detail, 0))
        self._find_messages(f"byte {size}" if missing > 0 else "", f"{missing} of its {header.pages} pages are missing")

    def topics(self) -> list[Record]:
        """Return the rows of ``topics`` that are there."""
        return self._topics

    def definitions(self) -> list[Record]:
        """Return the rows of ``message_definitions`` that are there."""
        return self._definitions

    def counts(self) -> Mapping[Value, int]:
        """Return how many messages of each topic are there."""
        return Counter(row.topic_id for row in self._rows)

    def indexed(self) -> int:
        """Return how many messages are there; what is lost is named already."""
        return len(self._rows)

    def times_ns(self) -> tuple[int, int] | None:
        """Return the times of the first and last message that are there."""
        return (self._rows[0].log_time_ns, self._rows[-1].log_time_ns) if self._rows else None

    def rows(self, topic_ids: Collection[int]) -> Iterator[Row]:
        """Yield where the messages of these topics are, in order."""
        return (row for row in self._rows if row.topic_id in topic_ids)

    def data(self, row: Row) -> bytes:
        """Return the data of a message."""
        columns = self._tables["messages"].columns
        try:
            data = record_of(self._pages.payload(self._cells[row.key]))[columns.index("data")]
        except (BadPageError, IndexError) as error:
            raise BadRowError(str(error)) from error
        if not isinstance(data, bytes):
            raise BadRowError(f"its data is {type(data).__name__}, not bytes")
        return data

    def _records(self, name: str) -> list[Record]:
        table = self._tables[name]
        found = self._pages.rows(table.root)
        for gap in found.gaps:
            # what is beyond the end of the file is named as that
            if gap.page <= self._pages.count:
                self._losses.add(_page_loss(gap, f"a part of the table '{name}'"))
        return [_named(table, key, record) for key, record in self._pages.records(found.cells)]

    def _find_messages(self, cut: str, missing: str) -> None:
        """Take in the messages that are there, and name what is lost."""
        table = self._tables["messages"]
        known = {row.get("id") for row in self._topics}
        found = self._pages.rows(table.root, lambda cell: _is_message(table, cell, known))
        whole = self._pages.whole(found.cells)
        for cell in whole:
            with suppress(BadPageError, KeyError):
                row = _row(table, cell)
                self._cells[cell.key] = cell
                self._rows.append(row)
        self._rows.sort()
        lost = _lost(found, len(self._rows))
        if cut:
            detail = f"the file ends early: {missing}; {counted(len(self._rows), 'message')} could be read"
            self._losses.add(Loss(SkipCause.ENDS_EARLY, cut, detail, lost))
            return
        for gap in found.gaps:
            self._losses.add(_page_loss(gap, "messages"))
        for cell in found.cells:
            if cell.key not in self._cells:
                detail = "its pages are missing, another message's, or no message's"
                self._losses.add(Loss(SkipCause.DAMAGED, f"message {cell.key}", detail, 1))


def _named(table: Table, key: int, record: list[Value]) -> Record:
    """Return a row with the names of its columns; the one that is the key is not in its record."""
    named = dict(zip(table.columns, record, strict=False))
    return {**named, "id": key} if named.get("id") is None else named


def _row(table: Table, cell: Cell) -> Row:
    record = _named(table, cell.key, record_of(cell.head, cell.size))
    time_ns, topic_id = record["timestamp"], record["topic_id"]
    if not isinstance(time_ns, int) or not isinstance(topic_id, int):
        raise BadPageError("it is no message")
    return Row(time_ns, cell.key, topic_id)


def _is_message(table: Table, cell: Cell, topic_ids: Collection[Value]) -> bool:
    try:
        return _row(table, cell).topic_id in topic_ids
    except (BadPageError, KeyError):
        return False


def _lost(found: Rows, count: int) -> int | None:
    """Return how many messages are lost, as their keys are counted up from 1; None if the last one is not known."""
    if any(gap.high is None for gap in found.gaps):
        return None
    last = max([cell.key for cell in found.cells] + [gap.high or 0 for gap in found.gaps], default=0)
    return max(0, last - count)


def _page_loss(gap: Gap, what: str) -> Loss:
    messages = None if gap.high is None or what != "messages" else gap.high - gap.low
    return Loss(SkipCause.DAMAGED, f"page {gap.page}", f"{what} cannot be read: the page is damaged", messages)
