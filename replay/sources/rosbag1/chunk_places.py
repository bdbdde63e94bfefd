"""Where the chunks of a ROS 1 bag end: by what they say and, where that is not so, by what follows."""

from __future__ import annotations

from typing import BinaryIO

from replay.sources.rosbag1.chunks import ChunkPlace
from replay.sources.rosbag1.records import (
    CHUNK,
    CHUNK_INFO,
    CONNECTION,
    INDEX,
    Record,
    find_of,
    is_unfinished,
    record_of,
)

SURE_OUTER = (INDEX, CHUNK, CHUNK_INFO)
"""Kinds of records that are never within a chunk."""

_OUTER = (INDEX, CHUNK, CHUNK_INFO, CONNECTION)
_LONGEST_TAIL_BYTES = 1 << 17


def chunk_place(file: BinaryIO, size_bytes: int, record: Record) -> ChunkPlace:
    """Return where a chunk is, whatever its header says of its length.

    Parameters
    ----------
    size_bytes
        How long the file is.
    record
        The chunk's.
    """
    size: int | None = record.number(b"size")
    compression = record.fields[b"compression"].decode("utf-8", "replace")
    begin = (record.start, record.data)
    # Recorders fill in both lengths when the chunk is whole.
    if size == 0 and record.end == record.data:
        end = find_of(file, record.data, SURE_OUTER)
        return ChunkPlace(*begin, end or size_bytes, compression, None, is_cut=True)
    if record.end <= size_bytes and _is_followed(file, size_bytes, record.end):
        return ChunkPlace(*begin, record.end, compression, size)
    end = find_of(file, record.data, SURE_OUTER)
    if end is None and record.end > size_bytes:
        return ChunkPlace(*begin, size_bytes, compression, size, is_cut=True)
    if end is None or end > record.end:
        return ChunkPlace(*begin, record.end, compression, size, has_sure_end=False)
    return ChunkPlace(*begin, end, compression, size)


def is_unfinished_at(file: BinaryIO, size_bytes: int, start: int) -> bool:
    """Tell whether the file ends within the header of the record at a byte."""
    if size_bytes - start >= _LONGEST_TAIL_BYTES:
        return False
    file.seek(start)
    return is_unfinished(file.read(_LONGEST_TAIL_BYTES))


def _is_followed(file: BinaryIO, size_bytes: int, end: int) -> bool:
    """Tell whether a record that may follow a chunk, or the end of the file, is at a byte."""
    record = record_of(file, end)
    return (record is not None and record.op in _OUTER) or is_unfinished_at(file, size_bytes, end)
