"""The records of a ROS 1 bag: where they are, and whether what is there is one at all.

A record is a header of named fields and data, each with its length in front. Nothing marks where a record begins and
nothing protects it, so that a record counts as one only if its header is, to the byte, what its kind has.
"""

from __future__ import annotations

import struct
from collections.abc import Collection, Iterator, Mapping
from itertools import chain, combinations
from typing import BinaryIO, NamedTuple

MESSAGE, BAG_HEADER, INDEX, CHUNK, CHUNK_INFO, CONNECTION = range(2, 8)

_U32 = struct.Struct("<I")
_U64 = struct.Struct("<Q")
_TIME = struct.Struct("<II")
_SECOND_NS = 1_000_000_000
_MOST_HEADER_BYTES = 1 << 16
_BLOCK_BYTES = 1 << 20
_INDEX_ROW = struct.Struct("<III")

# Names and sizes of the fields that each kind has; None where any size will do.
_FIELDS: dict[int, dict[bytes, int | None]] = {
    MESSAGE: {b"conn": 4, b"time": 8},
    BAG_HEADER: {b"index_pos": 8, b"conn_count": 4, b"chunk_count": 4},
    INDEX: {b"ver": 4, b"conn": 4, b"count": 4},
    CHUNK: {b"compression": None, b"size": 4},
    CHUNK_INFO: {b"ver": 4, b"chunk_pos": 8, b"start_time": 8, b"end_time": 8, b"count": 4},
    CONNECTION: {b"conn": 4, b"topic": None},
}
_NAMES = {b"op", *(name for fields in _FIELDS.values() for name in fields)}
_LONGEST_NAME_BYTES = max(map(len, _NAMES)) + 1
_OP = b"\x04\0\0\0op="
# "none", "bz2" and "lz4"
_COMPRESSION_SIZES = (4, 3)


class Record(NamedTuple):
    """Where a record, its data and its end are in a file, or in a chunk; its end may lie beyond the end of those."""

    op: int
    fields: Mapping[bytes, bytes]
    start: int
    data: int
    end: int

    def number(self, name: bytes) -> int:
        """Return a field that is a number."""
        value = self.fields[name]
        (number,) = (_U32 if len(value) == _U32.size else _U64).unpack(value)
        return int(number)

    @property
    def time_ns(self) -> int:
        """When a message was recorded."""
        return time_ns(self.fields[b"time"])


def time_ns(value: bytes) -> int:
    """Return a time of seconds and nanoseconds."""
    seconds, nanoseconds = _TIME.unpack(value)
    return int(seconds * _SECOND_NS + nanoseconds)


def index_rows(data: bytes) -> Iterator[tuple[int, int]]:
    """Yield time and place in its chunk of each message that the data of an index record lists."""
    for seconds, nanoseconds, inner in _INDEX_ROW.iter_unpack(data[: len(data) // _INDEX_ROW.size * _INDEX_ROW.size]):
        yield seconds * _SECOND_NS + nanoseconds, inner


def fields_of(header: bytes) -> dict[bytes, bytes] | None:
    """Return the fields of a header, or of the data of a connection record; None if it is not made of fields."""
    fields, start = {}, 0
    while start < len(header):
        if start + _U32.size > len(header):
            return None
        stop = start + _U32.size + _U32.unpack_from(header, start)[0]
        name, separator, value = header[start + _U32.size : stop].partition(b"=")
        if stop > len(header) or not separator:
            return None
        fields[name] = value
        start = stop
    return fields


def record_in(chunk: bytes, start: int) -> Record | None:
    """Return the record whose header is at a byte of a chunk; None if there is none."""
    length = _header_length(chunk[start : start + 4])
    if length is None:
        return None
    return _record(chunk[start + 4 : start + 8 + length], start, length)


def is_unfinished(rest: bytes) -> bool:
    """Tell whether bytes up to the end of what is there are too few to tell whether they are the header of a record."""
    length = _header_length(rest[:4])
    if length is None:
        return len(rest) < _U32.size
    return len(rest) < length + 8 and _are_known_fields(rest[4 : 4 + length], length)


def _are_known_fields(header: bytes, length: int) -> bool:
    """Tell whether what is there of a header of this length is what headers begin with."""
    start = 0
    while start + _U32.size <= len(header):
        begin = start + _U32.size
        start = begin + _U32.unpack_from(header, start)[0]
        if start > length:
            return False
        name, separator, _ = header[begin : min(start, begin + _LONGEST_NAME_BYTES)].partition(b"=")
        if not any(known == name if separator else known.startswith(name) for known in _NAMES):
            return False
    return True


def record_of(file: BinaryIO, start: int) -> Record | None:
    """Return the record whose header is at a byte of a file; None if there is none."""
    file.seek(start)
    length = _header_length(file.read(4))
    return None if length is None else _record(file.read(length + 4), start, length)


def find_in(chunk: bytes, start: int, ops: Collection[int]) -> int | None:
    """Return where, from a byte of a chunk on, the next record of one of these kinds begins; None if there is none."""
    hit = chunk.find(_OP, start)
    while hit >= 0:
        for candidate in _candidates(chunk[hit + len(_OP) : hit + len(_OP) + 1], hit, ops):
            record = record_in(chunk, candidate) if candidate >= start else None
            if record is not None and record.op in ops:
                return candidate
        hit = chunk.find(_OP, hit + 1)
    return None


def find_of(file: BinaryIO, start: int, ops: Collection[int]) -> int | None:
    """Return where, from a byte of a file on, the next record of one of these kinds begins; None if there is none."""
    overlap, base = b"", start
    while True:
        file.seek(base + len(overlap))
        block = file.read(_BLOCK_BYTES)
        if not block:
            return None
        block = overlap + block
        hit = block.find(_OP)
        # the byte that says which kind it is must be in the block as well
        while 0 <= hit < len(block) - len(_OP):
            for candidate in _candidates(block[hit + len(_OP) : hit + len(_OP) + 1], base + hit, ops):
                record = record_of(file, candidate) if candidate >= start else None
                if record is not None and record.op in ops:
                    return candidate
            hit = block.find(_OP, hit + 1)
        overlap = block[-len(_OP) :]
        base += len(block) - len(overlap)


def index_section(file: BinaryIO, start: int) -> Iterator[Record]:
    """Yield the records of the index at the end of a bag; none for ``start`` 0."""
    while start and (record := record_of(file, start)) is not None and record.op in {CONNECTION, CHUNK_INFO}:
        yield record
        start = record.end


def _header_length(head: bytes) -> int | None:
    if len(head) < _U32.size:
        return None
    (length,) = _U32.unpack(head)
    return length if length <= _MOST_HEADER_BYTES else None


def _record(header: bytes, start: int, length: int) -> Record | None:
    """Return the record of a header and the length of the data after it."""
    if len(header) < length + _U32.size:
        return None
    fields = fields_of(header[:length])
    op = fields.get(b"op", b"") if fields else b""
    if fields is None or len(op) != 1 or op[0] not in _FIELDS:
        return None
    data = start + length + 8
    record = Record(op[0], fields, start, data, data + _U32.unpack_from(header, length)[0])
    return record if _is_plausible(record) else None


def _is_plausible(record: Record) -> bool:
    fields = record.fields
    for name, size in _FIELDS[record.op].items():
        if name not in fields or (size is not None and len(fields[name]) != size):
            return False
    if record.op == INDEX:
        return record.end - record.data == record.number(b"count") * _INDEX_ROW.size
    return record.op != MESSAGE or _TIME.unpack(fields[b"time"])[1] < _SECOND_NS


def _before_op(op: int) -> tuple[int, ...]:
    """Return how many bytes of fields may lie between the beginning of a header and its op, whatever their order."""
    sizes = []
    for name, size in _FIELDS[op].items():
        choices = _COMPRESSION_SIZES if name == b"compression" else (size,)
        # a topic may have any size: it is written after the op
        sizes.append(tuple(4 + len(name) + 1 + each for each in choices if each is not None))
    subsets = chain.from_iterable(combinations(sizes, count) for count in range(len(sizes) + 1))
    return tuple(sorted({total for subset in subsets for total in _sums(subset)}))


def _sums(subset: tuple[tuple[int, ...], ...]) -> set[int]:
    totals = {0}
    for choices in subset:
        totals = {total + each for total in totals for each in choices}
    return totals


_BEFORE_OP = {op: _before_op(op) for op in _FIELDS}


def _candidates(op: bytes, hit: int, ops: Collection[int]) -> Iterator[int]:
    """Yield where the header may begin whose op is at ``hit``, the earliest first."""
    if op and op[0] in ops:
        for before in reversed(_BEFORE_OP[op[0]]):
            yield hit - before - _U32.size
