"""The tables of a ROS 2 bag as SQLite reads them."""

from __future__ import annotations

import sqlite3
from collections.abc import Collection, Iterator, Mapping

from replay.sources.memory import TooLargeError
from replay.sources.sqlite3.record import Value
from replay.sources.sqlite3.tables import BadRowError, NoBagError, Record, Row

_TOPICS = "SELECT * FROM topics"
_DEFINITIONS = "SELECT * FROM message_definitions"
# The index on time is not used: it may be damaged while the table is not. Texts and bytes sort after all numbers.
_COUNTS = (
    "SELECT topic_id, count(*), min(CASE WHEN typeof(timestamp) = 'integer' THEN timestamp END), "
    "max(CASE WHEN typeof(timestamp) = 'integer' THEN timestamp END) FROM messages NOT INDEXED GROUP BY topic_id"
)
# SQLite counts what is smallest, which is an index if there is one.
_INDEXED = "SELECT count(*) FROM messages"
_ROWS = (
    "SELECT timestamp, {key}, topic_id FROM messages NOT INDEXED WHERE topic_id IN ({ids}) ORDER BY timestamp, {key}"
)
# To know how long it is, SQLite does not read it.
_DATA = (
    "SELECT length(data) > :most, CASE WHEN length(data) <= :most THEN data END FROM messages NOT INDEXED "
    "WHERE {key} = :key"
)

# what texts, such as definitions of messages, may be as long as where messages may not
_LEAST_LIMIT_BYTES = 1 << 20


class SqliteTables:
    """The tables as SQLite reads them; its errors pass.

    Parameters
    ----------
    most_bytes
        The longest value that SQLite may make: columns may be defined to be computed, and then be longer than the file.
    """

    def __init__(self, database: sqlite3.Connection, most_bytes: int) -> None:
        self._database = database
        database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, min(max(most_bytes, _LEAST_LIMIT_BYTES), (1 << 31) - 1))
        database.text_factory = lambda text: text.decode("utf-8", "replace")
        names = {name for (name,) in database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
        if not {"topics", "messages"} <= names:
            raise NoBagError("'topics' and 'messages' were expected")
        self._has_definitions = "message_definitions" in names
        self._key = _key_column(database)
        self._counted = database.execute(_COUNTS).fetchall()

    def topics(self) -> list[Record]:
        """Return the rows of ``topics``."""
        return self._records(_TOPICS)

    def definitions(self) -> list[Record]:
        """Return the rows of ``message_definitions``; none if there is no such table."""
        return self._records(_DEFINITIONS) if self._has_definitions else []

    def counts(self) -> Mapping[Value, int]:
        """Return how many messages each topic has."""
        return {topic_id: count for topic_id, count, _, _ in self._counted}

    def indexed(self) -> int:
        """Return how many messages the index on time lists; those that are there, without one."""
        (count,) = self._database.execute(_INDEXED).fetchone()
        return int(count)

    def times_ns(self) -> tuple[int, int] | None:
        """Return the times of the first and last message; None if there is none."""
        times_ns = [(start_ns, stop_ns) for _, _, start_ns, stop_ns in self._counted if start_ns is not None]
        return (min(start for start, _ in times_ns), max(stop for _, stop in times_ns)) if times_ns else None

    def rows(self, topic_ids: Collection[int]) -> Iterator[Row]:
        """Yield where the messages of these topics are, in order."""
        ids = ", ".join("?" * len(topic_ids))
        return map(Row._make, self._database.execute(_ROWS.format(key=self._key, ids=ids), list(topic_ids)))

    def data(self, row: Row, most_bytes: int) -> bytes:
        """Return the data of a message."""
        try:
            values = {"key": row.key, "most": most_bytes}
            found = self._database.execute(_DATA.format(key=self._key), values).fetchone()
        except sqlite3.DatabaseError as error:
            raise BadRowError(" ".join(str(error).split())) from error
        if found is None:
            raise BadRowError("it is not where the table lists it")
        is_larger, data = found
        if is_larger:
            raise TooLargeError(most_bytes)
        if not isinstance(data, bytes):
            raise BadRowError(f"its data is {type(data).__name__}, not bytes")
        return data

    def _records(self, query: str) -> list[Record]:
        rows = self._database.execute(query)
        names = [column[0] for column in rows.description]
        return [dict(zip(names, row, strict=True)) for row in rows]


def _key_column(database: sqlite3.Connection) -> str:
    """Return by what rows are told apart: what is called ``id`` may be the same for several, or be nothing."""
    try:
        database.execute("SELECT _rowid_ FROM messages LIMIT 0")
    except sqlite3.OperationalError:
        return "id"
    return "_rowid_"
