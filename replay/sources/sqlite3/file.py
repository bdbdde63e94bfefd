"""SQLite files of ROS 2 bags: ``.db3``.

They are read with Python's own sqlite3, because it reads one row at a time in order of time and then of writing,
whatever the file's index on time says, and takes any path; the reader of rosbags does neither. What SQLite refuses, or
would read wrongly because the file ends early, is read from its pages.
"""

from __future__ import annotations

import errno
import sqlite3
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass
from pathlib import Path

from replay.errors import InputError
from replay.skip_cause import SkipCause
from replay.sources.base import DECODED_TYPES, RawMessage, SourceInfo
from replay.sources.boundary import COMMON, Closing, translated
from replay.sources.definitions.difference import differing_field
from replay.sources.lapses import Lapse, lapse_of
from replay.sources.losses import Loss, Losses
from replay.sources.memory import MOST_BYTES, TooLargeError
from replay.sources.sqlite3.beside import beside, plain_file
from replay.sources.sqlite3.header import read_header
from replay.sources.sqlite3.salvaged_tables import salvaged_tables
from replay.sources.sqlite3.sqlite_tables import SqliteTables
from replay.sources.sqlite3.tables import BadRowError, BagTables, NoBagError, Record, Row
from replay.sources.topics import normalised_type, topic_table, type_in
from replay.sources.zstd import ZstdError, decompressed_cdr

_MAGIC = b"SQLite format 3\0"
_FOREIGN = (*COMMON, sqlite3.Error, ZstdError)


@dataclass(frozen=True, slots=True)
class _Topic:
    """A topic; ``problem`` says why its messages cannot be used, whatever they hold."""

    name: str
    msgtype: str
    encoding: str
    count: int
    problem: str = ""


class Sqlite3File(Closing):
    """A SQLite file of a ROS 2 bag, with or without the folder that it belongs to.

    Rows that a recorder left in a ``-wal`` beside it are read, and a change that it left unfinished is undone, in a
    temporary copy. Damage is left out and named.

    Parameters
    ----------
    copy_of
        The file of which ``path`` is a decompressed copy, to be named in errors.
    most_bytes
        The largest message that is read.
    """

    def __init__(self, path: Path, copy_of: Path | None = None, most_bytes: int = MOST_BYTES) -> None:
        self.path = copy_of or path
        self._most_bytes = most_bytes
        self.losses = Losses()
        with ExitStack() as stack, translated(self.path, _FOREIGN):
            self._plain = plain_file(path.resolve(), self.path, self.losses, stack)
            self._tables = self._open_tables(stack)
            self._topics = self._read_topics()
            self._times_ns = self._tables.times_ns()
            self._resources = stack.pop_all()

    @property
    def files(self) -> tuple[Path, ...]:
        """The file, and what SQLite left beside it."""
        return self.path, *beside(self.path.resolve()).values()

    @classmethod
    def recognises(cls, path: Path, head: bytes) -> bool:
        """Tell whether this is a SQLite file."""
        del path
        return head.startswith(_MAGIC)

    @property
    def info(self) -> SourceInfo:
        """What the file holds."""
        rows = ((each.name, each.msgtype, each.count) for each in self._topics.values())
        start_ns, stop_ns = self._times_ns or (None, None)
        return SourceInfo("sqlite3", start_ns, stop_ns, topic_table(rows))

    def messages(self, topics: Collection[str]) -> Iterator[RawMessage]:
        """Yield the messages of these topics in order of log time, ties in the order in which they were written."""
        with translated(self.path, _FOREIGN):
            wanted = {key: topic for key, topic in self._topics.items() if topic.name in topics and not topic.problem}
            self._check_encodings(wanted.values())
            for row in self._rows(wanted):
                topic = wanted[row.topic_id]
                data = self._data(row, topic)
                if data is not None:
                    yield RawMessage(topic.name, topic.msgtype, "cdr", row.log_time_ns, data)

    def close(self) -> None:
        """Close the file, and remove its copy."""
        self._resources.close()

    def _open_tables(self, stack: ExitStack) -> BagTables:
        """Return the tables: as SQLite reads them if it can, else as far as they are there."""
        if not self._plain.is_consistent or not self._has_its_pages():
            return self._salvaged(stack)
        try:
            database = stack.enter_context(closing(_connected(self._plain.path)))
            most_bytes = min(self._most_bytes, self._plain.path.stat().st_size)
            tables = SqliteTables(database, most_bytes)
            # all that is read of them but the data of messages
            tables.counts(), tables.indexed(), tables.times_ns(), tables.topics(), tables.definitions()
        except NoBagError as error:
            raise InputError(f"{self.path}: this SQLite file is no ROS 2 bag: {error}") from error
        except sqlite3.DatabaseError as error:
            _raise_unless_damaged(error)
            return self._salvaged(stack)
        return tables

    def _has_its_pages(self) -> bool:
        """Tell whether the file has all pages that its header says, and only whole ones: SQLite does not mention it."""
        with self._plain.path.open("rb") as file:
            header = read_header(file)
        size = self._plain.path.stat().st_size
        return header is not None and size == (header.pages or size // header.page_bytes) * header.page_bytes

    def _salvaged(self, stack: ExitStack) -> BagTables:
        file = stack.enter_context(self._plain.path.open("rb"))
        header, size = read_header(file), self._plain.path.stat().st_size
        try:
            if header is None:
                raise NoBagError("its first page is damaged or cut off")
            header = header._replace(pages=self._plain.pages or header.pages)
            return salvaged_tables(file, size, header, self.losses)
        except NoBagError as error:
            raise InputError(
                f"{self.path}: none of this SQLite file of {size} bytes can be read: {error}; "
                "copy it again from where it was made"
            ) from error

    def _read_topics(self) -> dict[int, _Topic]:
        """Return the topics by id, and name those whose messages cannot be used."""
        counts = self._tables.counts()
        definitions: dict[str, list[Record]] = {}
        for each in self._tables.definitions():
            definitions.setdefault(_text(each, "topic_type"), []).append(each)
        topics = {}
        for row in self._tables.topics():
            key = row.get("id")
            if isinstance(key, int):
                topic = _topic(row, counts.get(key, 0), definitions.get(_text(row, "type"), []))
                topics[key] = topic
                if topic.problem:
                    place = f"topic {topic.name}"
                    self.losses.add(Loss(SkipCause.UNKNOWN_TYPE, place, topic.problem, topic.count, topic.name))
        for key, count in counts.items():
            if key not in topics:
                detail = "the table of topics has no such topic"
                self.losses.add(Loss(SkipCause.UNKNOWN_TYPE, f"topic {key!r}", detail, count))
        there, indexed = sum(counts.values()), self._tables.indexed()
        if indexed > there:
            detail = f"the index on time lists {indexed} messages, and {there} are there"
            self.losses.add(Loss(SkipCause.DAMAGED, "the table of messages", detail, indexed - there))
        return topics

    def _rows(self, topic_ids: Collection[int]) -> Iterator[Row]:
        """Yield where the messages of these topics are, whatever SQLite comes upon on the way."""
        last = None
        try:
            for row in self._tables.rows(topic_ids):
                last = row
                yield row
        except sqlite3.DatabaseError as error:
            _raise_unless_damaged(error)
        else:
            return
        self._tables = self._salvaged(self._resources)
        yield from (row for row in self._tables.rows(topic_ids) if last is None or row > last)

    def _data(self, row: Row, topic: _Topic) -> bytes | None:
        """Return the data of a message; None, and name it, if it cannot be used."""
        cause = SkipCause.DAMAGED
        try:
            data = self._tables.data(row, self._most_bytes)
            if not isinstance(row.log_time_ns, int):
                raise BadRowError(f"its time is {type(row.log_time_ns).__name__}, not a number")
            return decompressed_cdr(data, self._most_bytes)
        except BadRowError as error:
            detail = f"it cannot be read: {error}"
        except ZstdError as error:
            detail = f"it cannot be decompressed: {' '.join(str(error).split())}"
        except TooLargeError as error:
            cause, detail = SkipCause.OVER_MEMORY, str(error)
        lapse = lapse_of([row.log_time_ns]) if isinstance(row.log_time_ns, int) else Lapse()
        self.losses.add(Loss(cause, f"message {row.key}", detail, 1, topic.name, lapse=lapse))
        return None

    def _check_encodings(self, topics: Iterable[_Topic]) -> None:
        for topic in topics:
            if topic.encoding != "cdr":
                raise InputError(f"{self.path}: topic {topic.name} {_not_read(topic.encoding)}")


def _connected(path: Path) -> sqlite3.Connection:
    # Immutable, so that not even a lock file is left beside the recording, and nothing beside it is looked at.
    uri = f"{path.as_uri()}?mode=ro&immutable=1"
    # opened in one thread and read in another, but never in two at once
    return sqlite3.connect(uri, uri=True, check_same_thread=False)


def _raise_unless_damaged(error: sqlite3.DatabaseError) -> None:
    """Raise an error again that says nothing about the file."""
    code = getattr(error, "sqlite_errorcode", sqlite3.SQLITE_CORRUPT) & 0xFF
    if code == sqlite3.SQLITE_FULL:
        raise OSError(errno.ENOSPC, "No space left on device") from error
    if code not in {sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB}:
        raise error


def _topic(row: Record, count: int, definitions: Sequence[Record]) -> _Topic:
    name, encoding = _text(row, "name"), _text(row, "serialization_format")
    msgtype = type_in(encoding, _text(row, "type"))
    plain = normalised_type(_text(row, "type"))
    if "/" not in plain:
        problem = f"its type is {row.get('type')!r}, which is the name of none"
        return _Topic(name, msgtype, encoding, count, problem)
    if plain not in DECODED_TYPES:
        return _Topic(name, msgtype, encoding, count)
    if encoding != "cdr":
        return _Topic(name, msgtype, encoding, count, f"it {_not_read(encoding)}")
    for each in definitions:
        # There may be one for each of several variants of a type.
        is_own = _text(each, "type_description_hash") in {"", _text(row, "type_description_hash")}
        text = _text(each, "encoded_message_definition")
        difference = differing_field(plain, text, 2) if is_own else None
        if difference is not None:
            return _Topic(name, f"{msgtype} (another definition)", encoding, count, difference)
    return _Topic(name, msgtype, encoding, count)


def _not_read(encoding: str) -> str:
    return f"is serialised as '{encoding}'; cdr is read: convert the recording with `ros2 bag convert`"


def _text(record: Record, column: str) -> str:
    """Return a value that should be text; "" if it is not."""
    value = record.get(column)
    return value if isinstance(value, str) else ""
