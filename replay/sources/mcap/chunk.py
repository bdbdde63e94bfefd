"""What is in a chunk of an MCAP file, decompressed and checked.

A chunk is used as a whole or not at all, because its checksum says only that something in it is wrong. The one at which
a file was cut off has none that could be checked: of it, all whole records are used that can be decompressed.

No size is believed: what is decompressed is given up on once it is more than the largest chunk that is read.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from typing import NamedTuple

from replay.skip_cause import SkipCause
from replay.sources.mcap.decompress import COMPRESSIONS, decompressed
from replay.sources.mcap.record_file import RecordFile
from replay.sources.mcap.records import (
    CHANNEL,
    CHUNK,
    MESSAGE,
    MESSAGE_HEAD,
    RECORD,
    SCHEMA,
    BadPart,
    Record,
    message_header,
)
from replay.sources.memory import over_memory

_HEAD = struct.Struct("<QQQII")
_LENGTH = struct.Struct("<Q")
_INNER = {SCHEMA, CHANNEL, MESSAGE}
_PRIVATE = 0x80


class ChunkHead(NamedTuple):
    """What a chunk says of itself, and how many bytes that takes."""

    size: int
    crc: int
    compression: bytes
    data_bytes: int
    head_bytes: int


_LONGEST_NAME_BYTES = 32
CHUNK_HEAD_BYTES = _HEAD.size + _LONGEST_NAME_BYTES + _LENGTH.size


def chunk_head(content: bytes) -> ChunkHead | None:
    """Return what the content of a chunk record begins with; None if that is no chunk that can be read."""
    if len(content) < _HEAD.size:
        return None
    _, _, size, crc, length = _HEAD.unpack_from(content)
    end = _HEAD.size + length
    if end + _LENGTH.size > len(content):
        return None
    (data_bytes,) = _LENGTH.unpack_from(content, end)
    return ChunkHead(size, crc, content[_HEAD.size : end], data_bytes, end + _LENGTH.size)


def is_consistent(record: Record, content: bytes) -> bool:
    """Tell whether a chunk's lengths agree with each other, from how its content begins."""
    head = chunk_head(content)
    return head is not None and head.head_bytes + head.data_bytes == record.end - record.content


def seems_a_chunk(record: Record, content: bytes) -> bool:
    """Tell whether a record of another type says of itself what only chunks do, from how its content begins."""
    head = chunk_head(content)
    return head is not None and head.compression in COMPRESSIONS and is_consistent(record, content)


def chunk_content(file: RecordFile, start: int) -> tuple[bytes, bool]:
    """Return the records of the chunk at a byte of the file, and whether a checksum says that they are right.

    Raises
    ------
    BadPart
        If it cannot be used.
    """
    record = file.record_at(start)
    if record is None or record.opcode != CHUNK:
        raise BadPart(SkipCause.DAMAGED, "no chunk is there")
    if record.end - record.start > file.most_bytes:
        raise _too_large(file)
    found = file.head_at(start, CHUNK_HEAD_BYTES)
    head = chunk_head(found[1]) if found else None
    if head is None or head.head_bytes + head.data_bytes != record.end - record.content:
        raise BadPart(SkipCause.DAMAGED, f"the lengths in it do not fit its {record.end - record.content} bytes")
    file.file.seek(record.content + head.head_bytes)
    # More than it should have is wrong as soon as it is seen: little data may grow to very much.
    most_bytes = min(head.size, file.most_bytes)
    plain = decompressed(head.compression, file.file.read(head.data_bytes), most_bytes)
    if head.compression and len(plain) > most_bytes:
        if most_bytes == file.most_bytes:
            raise _too_large(file)
        raise BadPart(SkipCause.DAMAGED, f"it has more than {head.size} bytes, which it should have")
    if head.crc not in {0, zlib.crc32(plain)}:
        raise BadPart(SkipCause.WRONG_CHECKSUM, "its checksum (CRC) is wrong")
    if len(plain) != head.size:
        raise BadPart(SkipCause.DAMAGED, f"it has {len(plain)} bytes, not {head.size}")
    return plain, head.crc != 0


def cut_chunk_content(file: RecordFile, start: int) -> bytes:
    """Return the whole records of a chunk at which the file was cut off, as far as they can be decompressed.

    Raises
    ------
    BadPart
        If what is there is damaged.
    """
    found = file.head_at(start, CHUNK_HEAD_BYTES)
    head = chunk_head(found[1]) if found else None
    if found is None or head is None:
        return b""
    at = found[0].content + head.head_bytes
    # without the zeros at the end of the file, which a decompressor would take for data
    stop = file.written if head.compression else file.size
    file.file.seek(at)
    data = file.file.read(max(0, min(stop - at, file.most_bytes)))
    plain = decompressed(head.compression, data, file.most_bytes)
    # Zeros may be of a message, or may never have been written.
    written = len(plain) if head.compression else file.written - at
    return plain[: _end_of_whole(plain, written)]


def _end_of_whole(plain: bytes, written: int) -> int:
    """Return where the records end of which nothing is missing.

    What cannot begin a record shows that bytes are missing of the one before.
    """
    end = before = 0
    for record in _records(plain):
        if record.end > len(plain) or written < record.end < len(plain):
            is_record = record.start >= written or plain[record.start] in _INNER or plain[record.start] >= _PRIVATE
            return end if is_record else before
        before, end = end, record.end
    return end


class Inside(NamedTuple):
    """Which channels have messages in a chunk, and where its last record begins."""

    channels: frozenset[int]
    last_record: int


def inside_of(content: bytes) -> Inside:
    """Return what is in a decompressed chunk.

    Raises
    ------
    BadPart
        If its records do not fit it.
    """
    channels, start = set(), 0
    for record in inner_records(content):
        start = record.start
        if record.opcode == MESSAGE:
            channels.add(message_header(content, record.content).channel)
    return Inside(frozenset(channels), start)


def describes(content: bytes) -> bool:
    """Check all records in a decompressed chunk, none of which is kept; tell whether one is a schema or a channel.

    There may be one for each few bytes of the chunk, so that a list of them would need many times its memory.

    Raises
    ------
    BadPart
        If they do not fit it.
    """
    found = False
    for record in inner_records(content):
        found |= record.opcode in {SCHEMA, CHANNEL}
    return found


def inner_records(content: bytes) -> Iterator[Record]:
    """Yield the records in a decompressed chunk.

    Raises
    ------
    BadPart
        If they do not fit it.
    """
    for record in _records(content):
        length = record.end - record.content
        if record.end > len(content):
            raise BadPart(SkipCause.DAMAGED, f"a record in it has {length} bytes, more than are left")
        if record.opcode == 0 or (record.opcode == MESSAGE and length < MESSAGE_HEAD.size):
            raise BadPart(SkipCause.DAMAGED, f"what should be a record in it, of type {record.opcode}, is none")
        yield record


def _records(content: bytes) -> Iterator[Record]:
    """Yield records by their lengths; the last one may reach beyond what is there."""
    start = 0
    while start < len(content):
        inner = start + RECORD.size
        if inner > len(content):
            yield Record(0, start, inner, inner)
            return
        opcode, length = RECORD.unpack_from(content, start)
        yield Record(opcode, start, inner, inner + length)
        start = inner + length


def _too_large(file: RecordFile) -> BadPart:
    return BadPart(SkipCause.OVER_MEMORY, over_memory(file.most_bytes))
