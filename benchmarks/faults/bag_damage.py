"""Damage to the records of ROS 1 bags."""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass, replace

from samples.world import Rng

MAGIC = b"#ROSBAG V2.0\n"
_BAG_HEADER, _INDEX, _CHUNK, _CHUNK_INFO, _CONNECTION = 3, 4, 5, 6, 7


@dataclass(frozen=True, slots=True)
class Record:
    """One record: a header of fields and data; ``told_length`` is the length it gives its data, None for its own."""

    fields: tuple[tuple[bytes, bytes], ...]
    data: bytes
    told_length: int | None = None

    @property
    def op(self) -> int:
        """What kind of record it is."""
        return dict(self.fields)[b"op"][0]

    def packed(self) -> bytes:
        """Return the record as it is written."""
        fields = [name + b"=" + value for name, value in self.fields]
        header = b"".join(struct.pack("<I", len(each)) + each for each in fields)
        length = len(self.data) if self.told_length is None else self.told_length
        return struct.pack("<I", len(header)) + header + struct.pack("<I", length % 2**32) + self.data

    def with_field(self, name: bytes, value: bytes) -> Record:
        """Return the record with another value of a field."""
        return replace(self, fields=tuple((key, value if key == name else old) for key, old in self.fields))


def parsed(data: bytes) -> list[Record]:
    """Return the records of an undamaged bag."""
    found, at = [], len(MAGIC)
    while at < len(data):
        (length,) = struct.unpack_from("<I", data, at)
        fields, inner, end = [], at + 4, at + 4 + length
        while inner < end:
            (size,) = struct.unpack_from("<I", data, inner)
            name, _, value = data[inner + 4 : inner + 4 + size].partition(b"=")
            fields.append((name, value))
            inner += 4 + size
        (size,) = struct.unpack_from("<I", data, end)
        found.append(Record(tuple(fields), data[end + 4 : end + 4 + size]))
        at = end + 4 + size
    return found


def written(records: list[Record]) -> bytes:
    """Return a bag of these records, its index at where its header says."""
    return MAGIC + b"".join(each.packed() for each in records)


def records_swapped(data: bytes, rng: Rng) -> bytes:
    """Exchange two records."""
    records = parsed(data)
    one, other = (int(rng.integers(1, len(records))) for _ in range(2))
    records[one], records[other] = records[other], records[one]
    return written(records)


def record_doubled(data: bytes, rng: Rng) -> bytes:
    """Write a record twice."""
    records = parsed(data)
    index = int(rng.integers(1, len(records)))
    return written([*records[: index + 1], *records[index:]])


def record_removed(data: bytes, rng: Rng) -> bytes:
    """Leave a record out."""
    records = parsed(data)
    index = int(rng.integers(len(records)))
    return written([*records[:index], *records[index + 1 :]])


def cut_between_records(data: bytes, rng: Rng) -> bytes:
    """End early after a whole record."""
    records = parsed(data)
    return written(records[: int(rng.integers(len(records)))])


def length_inflated(data: bytes, rng: Rng) -> bytes:
    """Let a record say that its data is longer, or shorter, than it is."""
    others = (1, -1, 1000, 2**31 - 1, 2**32 - 1)
    return _one_changed(
        data, rng, None, lambda each: replace(each, told_length=len(each.data) + others[int(rng.integers(5))])
    )


def without_index(data: bytes, rng: Rng) -> bytes:
    """Leave out the index, as when a recorder is killed; sometimes the last chunk's end as well."""
    records = parsed(data)
    (index_pos,) = struct.unpack("<Q", dict(records[0].fields)[b"index_pos"])
    records[0] = records[0].with_field(b"index_pos", bytes(8))
    whole = written(records)[:index_pos]
    return whole if rng.uniform() < 0.5 else whole[: int(rng.integers(4200, len(whole)))]


def header_wrong(data: bytes, rng: Rng) -> bytes:
    """Let the bag's header say another place of the index, or other counts."""
    name = (b"index_pos", b"conn_count", b"chunk_count")[int(rng.integers(3))]
    records = parsed(data)
    size = len(dict(records[0].fields)[name])
    value = [rng.bytes(size), int(rng.integers(len(data))).to_bytes(size, "little")][int(rng.integers(2))]
    records[0] = records[0].with_field(name, value)
    return written(records)


def chunk_damaged(data: bytes, rng: Rng) -> bytes:
    """Change bytes of what the first chunk, or one in the middle, holds."""
    records = parsed(data)
    found = [index for index, each in enumerate(records) if each.op == _CHUNK]
    index = found[0 if rng.uniform() < 0.5 else len(found) // 2]
    records[index] = replace(records[index], data=_noisy(records[index].data, rng))
    return written(records)


def chunk_size_wrong(data: bytes, rng: Rng) -> bytes:
    """Let a chunk say that it is of another size."""
    size = struct.pack("<I", int(rng.integers(2**32)) if rng.uniform() < 0.5 else int(rng.integers(20000)))
    return _one_changed(data, rng, _CHUNK, lambda each: each.with_field(b"size", size))


def chunk_compression_wrong(data: bytes, rng: Rng) -> bytes:
    """Let a chunk say that it is compressed otherwise."""
    names = (b"none", b"bz2", b"lz4", b"zstd", b"")
    name = names[int(rng.integers(len(names)))]
    return _one_changed(data, rng, _CHUNK, lambda each: each.with_field(b"compression", name))


def index_falsified(data: bytes, rng: Rng) -> bytes:
    """Change bytes of an index record."""
    kind = (_INDEX, _CHUNK_INFO)[int(rng.integers(2))]
    return _one_changed(data, rng, kind, lambda each: replace(each, data=_noisy(each.data, rng)))


def index_header_falsified(data: bytes, rng: Rng) -> bytes:
    """Let an index record say another connection, count, place or time."""
    kind = (_INDEX, _CHUNK_INFO)[int(rng.integers(2))]

    def change(record: Record) -> Record:
        name, value = record.fields[int(rng.integers(1, len(record.fields)))]
        return record.with_field(name, _noisy(value, rng))

    return _one_changed(data, rng, kind, change)


def schema_removed(data: bytes, rng: Rng) -> bytes:
    """Leave out connection records of the index."""
    return _connections(data, rng, lambda _: None)


def schema_emptied(data: bytes, rng: Rng) -> bytes:
    """Leave out the definition and the sum of a connection."""
    return _connections(data, rng, lambda info: {**info, b"message_definition": b"", b"md5sum": b"*"})


def schema_altered(data: bytes, rng: Rng) -> bytes:
    """Let a connection have other fields."""
    return _connections(
        data, rng, lambda info: {**info, b"message_definition": b"string note\n" + info[b"message_definition"]}
    )


def field_removed(data: bytes, rng: Rng) -> bytes:
    """Leave out a field of a record's header."""

    def change(record: Record) -> Record:
        left_out = int(rng.integers(len(record.fields)))
        return replace(record, fields=tuple(each for at, each in enumerate(record.fields) if at != left_out))

    return _one_changed(data, rng, None, change)


def _connections(data: bytes, rng: Rng, change: Callable[[dict[bytes, bytes]], dict[bytes, bytes] | None]) -> bytes:
    """Change one connection record of the index."""
    records = parsed(data)
    found = [index for index, each in enumerate(records) if each.op == _CONNECTION]
    index = found[int(rng.integers(len(found)))]
    info = change(dict(_fields(records[index].data)))
    if info is None:
        return written([*records[:index], *records[index + 1 :]])
    body = [name + b"=" + value for name, value in info.items()]
    records[index] = replace(records[index], data=b"".join(struct.pack("<I", len(each)) + each for each in body))
    return written(records)


def _fields(data: bytes) -> list[tuple[bytes, bytes]]:
    found, at = [], 0
    while at < len(data):
        (size,) = struct.unpack_from("<I", data, at)
        name, _, value = data[at + 4 : at + 4 + size].partition(b"=")
        found.append((name, value))
        at += 4 + size
    return found


def _one_changed(data: bytes, rng: Rng, kind: int | None, change: Callable[[Record], Record]) -> bytes:
    records = parsed(data)
    found = [index for index, each in enumerate(records) if kind in {None, each.op}]
    index = found[int(rng.integers(len(found)))]
    records[index] = change(records[index])
    return written(records)


def _noisy(content: bytes, rng: Rng) -> bytes:
    changed = bytearray(content)
    for _ in range(int(rng.integers(1, 4))):
        if changed:
            changed[int(rng.integers(len(changed)))] = int(rng.integers(256))
    return bytes(changed)
