"""The records of an MCAP file: where they are, and what the few that matter say.

Records are walked by their headers, so that only what is needed is read, and a file that was cut off is told from one
that is damaged.
"""

from __future__ import annotations

import functools
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, NamedTuple

from replay.errors import InputError
from replay.sources.base import GRID_TYPE, UPDATE_TYPE
from replay.sources.boundary import COMMON, translated
from replay.sources.topics import type_in

if TYPE_CHECKING:
    from mcap.data_stream import ReadDataStream

MAGIC = b"\x89MCAP0\r\n"

FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(2, 9)
STATISTICS = 11

_RECORD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")
_COMPRESSIONS = {"", "lz4", "zstd"}


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
    return MessageHeader(*_MESSAGE.unpack_from(container, content))


def message_at(container: bytes, start: int) -> tuple[MessageHeader, bytes] | None:
    """Return the header and a copy of the data of the message record at a byte of the container; None if none is."""
    content = start + _RECORD.size
    if content > len(container):
        return None
    opcode, length = _RECORD.unpack_from(container, start)
    if opcode != MESSAGE or length < _MESSAGE.size or content + length > len(container):
        return None
    return message_header(container, content), container[content + _MESSAGE.size : content + length]


@dataclass(frozen=True, slots=True)
class Channel:
    """A channel with the type of its schema."""

    topic: str
    msgtype: str
    encoding: str

    @property
    def is_map(self) -> bool:
        """Tell whether its messages are maps or updates of maps."""
        return self.msgtype in {GRID_TYPE, UPDATE_TYPE}


class ChannelTable:
    """The channels and schemas met so far."""

    def __init__(self) -> None:
        self._schemas: dict[int, str] = {0: ""}
        self._channels: dict[int, tuple[str, str, int]] = {}

    def add(self, opcode: int, content: bytes) -> None:
        """Take the content of a schema or channel record; others are passed over."""
        from mcap import records

        if opcode == SCHEMA:
            schema = records.Schema.read(parser_stream(content))
            self._schemas[schema.id] = schema.name
        elif opcode == CHANNEL:
            channel = records.Channel.read(parser_stream(content))
            self._channels[channel.id] = channel.topic, channel.message_encoding, channel.schema_id

    def get(self, key: int) -> Channel | None:
        """Return a channel; None if it, or its schema, has not been met."""
        topic, encoding, schema = self._channels.get(key, ("", "", -1))
        name = self._schemas.get(schema)
        return None if name is None else Channel(topic, type_in(encoding, name), encoding)

    def all(self) -> dict[int, Channel]:
        """Return all channels whose schema has been met, by id."""
        return {key: channel for key in sorted(self._channels) if (channel := self.get(key))}


@dataclass(frozen=True, slots=True)
class RecordFile:
    """An open MCAP file."""

    path: Path
    file: BinaryIO
    size: int

    def records(self) -> Iterator[Record]:
        """Yield the records of the file up to its footer.

        Raises
        ------
        InputError
            If the file ends before that.
        """
        start = len(MAGIC)
        while True:
            record = self.record_at(start)
            if record is None:
                raise InputError(
                    f"{self.path}: the file ends early at byte {self.size}: its last whole record ends at byte {start} "
                    "and nothing closes the recording, as when recording or copying was cut off; copy it again, or "
                    "recover a copy with `mcap recover`"
                )
            yield record
            if record.opcode == FOOTER:
                return
            start = record.end

    def record_at(self, start: int) -> Record | None:
        """Return the record that begins at a byte of the file; None if no whole record does."""
        self.file.seek(start)
        head = self.file.read(_RECORD.size)
        if len(head) < _RECORD.size:
            return None
        opcode, length = _RECORD.unpack(head)
        content = start + _RECORD.size
        # There is no record of type 0: such bytes were reserved for a recording and never written.
        whole = opcode != 0 and content + length <= self.size
        return Record(opcode, start, content, content + length) if whole else None

    def content(self, record: Record) -> bytes:
        """Return a record's content."""
        self.file.seek(record.content)
        return self.file.read(record.end - record.content)

    def record_bytes(self, start: int) -> bytes:
        """Return a whole record; nothing if none begins at this byte."""
        record = self.record_at(start)
        if record is None:
            return b""
        self.file.seek(start)
        return self.file.read(record.end - start)

    def message_header(self, record: Record) -> MessageHeader:
        """Return the header of a message that lies outside of any chunk."""
        self.file.seek(record.content)
        return message_header(self.file.read(_MESSAGE.size))

    def chunk(self, start: int) -> bytes:
        """Return the records of the chunk at a byte of the file, decompressed and checked."""
        from mcap.records import Chunk
        from mcap.stream_reader import get_chunk_data_stream

        with translated(self.path, foreign_errors(), part=f"the chunk at byte {start}"):
            record = self.record_at(start)
            if record is None or record.opcode != CHUNK:
                raise damaged_chunk(self.path, start, "no chunk is there")
            chunk = Chunk.read(parser_stream(self.content(record)))
            if chunk.compression not in _COMPRESSIONS:
                raise damaged_chunk(
                    self.path, start, f"its compression is '{chunk.compression}', not lz4, zstd or none"
                )
            stream, length = get_chunk_data_stream(chunk)
            content = stream.read(length)
        if chunk.uncompressed_crc not in {0, zlib.crc32(content)}:
            raise damaged_chunk(self.path, start, "its checksum (CRC) is wrong")
        if length != chunk.uncompressed_size:
            raise damaged_chunk(self.path, start, f"it has {length} bytes, not {chunk.uncompressed_size}")
        return content

    def inner_records(self, records: bytes, start: int) -> Iterator[Record]:
        """Yield the records of what was read at a byte of the file: a decompressed chunk, or a summary."""
        inner = 0
        while inner < len(records):
            content = inner + _RECORD.size
            if content > len(records):
                raise damaged_chunk(self.path, start, "its last record is cut off")
            opcode, length = _RECORD.unpack_from(records, inner)
            end = content + length
            if end > len(records):
                raise damaged_chunk(self.path, start, f"a record in it has {length} bytes, more than are left")
            yield Record(opcode, inner, content, end)
            inner = end


def damaged_chunk(path: Path, start: int, found: str) -> InputError:
    """Return the error for a chunk that cannot be read."""
    return InputError(
        f"{path}: the chunk at byte {start} is damaged: {found}; copy the recording again from where it was made"
    )
