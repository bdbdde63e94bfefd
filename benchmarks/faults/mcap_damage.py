"""Damage to the records of MCAP files, and what careless writers leave out or get wrong."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from dataclasses import replace

from benchmarks.faults.mcap_layout import (
    CHANNEL,
    CHUNK,
    CHUNK_INDEX,
    DATA_END,
    FOOTER,
    INDEXES,
    MESSAGE_INDEX,
    SCHEMA,
    STATISTICS,
    Chunk,
    Record,
    closed,
    joined,
    parsed,
    written,
)
from replay.sources.base import GRID_TYPE
from replay.sources.mcap.records import MAGIC
from samples.world import Rng

Records = list[Record]


def records_swapped(data: bytes, rng: Rng) -> bytes:
    """Exchange two records."""
    records = parsed(data)
    one, other = (int(rng.integers(len(records))) for _ in range(2))
    records[one], records[other] = records[other], records[one]
    return written(records)


def record_doubled(data: bytes, rng: Rng) -> bytes:
    """Write a record twice."""
    records = parsed(data)
    index = int(rng.integers(len(records)))
    return written([*records[: index + 1], *records[index:]])


def record_removed(data: bytes, rng: Rng) -> bytes:
    """Leave a record out."""
    records = parsed(data)
    index = int(rng.integers(len(records)))
    return written([*records[:index], *records[index + 1 :]])


def cut_between_records(data: bytes, rng: Rng) -> bytes:
    """End early after a whole record."""
    records = parsed(data)
    return MAGIC + joined(records[: int(rng.integers(len(records)))])


def length_inflated(data: bytes, rng: Rng) -> bytes:
    """Let a record say that it is longer, or shorter, than it is."""
    return _one_changed(data, rng, lambda each: replace(each, told_length=_other_length(len(each.content), rng)))


def opcode_changed(data: bytes, rng: Rng) -> bytes:
    """Let a record say that it is of another kind."""
    return _one_changed(data, rng, lambda each: replace(each, opcode=int(rng.integers(256))))


def summary_removed(data: bytes, rng: Rng) -> bytes:
    """Leave out the summary."""
    del rng
    records = parsed(data)
    end = next(index for index, each in enumerate(records) if each.opcode == DATA_END)
    return closed(records[: end + 1])


def indexes_removed(data: bytes, rng: Rng) -> bytes:
    """Leave out some of the indexes, of messages or of chunks or both."""
    left_out = [{MESSAGE_INDEX}, {CHUNK_INDEX}, {MESSAGE_INDEX, CHUNK_INDEX}, {STATISTICS}][int(rng.integers(4))]
    return closed([each for each in parsed(data) if each.opcode not in left_out])


def chunk_damaged(data: bytes, rng: Rng) -> bytes | None:
    """Change bytes of what the first chunk, or one in the middle, holds."""
    records = parsed(data)
    found = [index for index, each in enumerate(records) if each.opcode == CHUNK]
    if not found:
        return None
    index = found[0 if rng.uniform() < 0.5 else len(found) // 2]
    chunk = Chunk.of(records[index])
    records[index] = replace(chunk, data=_noisy(chunk.data, rng)).record()
    return written(records)


def chunk_crc_wrong(data: bytes, rng: Rng) -> bytes | None:
    """Let a chunk have another checksum."""
    return _chunk_changed(data, rng, lambda chunk: replace(chunk, crc=int(rng.integers(1, 2**32))), only_checked=True)


def chunk_size_wrong(data: bytes, rng: Rng) -> bytes | None:
    """Let a chunk say that it is of another size."""
    return _chunk_changed(data, rng, lambda chunk: replace(chunk, size=_other_length(chunk.size, rng)))


def chunk_compression_wrong(data: bytes, rng: Rng) -> bytes | None:
    """Let a chunk say that it is compressed otherwise."""
    names = (b"", b"lz4", b"zstd", b"snappy", b"\x00\xff", b"z" * 300)
    return _chunk_changed(data, rng, lambda chunk: replace(chunk, compression=names[int(rng.integers(len(names)))]))


def inner_length_inflated(data: bytes, rng: Rng) -> bytes | None:
    """Let a record within a chunk say that it is of another length, with the right checksum."""

    def change(records: Records) -> Sequence[Record]:
        index = int(rng.integers(len(records)))
        other = replace(records[index], told_length=_other_length(len(records[index].content), rng))
        return [*records[:index], other, *records[index + 1 :]]

    return _chunk_changed(data, rng, lambda chunk: chunk.with_records(change))


def inner_record_removed(data: bytes, rng: Rng) -> bytes | None:
    """Leave out a record within a chunk, with the right checksum."""

    def change(records: Records) -> Sequence[Record]:
        index = int(rng.integers(len(records)))
        return [*records[:index], *records[index + 1 :]]

    return _chunk_changed(data, rng, lambda chunk: chunk.with_records(change))


def summary_crc_wrong(data: bytes, rng: Rng) -> bytes:
    """Let the summary have another checksum."""
    records = parsed(data)
    footer = records[-1]
    return written([*records[:-1], replace(footer, content=footer.content[:-4] + rng.bytes(4))])


def summary_falsified(data: bytes, rng: Rng) -> bytes | None:
    """Change bytes of a record of the summary, with the right checksum."""
    records = parsed(data)
    end = next(index for index, each in enumerate(records) if each.opcode == DATA_END)
    if end + 2 >= len(records):
        return None
    index = int(rng.integers(end + 1, len(records) - 1))
    records[index] = replace(records[index], content=_noisy(records[index].content, rng))
    return closed(records)


def message_index_falsified(data: bytes, rng: Rng) -> bytes | None:
    """Change bytes of a message index."""
    records = parsed(data)
    found = [index for index, each in enumerate(records) if each.opcode == MESSAGE_INDEX]
    if not found:
        return None
    index = found[int(rng.integers(len(found)))]
    records[index] = replace(records[index], content=_noisy(records[index].content, rng))
    return written(records)


def schema_removed(data: bytes, rng: Rng) -> bytes:
    """Leave out all schemas."""
    del rng
    return _everywhere(data, lambda records: [each for each in records if each.opcode != SCHEMA])


def schema_emptied(data: bytes, rng: Rng) -> bytes:
    """Leave out the text of the schema of maps."""
    del rng
    return _schemas(data, lambda name, kind, text: (name, kind, text[:0]))


def schema_altered(data: bytes, rng: Rng) -> bytes:
    """Let the schema of maps have other fields."""
    texts: list[Callable[[bytes], bytes]] = [
        lambda text: text.replace(b"int8[] data", b"float32[] data"),
        lambda text: text.replace(b"float32 resolution", b"float64 resolution"),
        lambda text: b"string note\n" + text,
    ]
    alter = texts[int(rng.integers(len(texts)))]
    return _schemas(data, lambda name, kind, text: (name, kind, alter(text)))


def schema_encoding_changed(data: bytes, rng: Rng) -> bytes:
    """Let the schema of maps be in a language that is not known, or in another one."""
    encodings = (b"ros3msg", b"", b"ros2idl", b"jsonschema", b"protobuf", b"\xff\x00", b"ros1msg", b"z" * 300)
    encoding = encodings[int(rng.integers(len(encodings)))]
    return _schemas(data, lambda name, _, text: (name, encoding, text))


def channel_encoding_changed(data: bytes, rng: Rng) -> bytes:
    """Let a channel of maps say that it is encoded otherwise."""
    encodings = (b"json", b"", b"cdr2", b"ros1", b"cdr", b"protobuf")
    encoding = encodings[int(rng.integers(len(encodings)))]
    topic = (b"/r1/map", b"/r2/map")[int(rng.integers(2))]

    def change(content: bytes) -> bytes:
        name, end = _text_at(content, 4)
        _, after = _text_at(content, end)
        return content if name != topic else content[:end] + _text(encoding) + content[after:]

    return _contents(data, CHANNEL, change)


def data_end_wrong(data: bytes, rng: Rng) -> bytes:
    """Let the checksum of all data be another, or be missing with its record."""
    records = parsed(data)
    end = next(index for index, each in enumerate(records) if each.opcode == DATA_END)
    other = [replace(records[end], content=rng.bytes(4))] if rng.uniform() < 0.7 else []
    return written([*records[:end], *other, *records[end + 1 :]])


def footer_wrong(data: bytes, rng: Rng) -> bytes:
    """Let the footer point elsewhere."""
    records = parsed(data)
    start = [0, 1, 8, len(data), 2**63, 2**64 - 1, int(rng.integers(len(data)))][int(rng.integers(7))]
    return written([*records[:-1], Record(FOOTER, struct.pack("<Q", start) + records[-1].content[8:])])


def _schemas(data: bytes, change: Callable[[bytes, bytes, bytes], tuple[bytes, bytes, bytes]]) -> bytes:
    """Change name, encoding and text of the schema of maps, wherever it stands."""

    def changed(content: bytes) -> bytes:
        name, end = _text_at(content, 2)
        kind, end = _text_at(content, end)
        text, _ = _text_at(content, end)
        is_map = name.replace(b"/msg/", b"/") == GRID_TYPE.replace("/msg/", "/").encode()
        return content[:2] + b"".join(map(_text, change(name, kind, text))) if is_map else content

    return _contents(data, SCHEMA, changed)


def _contents(data: bytes, opcode: int, change: Callable[[bytes], bytes]) -> bytes:
    def changed(records: Records) -> Records:
        return [replace(each, content=change(each.content)) if each.opcode == opcode else each for each in records]

    return _everywhere(data, changed)


def _everywhere(data: bytes, change: Callable[[Records], Records]) -> bytes:
    """Change records within chunks and outside of them. Indexes are left out, for offsets are others then."""
    outside = change([each for each in parsed(data) if each.opcode not in INDEXES])
    return closed([Chunk.of(each).with_records(change).record() if each.opcode == CHUNK else each for each in outside])


def _chunk_changed(
    data: bytes, rng: Rng, change: Callable[[Chunk], Chunk], *, only_checked: bool = False
) -> bytes | None:
    records = parsed(data)
    found = [
        index for index, each in enumerate(records) if each.opcode == CHUNK and (Chunk.of(each).crc or not only_checked)
    ]
    if not found:
        return None
    index = found[int(rng.integers(len(found)))]
    records[index] = change(Chunk.of(records[index])).record()
    return written(records)


def _one_changed(data: bytes, rng: Rng, change: Callable[[Record], Record]) -> bytes:
    records = parsed(data)
    index = int(rng.integers(len(records)))
    records[index] = change(records[index])
    return written(records)


def _other_length(length: int, rng: Rng) -> int:
    """Return another length: nearly that, absurd, or none."""
    others = (length + 1, max(0, length - 1), length * 2 + 9, 2**31 - 1, 2**40, 2**63 - 1, 2**64 - 1, 0)
    return others[int(rng.integers(len(others)))]


def _noisy(content: bytes, rng: Rng) -> bytes:
    changed = bytearray(content)
    for _ in range(int(rng.integers(1, 4))):
        if changed:
            changed[int(rng.integers(len(changed)))] = int(rng.integers(256))
    return bytes(changed)


def _text_at(content: bytes, at: int) -> tuple[bytes, int]:
    (length,) = struct.unpack_from("<I", content, at)
    return content[at + 4 : at + 4 + length], at + 4 + length


def _text(value: bytes) -> bytes:
    return struct.pack("<I", len(value)) + value
