"""SQLite files of ROS 2 bags: ``.db3``.

They are read with Python's own sqlite3, because it reads one row at a time in order of time and then of writing,
whether or not the file has its index on time, and takes any path; the reader of rosbags does neither.
"""

from __future__ import annotations

import sqlite3
import struct
from collections.abc import Collection, Iterable, Iterator
from contextlib import ExitStack, closing
from dataclasses import dataclass
from pathlib import Path
from shlex import quote

from replay.errors import InputError
from replay.sources.base import GRID_TYPE, UPDATE_TYPE, RawMessage, SourceInfo
from replay.sources.boundary import COMMON, Closing, translated
from replay.sources.losses import Losses
from replay.sources.topics import topic_table, type_in
from replay.sources.zstd import ZstdError, decompressed_cdr

_MAGIC = b"SQLite format 3\0"
_FOREIGN = (*COMMON, sqlite3.Error, ZstdError)

_TABLES = "SELECT count(*) FROM sqlite_master WHERE type = 'table' AND name IN ('topics', 'messages')"
_TOPICS = """
    SELECT topics.id, name, type, serialization_format, count(messages.topic_id)
    FROM topics LEFT JOIN messages ON topics.id = messages.topic_id GROUP BY topics.id
"""
_TIMES = "SELECT min(timestamp), max(timestamp) FROM messages"
_ROWS = "SELECT id, topic_id, timestamp FROM messages WHERE topic_id IN ({}) ORDER BY timestamp, id"
_DATA = "SELECT data FROM messages WHERE id = ?"


@dataclass(frozen=True, slots=True)
class _Topic:
    name: str
    msgtype: str
    encoding: str
    count: int


class Sqlite3File(Closing):
    """A SQLite file of a ROS 2 bag, with or without the folder that it belongs to.

    Parameters
    ----------
    copy_of
        The file of which ``path`` is a decompressed copy, to be named in errors.
    """

    def __init__(self, path: Path, copy_of: Path | None = None) -> None:
        self.path = copy_of or path
        self.losses = Losses()
        with ExitStack() as stack, translated(self.path, _FOREIGN):
            _check_whole(path.resolve(), self.path)
            # Immutable, so that not even a lock file is left beside the recording.
            uri = f"{path.resolve().as_uri()}?mode=ro&immutable=1"
            # opened in one thread and read in another, but never in two at once
            self._database = stack.enter_context(closing(sqlite3.connect(uri, uri=True, check_same_thread=False)))
            if self._database.execute(_TABLES).fetchone() != (2,):
                raise InputError(
                    f"{self.path}: this SQLite file is no ROS 2 bag: 'topics' and 'messages' were expected"
                )
            self._topics = {key: _Topic(*row) for key, *row in self._database.execute(_TOPICS)}
            self._check_encodings(each for each in self._topics.values() if each.msgtype in {GRID_TYPE, UPDATE_TYPE})
            self._start_ns, self._stop_ns = self._database.execute(_TIMES).fetchone()
            self._resources = stack.pop_all()

    @classmethod
    def recognises(cls, path: Path, head: bytes) -> bool:
        """Tell whether this is a SQLite file."""
        del path
        return head.startswith(_MAGIC)

    @property
    def info(self) -> SourceInfo:
        """What the file holds."""
        rows = ((each.name, type_in(each.encoding, each.msgtype), each.count) for each in self._topics.values())
        return SourceInfo("sqlite3", self._start_ns, self._stop_ns, topic_table(rows))

    def messages(self, topics: Collection[str]) -> Iterator[RawMessage]:
        """Yield the messages of these topics in order of log time, ties in the order in which they were written."""
        with translated(self.path, _FOREIGN):
            wanted = {key: topic for key, topic in self._topics.items() if topic.name in topics}
            self._check_encodings(wanted.values())
            rows = self._database.execute(_ROWS.format(", ".join("?" * len(wanted))), list(wanted))
            for key, topic_id, log_time_ns in rows:
                topic = wanted[topic_id]
                (data,) = self._database.execute(_DATA, (key,)).fetchone()
                yield RawMessage(topic.name, topic.msgtype, "cdr", log_time_ns, decompressed_cdr(data))

    def close(self) -> None:
        """Close the file."""
        self._resources.close()

    def _check_encodings(self, topics: Iterable[_Topic]) -> None:
        for topic in topics:
            if topic.encoding != "cdr":
                raise InputError(
                    f"{self.path}: topic {topic.name} is serialised as '{topic.encoding}'; cdr is read: "
                    "convert the recording with `ros2 bag convert`"
                )


def _check_whole(path: Path, shown: Path) -> None:
    """Refuse a database that is not all in its file, because SQLite would leave out rows without a word."""
    for suffix, content in (("-wal", "messages that are not in the file"), ("-journal", "an unfinished change")):
        beside = path.with_name(path.name + suffix)
        if beside.is_file() and beside.stat().st_size > 0:
            raise InputError(
                f"{shown}: the recording was not closed: {beside.name} beside it holds {content} and would be lost; "
                f"complete the file first: sqlite3 {quote(str(path))} 'PRAGMA wal_checkpoint(TRUNCATE)'"
            )
    with path.open("rb") as file:
        head = file.read(100)
    (page_size,) = struct.unpack_from(">H", head, 16)
    changed, page_count = struct.unpack_from(">II", head, 24)
    (valid_for,) = struct.unpack_from(">I", head, 92)
    # The header stores 65536 as 1, and says at which change its count of pages was right.
    size, expected = path.stat().st_size, (65536 if page_size == 1 else page_size) * page_count
    if changed == valid_for and size < expected:
        raise InputError(f"{shown}: the file ends early at byte {size}: it should have {expected} bytes; copy it again")
