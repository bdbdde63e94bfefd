"""Damage to SQLite files of ROS 2 bags: to rows, to tables, to pages, and what a killed recorder leaves beside them."""

from __future__ import annotations

import sqlite3
from collections.abc import Mapping
from contextlib import closing
from pathlib import Path
from tempfile import TemporaryDirectory

from samples.world import Rng

_PAGE = 4096
_ANY_MAP = "SELECT messages.id FROM messages JOIN topics ON topics.id = topic_id WHERE name != '/chatter'"


def row_data_wrong(data: bytes, rng: Rng) -> bytes:
    """Let a row have no data, data of another type, or too little."""
    values = ("NULL", "''", "'text'", "17", "1.5", "x''", "zeroblob(100000)", "substr(data, 1, 50)", "substr(data, 3)")
    return _row_changed(data, rng, "data", values)


def row_time_wrong(data: bytes, rng: Rng) -> bytes:
    """Let a row have a time that is none."""
    values = ("NULL", "'noon'", "-5", "0", "1e300", "9223372036854775807", "-9223372036854775808", "1.5", "x'00'")
    return _row_changed(data, rng, "timestamp", values)


def row_topic_wrong(data: bytes, rng: Rng) -> bytes:
    """Let a row be of a topic that is not there."""
    return _row_changed(data, rng, "topic_id", ("NULL", "99", "-1", "'1'", "1.5", "'/r1/map'"))


def topic_wrong(data: bytes, rng: Rng) -> bytes:
    """Let a topic have a name, a type or an encoding that is none."""
    column = ("name", "type", "serialization_format")[int(rng.integers(3))]
    values = ("NULL", "''", "17", "x'ff00fe'", "char(7)", "'json'", "'../../etc/passwd'")
    return _changed(data, f"UPDATE topics SET {column} = {values[int(rng.integers(len(values)))]} WHERE id = 1")  # noqa: S608


def topic_removed(data: bytes, rng: Rng) -> bytes:
    """Leave out a topic whose messages are there."""
    return _changed(data, f"DELETE FROM topics WHERE id = {int(rng.integers(1, 5))}")  # noqa: S608


def table_wrong(data: bytes, rng: Rng) -> bytes:
    """Let tables or columns be missing, be views or have other names."""
    texts = (
        "ALTER TABLE messages RENAME TO notes",
        "ALTER TABLE topics RENAME TO subjects",
        "DROP TABLE topics",
        "ALTER TABLE messages RENAME COLUMN data TO body",
        "ALTER TABLE topics RENAME COLUMN serialization_format TO kind",
        "ALTER TABLE messages RENAME TO kept; CREATE VIEW messages AS SELECT * FROM kept",
        "ALTER TABLE messages ADD COLUMN note",
    )
    return _changed(data, texts[int(rng.integers(len(texts)))])


def schema_wrong(data: bytes, rng: Rng) -> bytes:
    """Let definitions of messages be missing, empty, others, or in a language that is not known."""
    column = "encoded_message_definition"
    others = (
        f"{column} = ''",
        f"{column} = x'ff00'",
        "encoding = 'ros3msg'",
        f"encoding = NULL, {column} = NULL",
        f"{column} = 'string note' || char(10) || {column}",
        f"{column} = replace({column}, 'float32 resolution', 'float64 resolution')",
    )
    texts = (
        "DROP TABLE message_definitions",
        "DELETE FROM message_definitions",
        *(f"UPDATE message_definitions SET {each}" for each in others),  # noqa: S608
    )
    return _changed(data, texts[int(rng.integers(len(texts)))])


def index_removed(data: bytes, rng: Rng) -> bytes:
    """Leave out the index on time, as old recorders do."""
    del rng
    return _changed(data, "DROP INDEX IF EXISTS timestamp_idx")


def row_doubled(data: bytes, rng: Rng) -> bytes:
    """Write a row twice."""
    columns, key = "topic_id, timestamp, data", _any_row(data, rng)
    return _changed(data, f"INSERT INTO messages ({columns}) SELECT {columns} FROM messages WHERE id = {key}")  # noqa: S608


def page_zeroed(data: bytes, rng: Rng) -> bytes:
    """Make a page zeros."""
    at = _page(data, rng)
    return data[:at] + bytes(_PAGE) + data[at + _PAGE :]


def pages_swapped(data: bytes, rng: Rng) -> bytes:
    """Exchange two pages."""
    one, other = sorted(_page(data, rng) for _ in range(2))
    if one == other:
        return data
    first, second = data[one : one + _PAGE], data[other : other + _PAGE]
    return data[:one] + second + data[one + _PAGE : other] + first + data[other + _PAGE :]


def cut_at_page(data: bytes, rng: Rng) -> bytes:
    """End early after a whole page."""
    return data[: _page(data, rng)]


def wal_left(name: str, data: bytes, rng: Rng) -> Mapping[str, bytes]:
    """Leave rows in a file beside the recording, as a killed recorder does."""
    with TemporaryDirectory(prefix="faults-") as folder:
        path = Path(folder) / "run.db3"
        path.write_bytes(data)
        with closing(sqlite3.connect(path)) as database:
            database.execute("PRAGMA journal_mode=WAL").fetchall()
            database.execute("PRAGMA wal_autocheckpoint=0").fetchall()
            rows = database.execute("SELECT * FROM messages ORDER BY timestamp").fetchall()
            kept = int(rng.integers(len(rows)))
            database.execute("DELETE FROM messages WHERE timestamp >= ?", (rows[kept][2],))
            database.commit()
            database.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchall()
            for row in rows[kept:]:
                database.execute(f"INSERT INTO messages VALUES ({', '.join('?' * len(row))})", row)  # noqa: S608
                database.commit()
            # What is there while the recorder is alive is what is left when it is killed.
            wal = path.with_name(path.name + "-wal").read_bytes()
            left = {name: path.read_bytes(), f"{name}-wal": wal}
    return left


def wal_damaged(name: str, data: bytes, rng: Rng) -> Mapping[str, bytes]:
    """Leave rows in a file beside the recording that is damaged as well."""
    left = dict(wal_left(name, data, rng))
    wal = bytearray(left[f"{name}-wal"])
    if rng.uniform() < 0.5:
        del wal[int(rng.integers(len(wal))) :]
    else:
        wal[int(rng.integers(len(wal)))] ^= 1 << int(rng.integers(8))
    return {**left, f"{name}-wal": bytes(wal)}


def journal_left(name: str, data: bytes, rng: Rng) -> Mapping[str, bytes]:
    """Leave a journal beside the recording."""
    return {name: data, f"{name}-journal": rng.bytes(int(rng.integers(0, 2000)))}


def _row_changed(data: bytes, rng: Rng, column: str, values: tuple[str, ...]) -> bytes:
    value = values[int(rng.integers(len(values)))]
    return _changed(data, f"UPDATE messages SET {column} = {value} WHERE id = {_any_row(data, rng)}")  # noqa: S608


def _any_row(data: bytes, rng: Rng) -> int:
    with closing(_opened(data)) as database:
        keys = [int(key) for (key,) in database.execute(f"{_ANY_MAP} ORDER BY messages.id")]
    return keys[int(rng.integers(len(keys)))] if keys else 0


def _changed(data: bytes, text: str) -> bytes:
    with closing(_opened(data)) as database:
        # Columns that may not be NULL are made so that they may, as in files that others wrote.
        database.execute("PRAGMA writable_schema=ON")
        database.execute("UPDATE sqlite_master SET sql = replace(sql, ' NOT NULL', '') WHERE type = 'table'")
        database.commit()
        data = database.serialize()
    with closing(_opened(data)) as database:
        database.executescript(text)
        database.commit()
        return database.serialize()


def _opened(data: bytes) -> sqlite3.Connection:
    database = sqlite3.connect(":memory:")
    database.deserialize(data)
    return database


def _page(data: bytes, rng: Rng) -> int:
    return _PAGE * int(rng.integers(0, max(1, len(data) // _PAGE)))
