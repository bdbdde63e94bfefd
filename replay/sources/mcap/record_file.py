"""An open MCAP file, of which records are read by their headers, so that only what is needed is read."""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from replay.sources.mcap.records import MESSAGE_HEAD, MESSAGE_INDEX, RECORD, MessageHeader, Record, message_header

_INDEX_HEAD = struct.Struct("<HI")
_INDEX_ROW = struct.Struct("<QQ")

_BLOCK_BYTES = 1 << 20
_INDEX_BLOCK_BYTES = _INDEX_ROW.size << 12
_LEAST_UNWRITTEN_BYTES = 16


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


def file_crc(file: RecordFile, start: int, stop: int) -> int:
    """Return the checksum of bytes of a file."""
    crc = 0
    file.file.seek(start)
    while start < stop and (block := file.file.read(min(_BLOCK_BYTES, stop - start))):
        crc = zlib.crc32(block, crc)
        start += len(block)
    return crc


def indexed_counts(file: RecordFile, start: int) -> Counter[int] | None:
    """Return how many messages of each channel a chunk has, as the indexes say that follow it; None if none do."""
    return indexes_behind(file, start)[0] or None


def indexes_behind(file: RecordFile, start: int) -> tuple[Counter[int], int]:
    """Return how many messages of each channel the message indexes from a byte on list, and where these end."""
    counts: Counter[int] = Counter()
    while (index := file.message_index(start)) is not None:
        counts[index.channel] += index.count
        start = index.end
    return counts, start
