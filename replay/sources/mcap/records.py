"""The records of an MCAP file: where they are, and what the few that matter say.

Records are walked by their headers, so that only what is needed is read. No length is believed before what it says
fits: neither that of a record nor those of the texts within it.
"""

from __future__ import annotations

import functools
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, NamedTuple, TypeVar

from replay.sources.base import GRID_TYPE, TF_TYPES, UPDATE_TYPE
from replay.sources.boundary import COMMON
from replay.sources.definitions.difference import LARGEST_CHARS, differing_field
from replay.sources.topics import ENCODINGS, normalised_type, type_in

if TYPE_CHECKING:
    from mcap.data_stream import ReadDataStream

MAGIC = b"\x89MCAP0\r\n"

HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
ATTACHMENT, ATTACHMENT_INDEX, STATISTICS, METADATA, METADATA_INDEX, SUMMARY_OFFSET, DATA_END = range(9, 16)

RECORD = struct.Struct("<BQ")
MESSAGE_HEAD = struct.Struct("<HIQQ")
_INDEX_HEAD = struct.Struct("<HI")
_INDEX_ROW = struct.Struct("<QQ")
_U16 = struct.Struct("<H")
_U32 = struct.Struct("<I")

NO_SCHEMA = "its schema is nowhere in the file"

_BLOCK_BYTES = 1 << 20
_INDEX_BLOCK_BYTES = _INDEX_ROW.size << 12
_LEAST_UNWRITTEN_BYTES = 16
_MOST_DESCRIPTION_BYTES = 1 << 24
_MOST_DESCRIPTIONS_BYTES = 1 << 26
_BYTES_A_CHARACTER = 4

_DEFINED_TYPES = {GRID_TYPE, UPDATE_TYPE, *TF_TYPES}
_DEFINITION_ENCODINGS = {"ros2msg", "ros1msg", "ros2idl", "omgidl"}


@functools.cache
def foreign_errors() -> tuple[type[Exception], ...]:
    """Return what may be raised below a source of MCAP files."""
    from mcap.exceptions import McapError
    from zstandard import ZstdError

    from replay.sources.zstd import ZstdError as MessageZstdError

    return (*COMMON, McapError, ZstdError, MessageZstdError)


def parser_stream(content: bytes) -> ReadDataStream:
    """Return a record's content for the parsers of the mcap package."""
    from mcap.data_stream import ReadDataStream

    return ReadDataStream(BytesIO(content))


class Record(NamedTuple):
    """Where a record, its content and its end are in a file, or in a chunk."""

    opcode: int
    start: int
    content: int
    end: int


class MessageHeader(NamedTuple):
    """What a message record says ahead of its data."""

    channel: int
    sequence: int
    log_time_ns: int
    publish_time_ns: int


def message_header(container: bytes, content: int = 0) -> MessageHeader:
    """Return the header of the message whose content begins at a byte of the container."""
    return MessageHeader(*MESSAGE_HEAD.unpack_from(container, content))


def message_header_at(container: bytes, start: int) -> MessageHeader | None:
    """Return the header of the message record at a byte of the container; None if none is."""
    content = start + RECORD.size
    if content > len(container):
        return None
    opcode, length = RECORD.unpack_from(container, start)
    if opcode != MESSAGE or length < MESSAGE_HEAD.size or content + length > len(container):
        return None
    return message_header(container, content)


def message_data(container: bytes, start: int) -> bytes | None:
    """Return a copy of the data of the message record at a byte of the container; None if none is."""
    content = start + RECORD.size
    if content > len(container):
        return None
    opcode, length = RECORD.unpack_from(container, start)
    if opcode != MESSAGE or length < MESSAGE_HEAD.size or content + length > len(container):
        return None
    return container[content + MESSAGE_HEAD.size : content + length]


def check_description(record: Record) -> None:
    """Refuse a schema or channel record that is larger than any description, before it is read.

    Raises
    ------
    ValueError
        If it is.
    """
    length = record.end - record.content
    if length > _MOST_DESCRIPTION_BYTES:
        raise ValueError(f"it has {length} bytes, and at most {_MOST_DESCRIPTION_BYTES} are read")


@dataclass(frozen=True, slots=True)
class Channel:
    """A channel with the type of its schema.

    Parameters
    ----------
    problem
        Why its messages cannot be used whatever they hold; "" if nothing speaks against them.
    """

    topic: str
    msgtype: str
    encoding: str
    problem: str = ""

    @property
    def is_map(self) -> bool:
        """Tell whether its messages are maps or updates of maps."""
        return self.msgtype in {GRID_TYPE, UPDATE_TYPE}


class _Schema(NamedTuple):
    name: str
    encoding: str
    definition: bytes


class _Described(NamedTuple):
    topic: str
    encoding: str
    schema: int


_Variant = TypeVar("_Variant", _Schema, _Described)


class ChannelTable:
    """The channels and schemas met so far.

    A record may be there several times, and must then say the same each time. Of those that do not, two are kept:
    enough to tell that none is to be believed.

    Parameters
    ----------
    keeps_records
        Whether the file is copied, so that `record` is asked, and nothing depends on whether messages can be maps; else
        only what tells that is kept, and definitions are held against the standard ones.
    """

    def __init__(self, *, keeps_records: bool = False) -> None:
        self._schemas: dict[int, list[_Schema]] = {0: [_Schema("", "", b"")]}
        self._channels: dict[int, list[_Described]] = {}
        self._keeps_records = keeps_records
        self._records: dict[tuple[int, int], bytes] = {}
        self._held_bytes = 0

    def add(self, opcode: int, content: bytes) -> None:
        """Take the content of a schema or channel record; others are passed over.

        Raises
        ------
        ValueError
            If its fields do not fit it, or more would be held of all such records than any recording needs.
        """
        if opcode == SCHEMA:
            fields = _Fields(content)
            key, name, encoding, definition = fields.number(), fields.text(), fields.text(), fields.block()
            # of other types it is never looked at
            is_used = normalised_type(name) in _DEFINED_TYPES
            # so much of a longer one that it is seen to be too long
            kept = definition[: _BYTES_A_CHARACTER * LARGEST_CHARS + 1] if is_used else b""
            if key:
                self._hold(self._schemas.setdefault(key, []), _Schema(name, encoding, kept))
                self._keep(opcode, key, content)
        elif opcode == CHANNEL:
            fields = _Fields(content)
            key, schema, topic, encoding = fields.number(), fields.number(), fields.text(), fields.text()
            fields.block()
            self._hold(self._channels.setdefault(key, []), _Described(topic, encoding, schema))
            self._keep(opcode, key, content)

    def _keep(self, opcode: int, key: int, content: bytes) -> None:
        if self._keeps_records:
            self._records.setdefault((opcode, key), content)

    def _hold(self, variants: list[_Variant], variant: _Variant) -> None:
        if variant in variants or len(variants) >= 2:
            return
        self._held_bytes += sum(len(each) for each in variant if isinstance(each, str | bytes))
        if self._held_bytes > _MOST_DESCRIPTIONS_BYTES:
            raise ValueError(f"of all such records, at most {_MOST_DESCRIPTIONS_BYTES} bytes are held")
        variants.append(variant)

    def completed_by(self, other: ChannelTable) -> ChannelTable:
        """Return a table with what this one says and, where it says nothing, what the other one says."""
        both = ChannelTable(keeps_records=self._keeps_records)
        both._schemas = {**other._schemas, **self._schemas}
        both._channels = {**other._channels, **self._channels}
        both._records = {**other._records, **self._records}
        return both

    def record(self, opcode: int, key: int) -> bytes | None:
        """Return the content of the first record of a schema or channel; None if none has been met."""
        return self._records.get((opcode, key))

    def is_ambiguous(self, key: int) -> bool:
        """Tell whether a channel, or its schema, is described in two ways."""
        described = self._channels.get(key, [])
        return len(described) > 1 or any(len(self._schemas.get(each.schema, ())) > 1 for each in described)

    def get(self, key: int) -> Channel | None:
        """Return a channel; None if it has not been met."""
        unknown: list[_Schema | None] = [None]
        variants = {
            _channel(described, schema, is_copied=self._keeps_records)
            for described in self._channels.get(key, ())
            for schema in self._schemas.get(described.schema, unknown)
        }
        if len(variants) <= 1:
            return next(iter(variants), None)
        first = _channel(self._channels[key][0], None, is_copied=self._keeps_records)
        may_matter = any(each.is_map or each.msgtype in TF_TYPES or each.problem for each in variants)
        problem = "the file describes it in two ways" if may_matter else ""
        return Channel(first.topic, "unknown", first.encoding, problem)

    def all(self) -> dict[int, Channel]:
        """Return all channels that have been met, by id."""
        return {key: channel for key in sorted(self._channels) if (channel := self.get(key))}


class _Fields:
    """Takes the fields of a record one after the other.

    Raises
    ------
    ValueError
        If one does not fit into the record, or a text is none.
    """

    def __init__(self, content: bytes) -> None:
        self._content = content
        self._at = 0

    def number(self) -> int:
        return int(_U16.unpack(self._take(_U16.size))[0])

    def block(self) -> bytes:
        return self._take(_U32.unpack(self._take(_U32.size))[0])

    def text(self) -> str:
        return self.block().decode()

    def _take(self, length: int) -> bytes:
        end = self._at + length
        if end > len(self._content):
            raise ValueError(f"a field of {length} bytes does not fit into a record of {len(self._content)}")
        taken, self._at = self._content[self._at : end], end
        return taken


def _channel(described: _Described, schema: _Schema | None, *, is_copied: bool) -> Channel:
    topic, encoding, _ = described
    if schema is None:
        return Channel(topic, type_in(encoding, ""), encoding, NO_SCHEMA)
    msgtype = type_in(encoding, schema.name)
    if msgtype in _DEFINED_TYPES and schema.encoding in _DEFINITION_ENCODINGS and not is_copied:
        text = schema.definition.decode(errors="replace")
        difference = differing_field(msgtype, text, 1 if encoding == "ros1" else 2)
        if difference is not None:
            return Channel(topic, f"{msgtype} (another definition)", encoding, difference)
    if encoding not in ENCODINGS and normalised_type(schema.name) in {GRID_TYPE, UPDATE_TYPE}:
        problem = f"its maps are encoded as '{encoding}'; {' or '.join(ENCODINGS)} is read: convert the recording"
        return Channel(topic, msgtype, encoding, problem)
    return Channel(topic, msgtype, encoding)


@dataclass(frozen=True, slots=True)
class MessageIndex:
    """How many messages of a channel a chunk has; ``at`` is where in the file that says when and where they are."""

    file: BinaryIO
    channel: int
    count: int
    at: int
    end: int

    def rows(self) -> Iterator[tuple[int, int]]:
        """Yield time and place in the chunk of each message, of which few are in memory at a time."""
        at, stop = self.at, self.at + self.count * _INDEX_ROW.size
        while at < stop:
            self.file.seek(at)
            block = self.file.read(min(_INDEX_BLOCK_BYTES, stop - at))
            yield from _INDEX_ROW.iter_unpack(block)
            at += len(block)


@dataclass(frozen=True, slots=True)
class RecordFile:
    """An open MCAP file.

    Parameters
    ----------
    written
        Where the zeros begin with which the file ends, as space does that was reserved and never written; ``size`` if
        there are none.
    most_bytes
        The largest message, or decompressed chunk, that is read.
    """

    path: Path
    file: BinaryIO
    size: int
    written: int
    most_bytes: int

    def head_at(self, start: int, content_bytes: int = 0) -> tuple[Record, bytes] | None:
        """Return what the bytes at ``start`` are as a record, and the bytes behind its header.

        It may reach beyond the file. None if there are not even enough bytes for a header.
        """
        if not 0 <= start <= self.size - RECORD.size:
            return None
        self.file.seek(start)
        head = self.file.read(RECORD.size + content_bytes)
        opcode, length = RECORD.unpack_from(head)
        content = start + RECORD.size
        return Record(opcode, start, content, content + length), head[RECORD.size :]

    def is_whole(self, record: Record) -> bool:
        """Tell whether all of a record is there.

        A record that ends among the zeros with which a file ends may have zeros in it that were never written.
        """
        # There is no record of type 0: such bytes were reserved for a recording and never written.
        return record.opcode != 0 and (record.end <= self.written or record.end == self.size)

    def record_at(self, start: int) -> Record | None:
        """Return the record that begins at a byte of the file; None if no whole record does."""
        found = self.head_at(start)
        return found[0] if found and self.is_whole(found[0]) else None

    def end_of(self, start: int) -> int:
        """Return where the record ends that begins at a byte of the file; that byte if none does."""
        record = self.record_at(start)
        return record.end if record else start

    def content(self, record: Record) -> bytes:
        """Return a record's content."""
        self.file.seek(record.content)
        return self.file.read(record.end - record.content)

    def record_bytes(self, start: int) -> bytes:
        """Return a whole record; nothing if none begins at this byte, or one that is too large."""
        record = self.record_at(start)
        if record is None or record.end - start > self.most_bytes:
            return b""
        self.file.seek(start)
        return self.file.read(record.end - start)

    def message_header(self, record: Record) -> MessageHeader:
        """Return the header of a message that lies outside of any chunk."""
        self.file.seek(record.content)
        return message_header(self.file.read(MESSAGE_HEAD.size))

    def message_index(self, start: int, most: int | None = None) -> MessageIndex | None:
        """Return the message index at a byte; None if none is there, or one of more messages than ``most``."""
        found = self.head_at(start, _INDEX_HEAD.size)
        if found is None or found[0].opcode != MESSAGE_INDEX or not self.is_whole(found[0]):
            return None
        record, head = found
        if record.end - record.content < _INDEX_HEAD.size:
            return None
        channel, length = _INDEX_HEAD.unpack(head)
        at = record.content + _INDEX_HEAD.size
        count, rest = divmod(length, _INDEX_ROW.size)
        if rest or at + length > record.end or (most is not None and count > most):
            return None
        return MessageIndex(self.file, channel, count, at, record.end)


def written_bytes(file: BinaryIO, size: int) -> int:
    """Return where the zeros begin with which a file ends; its size if there are only a few, which may be data."""
    end = size
    while end > 0:
        start = max(0, end - _BLOCK_BYTES)
        file.seek(start)
        kept = len(file.read(end - start).rstrip(b"\0"))
        if kept:
            end = start + kept
            break
        end = start
    return end if size - end >= _LEAST_UNWRITTEN_BYTES else size
