"""MCAP files as records that can be changed and written again, with checksums made right unless they are the fault."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from replay.sources.mcap.records import CHANNEL, CHUNK, CHUNK_INDEX, FOOTER, MAGIC, MESSAGE_INDEX, SCHEMA, STATISTICS

__all__ = [
    "CHANNEL",
    "CHUNK",
    "CHUNK_INDEX",
    "FOOTER",
    "INDEXES",
    "MESSAGE_INDEX",
    "SCHEMA",
    "STATISTICS",
    "Chunk",
    "Record",
]

DATA_END = 15
INDEXES = {MESSAGE_INDEX, CHUNK_INDEX, STATISTICS}
"""What says where things are, and is wrong once they are elsewhere."""
_HEAD = struct.Struct("<BQ")
_FOOTER = struct.Struct("<QQI")
_CHUNK = struct.Struct("<QQQI")


@dataclass(frozen=True, slots=True)
class Record:
    """One record; ``told_length`` is the length it gives itself, None for its own."""

    opcode: int
    content: bytes
    told_length: int | None = None

    def packed(self) -> bytes:
        """Return the record as it is written."""
        length = len(self.content) if self.told_length is None else self.told_length
        return _HEAD.pack(self.opcode, length) + self.content


def parsed(data: bytes) -> list[Record]:
    """Return the records between the magic bytes of an undamaged file."""
    return records_in(data[len(MAGIC) : -len(MAGIC)])


def records_in(data: bytes) -> list[Record]:
    """Return the records one after the other."""
    found, start = [], 0
    while start < len(data):
        opcode, length = _HEAD.unpack_from(data, start)
        start += _HEAD.size
        found.append(Record(opcode, data[start : start + length]))
        start += length
    return found


def written(records: Sequence[Record]) -> bytes:
    """Return a file of these records, its footer's offset and checksum as they are."""
    return MAGIC + joined(records) + MAGIC


def joined(records: Sequence[Record]) -> bytes:
    """Return records one after the other."""
    return b"".join(each.packed() for each in records)


def closed(records: Sequence[Record]) -> bytes:
    """Return a file of these records whose footer finds its summary and has the right checksum."""
    body = [each for each in records if each.opcode != FOOTER]
    end = next(index for index, each in enumerate(body) if each.opcode == DATA_END)
    data, summary = joined(body[: end + 1]), joined(body[end + 1 :])
    start = len(MAGIC) + len(data) if summary else 0
    head = _HEAD.pack(FOOTER, _FOOTER.size) + struct.pack("<QQ", start, 0)
    footer = Record(FOOTER, _FOOTER.pack(start, 0, zlib.crc32(summary + head) if summary else 0))
    return MAGIC + data + summary + footer.packed() + MAGIC


@dataclass(frozen=True, slots=True)
class Chunk:
    """What a chunk record says."""

    start_ns: int
    stop_ns: int
    size: int
    crc: int
    compression: bytes
    data: bytes

    @staticmethod
    def of(record: Record) -> Chunk:
        """Read a chunk."""
        start_ns, stop_ns, size, crc = _CHUNK.unpack_from(record.content)
        at = _CHUNK.size
        (length,) = struct.unpack_from("<I", record.content, at)
        compression = record.content[at + 4 : at + 4 + length]
        return Chunk(start_ns, stop_ns, size, crc, compression, record.content[at + 4 + length + 8 :])

    def record(self) -> Record:
        """Return the record."""
        head = _CHUNK.pack(self.start_ns, self.stop_ns, self.size, self.crc)
        name = struct.pack("<I", len(self.compression)) + self.compression
        return Record(CHUNK, head + name + struct.pack("<Q", len(self.data)) + self.data)

    def with_records(self, change: Callable[[list[Record]], Sequence[Record]]) -> Chunk:
        """Return the chunk with other records in it, and the checksum of these if it had one."""
        plain = joined(change(records_in(self._plain())))
        crc = zlib.crc32(plain) if self.crc else 0
        return replace(self, size=len(plain), crc=crc, data=self._packed(plain))

    def _plain(self) -> bytes:
        if self.compression == b"zstd":
            import zstandard

            return zstandard.ZstdDecompressor().decompress(self.data, self.size)
        if self.compression == b"lz4":
            from lz4.frame import decompress

            return bytes(decompress(self.data))
        return self.data

    def _packed(self, plain: bytes) -> bytes:
        if self.compression == b"zstd":
            import zstandard

            return zstandard.ZstdCompressor().compress(plain)
        if self.compression == b"lz4":
            from lz4.frame import compress

            return bytes(compress(plain))
        return plain
