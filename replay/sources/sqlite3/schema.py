"""The tables of a SQLite file, by the statements that made them."""

from __future__ import annotations

import re
import sqlite3
from contextlib import closing
from dataclasses import dataclass

_CREATE = re.compile(r"CREATE TABLE [^()]*\(", re.IGNORECASE)
_LONGEST_CHARS = 1 << 16


@dataclass(frozen=True, slots=True)
class Table:
    """A table: its first page, and the names of its columns; that of the key is None in each record."""

    root: int
    columns: tuple[str, ...]


def columns_of(sql: str) -> tuple[str, ...]:
    """Return the names of a table's columns, as SQLite understands what made it; none if it does not."""
    if not _CREATE.match(sql) or len(sql) > _LONGEST_CHARS:
        return ()
    with closing(sqlite3.connect(":memory:")) as database:
        try:
            database.execute(sql)
            (name,) = database.execute("SELECT name FROM sqlite_master WHERE type = 'table'").fetchone()
            quoted = str(name).replace('"', '""')
            return tuple(row[1] for row in database.execute(f'PRAGMA table_info("{quoted}")'))
        except (sqlite3.Error, TypeError):
            return ()
