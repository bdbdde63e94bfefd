"""The records of MCAP files: their types, where they are, and what messages say ahead of their data."""

from __future__ import annotations

import functools
import struct
from io import BytesIO
from typing import TYPE_CHECKING, NamedTuple

from replay.skip_cause import SkipCause
from replay.sources.boundary import COMMON

if TYPE_CHECKING:
    from mcap.data_stream import ReadDataStream

MAGIC = b"\x89MCAP0\r\n"

HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
ATTACHMENT, ATTACHMENT_INDEX, STATISTICS, METADATA, METADATA_INDEX, SUMMARY_OFFSET, DATA_END = range(9, 16)

RECORD = struct.Struct("<BQ")
MESSAGE_HEAD = struct.Struct("<HIQQ")


class BadPart(Exception):
    """A part of a file cannot be used."""

    def __init__(self, cause: SkipCause, detail: str) -> None:
        super().__init__(detail)
        self.cause = cause
        self.detail = detail


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
    found = _message_at(container, start)
    return message_header(container, found[0]) if found else None


def message_data(container: bytes, start: int) -> bytes | None:
    """Return a copy of the data of the message record at a byte of the container; None if none is."""
    found = _message_at(container, start)
    return container[found[0] + MESSAGE_HEAD.size : found[1]] if found else None


def _message_at(container: bytes, start: int) -> tuple[int, int] | None:
    """Return where the content of the message record at a byte begins and ends; None if none is there as a whole."""
    content = start + RECORD.size
    if content > len(container):
        return None
    opcode, length = RECORD.unpack_from(container, start)
    if opcode != MESSAGE or length < MESSAGE_HEAD.size or content + length > len(container):
        return None
    return content, content + length
