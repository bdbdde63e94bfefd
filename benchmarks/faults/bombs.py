"""Compressed data of some kilobytes that grows to a gigabyte or more, in place of a chunk, a message or a file."""

from __future__ import annotations

import bz2
import sqlite3
import struct
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import replace
from functools import cache

from benchmarks.faults import bag_damage, mcap_layout
from benchmarks.faults.formats import Format
from samples.world import Rng

SIZES = (1 << 26, 5 << 28)
"""What is decompressed: much, and more than any chunk may have, in bytes."""
_FILE_BYTES = 1 << 33
_ZSTD_BLOCK_BYTES = 1 << 17
_LZ4_BLOCK_BYTES = 1 << 22
_MCAP_MESSAGE, _BAG_CHUNK = 5, 5
_MCAP_MESSAGE_HEAD_BYTES = 22


def planted(kind: Format, data: bytes, rng: Rng) -> bytes:
    """Return a file with such data in place of something."""
    size = SIZES[int(rng.integers(len(SIZES)))]
    if kind.compressed == "files":
        # alone, or after a file that is whole
        return (data if rng.uniform() < 0.5 else b"") + zeros_zstd(_FILE_BYTES)
    if kind.compressed == "messages":
        change = _in_mcap_message if kind.container == "mcap" else _in_row
        return change(data, zeros_zstd(size), rng)
    bomb = _ZEROS[kind.compression](size)
    told = size if rng.uniform() < 0.5 else None
    return _in_bag(data, bomb, told, rng) if kind.container == "bag" else _in_mcap(data, bomb, told, rng)


def zeros_zstd(size: int) -> bytes:
    """Return a frame of blocks of one byte that is repeated, which says no size."""
    count = size // _ZSTD_BLOCK_BYTES
    block = struct.pack("<I", 1 << 1 | _ZSTD_BLOCK_BYTES << 3)[:3] + b"\0"
    last = struct.pack("<I", 1 | 1 << 1 | _ZSTD_BLOCK_BYTES << 3)[:3] + b"\0"
    return b"\x28\xb5\x2f\xfd\x00\x38" + block * (count - 1) + last


@cache
def zeros_lz4(size: int) -> bytes:
    """Return a frame of one block that is repeated."""
    from lz4.frame import BLOCKSIZE_MAX4MB, compress

    one = compress(bytes(_LZ4_BLOCK_BYTES), block_size=BLOCKSIZE_MAX4MB, block_linked=False, store_size=False)
    head, block, end = bytes(one[:7]), bytes(one[7:-4]), bytes(one[-4:])
    return head + block * (size // _LZ4_BLOCK_BYTES) + end


@cache
def zeros_bz2(size: int) -> bytes:
    """Return what bz2 makes of zeros."""
    compressor = bz2.BZ2Compressor()
    piece = bytes(1 << 24)
    return b"".join(compressor.compress(piece) for _ in range(size >> 24)) + compressor.flush()


_ZEROS: Mapping[str, Callable[[int], bytes]] = {"zstd": zeros_zstd, "lz4": zeros_lz4, "bz2": zeros_bz2}


def _in_bag(data: bytes, bomb: bytes, told: int | None, rng: Rng) -> bytes:
    records = bag_damage.parsed(data)
    found = [index for index, each in enumerate(records) if each.op == _BAG_CHUNK]
    index = found[int(rng.integers(len(found)))]
    other = replace(records[index], data=bomb)
    records[index] = other if told is None else other.with_field(b"size", struct.pack("<I", told))
    return bag_damage.written(records)


def _in_mcap(data: bytes, bomb: bytes, told: int | None, rng: Rng) -> bytes:
    records = mcap_layout.parsed(data)
    found = [index for index, each in enumerate(records) if each.opcode == mcap_layout.CHUNK]
    index = found[int(rng.integers(len(found)))]
    chunk = mcap_layout.Chunk.of(records[index])
    records[index] = replace(chunk, data=bomb, size=chunk.size if told is None else told, crc=0).record()
    return mcap_layout.written(records)


def _in_mcap_message(data: bytes, bomb: bytes, rng: Rng) -> bytes:
    def change(records: list[mcap_layout.Record]) -> list[mcap_layout.Record]:
        found = [index for index, each in enumerate(records) if each.opcode == _MCAP_MESSAGE]
        index = found[int(rng.integers(len(found)))]
        content = records[index].content[:_MCAP_MESSAGE_HEAD_BYTES] + bomb
        return [*records[:index], replace(records[index], content=content), *records[index + 1 :]]

    outside = [each for each in mcap_layout.parsed(data) if each.opcode not in mcap_layout.INDEXES]
    at = next(index for index, each in enumerate(outside) if each.opcode == mcap_layout.CHUNK)
    outside[at] = mcap_layout.Chunk.of(outside[at]).with_records(change).record()
    return mcap_layout.closed(outside)


def _in_row(data: bytes, bomb: bytes, rng: Rng) -> bytes:
    with closing(sqlite3.connect(":memory:")) as database:
        database.deserialize(data)
        keys = [key for (key,) in database.execute("SELECT id FROM messages ORDER BY id")]
        database.execute("UPDATE messages SET data = ? WHERE id = ?", (bomb, keys[int(rng.integers(len(keys)))]))
        database.commit()
        return database.serialize()
