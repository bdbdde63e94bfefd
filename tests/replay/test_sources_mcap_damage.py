"""Damaged MCAP files: what is right in them is used, the rest named, and nothing wrong is taken for right."""

from __future__ import annotations

import functools
import struct
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import lz4.frame
import numpy as np
import pytest
import zstandard
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mcap.data_stream import RecordBuilder
from mcap.records import Channel, Chunk, Header, Message, Schema
from mcap.writer import Writer

from replay.codec import ros2_message_definition
from replay.errors import InputError
from replay.skip_cause import SkipCause
from replay.sources import open_source
from replay.sources.base import GRID_TYPE, TF_TYPE, RawMessage, SourceInfo
from replay.sources.losses import Loss
from replay.sources.mcap import resume
from replay.sources.mcap.file import McapFile
from replay.sources.mcap.records import MAGIC
from tests import bags
from tests.bags import NO_INDEX, NO_SUMMARY, SAMPLE, SECOND, START, Recorded

TOPICS = {"/r1/map", "/r2/map", "/r1/map_updates", "/chatter"}
DATA_END, FOOTER, CHUNK, MESSAGE, MESSAGE_INDEX = 15, 2, 6, 5, 7
Key = tuple[str, int, bytes]

SMALL: tuple[Recorded, ...] = tuple(
    Recorded(
        f"/r{1 + index % 2}/map",
        GRID_TYPE,
        START + index * SECOND,
        bags.map_fields(bags.grid(index, rows=3, cols=5), START, "map"),
    )
    for index in range(6)
)

LAYOUTS: dict[str, dict[str, Any]] = {
    "none": {"compression": "none", "chunk_bytes": 400},
    "lz4": {"compression": "lz4", "chunk_bytes": 400},
    "zstd": {"compression": "zstd", "chunk_bytes": 400},
    "unchunked": {"use_chunking": False},
}


def _key(message: RawMessage) -> Key:
    return message.topic, message.log_time_ns, bytes(message.data)


def _read(path: Path, topics: Iterable[str] = TOPICS) -> tuple[list[Key], tuple[Loss, ...], SourceInfo]:
    with open_source(path) as source:
        found = [_key(each) for each in source.messages(tuple(topics))]
        return found, source.losses.all, source.info


def _written(messages: Iterable[Recorded]) -> list[Key]:
    """Return the messages as they are to be read."""
    keys = [(each.topic, each.log_time_ns, bags.as_cdr(each)) for each in messages]
    return sorted(keys, key=lambda key: key[1])


def _records(data: bytes, start: int = len(MAGIC)) -> Iterator[tuple[int, int, int]]:
    """Yield opcode, begin and end of the records of a file; the last one may reach beyond it."""
    while start + 9 <= len(data):
        opcode, length = struct.unpack_from("<BQ", data, start)
        yield opcode, start, start + 9 + length
        start += 9 + length


def _place(data: bytes, opcode: int, number: int = 0) -> tuple[int, int]:
    return [(start, end) for each, start, end in _records(data) if each == opcode][number]


def _changed(path: Path, at: int, new: bytes) -> None:
    data = bytearray(path.read_bytes())
    data[at : at + len(new)] = new
    path.write_bytes(data)


# --- truncation


def _left(data: bytes, length: int) -> tuple[Counter[tuple[int, int]], bool]:
    """Return which messages (by channel and time) are whole in what is left of a file, and whether all of its data is.

    Written with nothing but the format's description and the decompressors.
    """
    found: Counter[tuple[int, int]] = Counter()
    for opcode, start, end in _records(data[:length]):
        if opcode == DATA_END and end <= length:
            return found, True
        if opcode == MESSAGE and end <= length:
            found[struct.unpack_from("<H4xQ", data, start + 9)] += 1
        if opcode == CHUNK:
            inner = _inner(data[:length], start + 9)
            for kind, begin, stop in _records(inner, 0):
                if kind == MESSAGE and stop <= len(inner):
                    found[struct.unpack_from("<H4xQ", inner, begin + 9)] += 1
    return found, False


def _inner(data: bytes, content: int) -> bytes:
    """Return what can be decompressed of a chunk."""
    if content + 32 > len(data):
        return b""
    (length,) = struct.unpack_from("<I", data, content + 28)
    kind = data[content + 32 : content + 32 + length]
    begin = content + 32 + length + 8
    if begin > len(data):
        return b""
    (size,) = struct.unpack_from("<Q", data, begin - 8)
    compressed = data[begin : begin + size]
    if kind == b"zstd":
        return zstandard.ZstdDecompressor().decompressobj().decompress(compressed)
    if kind == b"lz4":
        # told no limit, it leaves some of what it could give inside
        return bytes(lz4.frame.LZ4FrameDecompressor().decompress(compressed, 1 << 24)) if compressed else b""
    return compressed


@pytest.mark.parametrize(
    "options", [{}, NO_SUMMARY, {"enable_crcs": False}], ids=["indexed", "no-summary", "no-checksum"]
)
@pytest.mark.parametrize("layout", LAYOUTS)
def test_of_a_file_cut_off_at_any_byte_all_whole_messages_are_used(
    tmp_path: Path, layout: str, options: dict[str, Any]
) -> None:
    data = bags.write_mcap(tmp_path / "whole.mcap", SMALL, **LAYOUTS[layout], **options).read_bytes()
    written = _written(SMALL)
    channel_of = {"/r1/map": 1, "/r2/map": 2}
    path = tmp_path / "cut.mcap"
    sizes = set()
    _, end = _place(data, DATA_END)
    for length in (*range(len(MAGIC), end + 9), *range(end + 9, len(data) + 1, 7)):
        path.write_bytes(data[:length])
        expected, is_closed = _left(data, length)
        found, losses, info = _read(path)
        assert Counter((channel_of[topic], time) for topic, time, _ in found) == expected, length
        assert set(found) <= set(written)
        assert sum(each.message_count for each in info.topics) == len(found)
        ends = max((end for _, _, end in _records(data[:length]) if end <= length), default=len(MAGIC))
        named = [(SkipCause.ENDS_EARLY, f"byte {ends}")]
        assert [(loss.cause, loss.place) for loss in losses] == ([] if is_closed else named), length
        sizes.add(len(found))
    assert sizes >= {0, len(SMALL)}
    assert len(sizes) > 2


@pytest.mark.parametrize("compression", ["none", "lz4", "zstd"])
def test_of_a_truncated_chunk_all_that_can_be_decompressed_is_used(tmp_path: Path, compression: str) -> None:
    messages = [bags.recorded_map("/r1/map", START + index * SECOND, seed=index, rows=400) for index in range(24)]
    path = bags.write_mcap(tmp_path / "a.mcap", messages, compression=compression, chunk_bytes=1 << 30)  # type: ignore[arg-type]
    data = path.read_bytes()
    start, end = _place(data, CHUNK)
    path.write_bytes(data[: start + (end - start) * 2 // 3])
    expected, _ = _left(path.read_bytes(), start + (end - start) * 2 // 3)
    found, losses, info = _read(path)
    assert found == _written(messages)[: expected.total()]
    assert len(found) >= 8
    assert info.stop_ns == found[-1][1]
    assert [loss.cause for loss in losses] == [SkipCause.ENDS_EARLY]


@pytest.mark.parametrize("layout", LAYOUTS)
def test_space_that_was_reserved_and_not_written(tmp_path: Path, layout: str) -> None:
    path = bags.write_mcap(tmp_path / "a.mcap", SMALL, **LAYOUTS[layout])
    data = path.read_bytes()
    written = set(_written(SMALL))
    for length in range(300, len(data) - 100, 41):
        path.write_bytes(data[:length] + bytes(5000))
        found, losses, _ = _read(path)
        expected, is_closed = _left(data, length)
        # a message that ends in zeros may be cut off within them
        assert expected.total() - 1 <= len(found) <= expected.total()
        assert set(found) <= written
        assert [loss.cause for loss in losses] == ([] if is_closed else [SkipCause.ENDS_EARLY])


def test_a_message_that_ends_in_zeros_that_may_never_have_been_written_is_not_used(tmp_path: Path) -> None:
    zeros = Recorded(
        "/map", GRID_TYPE, START + 9, bags.map_fields(bags.grid(1), START) | {"data": np.zeros(2400, "i1")}
    )
    path = bags.write_mcap(tmp_path / "a.mcap", [*SMALL, zeros], use_chunking=False, **NO_SUMMARY)
    data = path.read_bytes()
    _, end = _place(data, MESSAGE, len(SMALL))
    path.write_bytes(data[:end])
    assert len(_read(path, ["/map"])[0]) == 1
    for length in (end, end - 1000):
        path.write_bytes(data[:length] + bytes(4096))
        found, losses, _ = _read(path, ["/map"])
        assert found == []
        assert [loss.cause for loss in losses] == [SkipCause.ENDS_EARLY]


@pytest.mark.parametrize("length", [8, 9, 17, 20])
def test_a_file_that_holds_hardly_more_than_its_magic_bytes(tmp_path: Path, length: int) -> None:
    path = bags.write_mcap(tmp_path / "a.mcap", SMALL)
    path.write_bytes(path.read_bytes()[:length])
    found, losses, info = _read(path)
    assert (found, info.topics, info.start_ns, info.stop_ns) == ([], (), None, None)
    assert losses == (Loss(SkipCause.ENDS_EARLY, "byte 8", losses[0].detail),)


# --- what is around the data


@pytest.mark.parametrize("layout", LAYOUTS)
def test_flips_behind_the_data_cost_nothing(tmp_path: Path, layout: str) -> None:
    path = bags.write_mcap(tmp_path / "a.mcap", SMALL, **LAYOUTS[layout])
    data = path.read_bytes()
    _, end = _place(data, DATA_END)
    written = _written(SMALL)
    # All bytes that are not of the text of a definition, and some of those.
    known = {at for at in range(end, len(data)) if data[at] < 0x20 or data[at] > 0x7F} | set(range(end, len(data), 9))
    for number, at in enumerate(sorted(known)):
        flipped = bytearray(data)
        flipped[at] ^= (0x01, 0x80, 0x10)[number % 3]
        path.write_bytes(flipped)
        assert _read(path)[:2] == (written, ()), at


@pytest.mark.parametrize("layout", ["none", "lz4", "zstd"])
def test_an_index_that_lies_is_not_believed(tmp_path: Path, layout: str) -> None:
    path = bags.write_mcap(tmp_path / "a.mcap", SMALL, **LAYOUTS[layout])
    data = path.read_bytes()
    places = [(start, end) for opcode, start, end in _records(data) if opcode == MESSAGE_INDEX]
    for start, end in places:
        for at in range(start, end):
            flipped = bytearray(data)
            flipped[at] ^= 0x41
            path.write_bytes(flipped)
            found, losses, _ = _read(path)
            assert found == _written(SMALL), at
            assert losses == ()


@pytest.mark.parametrize("later_ns", [SECOND // 2, 1 << 45])
@pytest.mark.parametrize("is_checked", [True, False])
def test_an_index_that_says_that_an_old_map_is_newer_hides_it_at_no_time(
    tmp_path: Path, later_ns: int, *, is_checked: bool
) -> None:
    robots = (1, 1, 2, 1, 1, 2, 3, 1)
    messages = [bags.recorded_map(f"/r{robot}/map", START + i * SECOND // 4, seed=i) for i, robot in enumerate(robots)]
    path = tmp_path / "a.mcap"
    for chunk_bytes in (100, 6000, 1 << 20):
        bags.write_mcap(path, messages, chunk_bytes=chunk_bytes, enable_crcs=is_checked)
        data = path.read_bytes()
        for start, end in [(start, end) for opcode, start, end in _records(data) if opcode == MESSAGE_INDEX]:
            for at in range(start + 15, end, 16):
                changed = struct.pack("<Q", struct.unpack_from("<Q", data, at)[0] + later_ns)
                path.write_bytes(data[:at] + changed + data[at + 8 :])
                assert _read(path, ["/r1/map", "/r2/map", "/r3/map"])[:2] == (_written(messages), ())


def test_an_index_that_names_a_message_twice_is_not_believed(tmp_path: Path) -> None:
    messages = [SMALL[0], SMALL[2], SMALL[4]]
    path = bags.write_mcap(tmp_path / "a.mcap", messages, compression="none", chunk_bytes=1 << 20)
    start, _ = _place(path.read_bytes(), MESSAGE_INDEX)
    _changed(path, start + 15 + 16, path.read_bytes()[start + 15 : start + 31])
    assert _read(path)[:2] == (_written(messages), ())


@pytest.mark.parametrize("extra", [bytes(4096), b"\x05garbage", MAGIC, MAGIC * 3])
def test_what_is_behind_the_end_does_not_matter(tmp_path: Path, extra: bytes) -> None:
    path = bags.write_mcap(tmp_path / "a.mcap", SMALL)
    path.write_bytes(path.read_bytes() + extra)
    assert _read(path)[:2] == (_written(SMALL), ())


def test_magic_bytes_that_are_there_twice(tmp_path: Path) -> None:
    path = bags.write_mcap(tmp_path / "a.mcap", SMALL)
    path.write_bytes(MAGIC + path.read_bytes())
    assert _read(path)[:2] == (_written(SMALL), ())


def test_files_put_together_end_to_end_are_named(tmp_path: Path) -> None:
    first = bags.write_mcap(tmp_path / "a.mcap", SMALL).read_bytes()
    second = bags.write_mcap(tmp_path / "b.mcap", SAMPLE).read_bytes()
    path = tmp_path / "both.mcap"
    path.write_bytes(first + second)
    found, losses, _ = _read(path)
    assert found == _written(SMALL)
    assert [(loss.cause, loss.place) for loss in losses] == [
        (SkipCause.DAMAGED, f"bytes {len(first)} to {len(first) + len(second)}")
    ]


def test_an_empty_chunk_does_no_harm(tmp_path: Path) -> None:
    path = bags.write_mcap(tmp_path / "a.mcap", SMALL, **NO_SUMMARY)
    data = path.read_bytes()
    builder = RecordBuilder()
    Chunk("", b"", 0, 0, 0, 0).write(builder)
    start, _ = _place(data, CHUNK)
    path.write_bytes(data[:start] + builder.end() + data[start:])
    assert _read(path)[:2] == (_written(SMALL), ())


# --- damaged chunks


INDEXES: dict[str, dict[str, Any]] = {"indexed": {}, "no-index": NO_INDEX, "no-summary": NO_SUMMARY}


@pytest.mark.parametrize(
    ("index", "number"), [("indexed", 0), ("indexed", 1), ("no-index", 0), ("no-index", 2), ("no-summary", 2)]
)
def test_a_chunk_with_a_wrong_checksum_is_left_out(tmp_path: Path, index: str, number: int) -> None:
    path = bags.write_mcap(tmp_path / "a.mcap", SMALL, compression="none", chunk_bytes=400, **INDEXES[index])
    data = path.read_bytes()
    start, end = _place(data, CHUNK, number)
    inside, _ = _left(data[:start] + data[start:end] + b"", end)
    before, _ = _left(data, start)
    lost = set((inside - before).elements())
    _changed(path, end - 3, b"\x77")
    found, losses, _ = _read(path)
    times = {time for _, time in lost}
    assert times
    assert found == [key for key in _written(SMALL) if key[1] not in times]
    (loss,) = losses
    assert (loss.cause, loss.place) == (SkipCause.WRONG_CHECKSUM, f"the chunk at byte {start}")
    assert loss.messages == (len(times) if index == "indexed" else None)


@pytest.mark.parametrize("compression", ["lz4", "zstd"])
@pytest.mark.parametrize("index", INDEXES)
def test_a_chunk_that_cannot_be_decompressed_is_left_out(tmp_path: Path, index: str, compression: Any) -> None:
    path = bags.write_mcap(tmp_path / "a.mcap", SAMPLE, compression=compression, **INDEXES[index])
    start, end = _place(path.read_bytes(), CHUNK, 1)
    _changed(path, (start + end) // 2, bytes([0xAA, 0x55] * 20))
    found, losses, _ = _read(path)
    assert 0 < len(found) < len(SAMPLE)
    assert set(found) < set(_written(SAMPLE))
    assert [loss.place for loss in losses if "chunk" in loss.place] == [f"the chunk at byte {start}"]


def test_an_unknown_compression_is_named(tmp_path: Path) -> None:
    path = bags.write_mcap(tmp_path / "a.mcap", SMALL, chunk_bytes=400)
    path.write_bytes(path.read_bytes().replace(b"\x04\0\0\0zstd", b"\x04\0\0\0brot"))
    found, losses, _ = _read(path)
    assert found == []
    assert {loss.cause for loss in losses} == {SkipCause.DAMAGED}
    assert all("'brot'" in loss.detail and "lz4" in loss.detail for loss in losses)
    assert sum(loss.messages or 0 for loss in losses) == len(SMALL)
    # nothing says what these channels are
    assert {loss.topic for loss in losses} == {""}


def test_a_chunk_names_whose_messages_are_lost(tmp_path: Path) -> None:
    path = bags.write_mcap(tmp_path / "a.mcap", SMALL, chunk_bytes=1)
    start, end = _place(path.read_bytes(), CHUNK, 2)
    _changed(path, end - 10, b"\xaa\x55\xaa")
    _, (loss,), _ = _read(path)
    assert (loss.topic, loss.messages) == (SMALL[2].topic, 1)
    path = bags.write_mcap(tmp_path / "b.mcap", SMALL, chunk_bytes=1 << 20)
    start, end = _place(path.read_bytes(), CHUNK)
    _changed(path, (start + end) // 2, b"\xaa\x55\xaa")
    _, (loss,), _ = _read(path)
    assert (loss.topic, loss.messages) == ("", 6)
    assert "3 of /r1/map, 3 of /r2/map" in loss.detail


def _chunk_file(path: Path, chunks: Iterable[tuple[bytes, bytes]], tail: bytes = b"") -> Path:
    """Write a file of chunks, each of records and of what is to be told of their size or checksum."""
    builder = RecordBuilder()
    Header("ros2", "tests").write(builder)
    content = MAGIC + builder.end()
    for records, extra in chunks:
        content += _chunk(records) + extra
    path.write_bytes(content + tail)
    return path


def _chunk(records: bytes, size: int | None = None, crc: int | None = None) -> bytes:
    compressed = zstandard.compress(records)
    builder = RecordBuilder()
    known = zlib.crc32(records) if crc is None else crc
    Chunk("zstd", compressed, 0, 0, known, len(records) if size is None else size).write(builder)
    return builder.end()


CLOSED = b"\x0f" + struct.pack("<QI", 4, 0) + b"\x02" + struct.pack("<QQQI", 20, 0, 0, 0) + MAGIC


def _built(*records: Any) -> bytes:
    builder = RecordBuilder()
    for each in records:
        each.write(builder)
    return builder.end()


def _described(key: int = 1, topic: str = "/r1/map", schema: int = 1, **changes: Any) -> bytes:
    fields = {"data": b"", "encoding": "ros2msg", "name": GRID_TYPE, **changes}
    return _built(Schema(id=schema or 99, **fields), Channel(key, topic, "cdr", {}, schema))


def _message(key: int, time: int, data: bytes = b"data") -> bytes:
    return _built(Message(key, time, data, time, 0))


def _file(path: Path, data: bytes, tail: bytes = CLOSED) -> Path:
    path.write_bytes(MAGIC + _built(Header("ros2", "tests")) + data + tail)
    return path


def test_channels_described_only_in_a_later_chunk_are_known(tmp_path: Path) -> None:
    for name, data in {
        "chunks": _chunk(_message(1, 5)) + _chunk(_described() + _message(1, 6)),
        "loose": _message(1, 5) + _described() + _message(1, 6),
    }.items():
        found, losses, info = _read(_file(tmp_path / name, data))
        assert [time for _, time, _ in found] == [5, 6]
        assert losses == ()
        assert [(each.name, each.message_count) for each in info.topics] == [("/r1/map", 2)]


def test_channels_described_only_in_a_damaged_chunk_are_taken_from_the_summary(tmp_path: Path) -> None:
    path = bags.write_mcap(tmp_path / "a.mcap", SMALL, chunk_bytes=1, index_types=NO_INDEX["index_types"])
    start, end = _place(path.read_bytes(), CHUNK)
    _changed(path, end - 10, b"\xaa\x55\xaa")
    found, losses, _ = _read(path)
    assert found == _written(SMALL[1:])
    assert [loss.place for loss in losses] == [f"the chunk at byte {start}"]


def test_messages_of_a_channel_that_nothing_describes_are_counted(tmp_path: Path) -> None:
    data = _chunk(_described() + _message(1, 5) + _message(7, 5) + _message(7, 6))
    found, losses, _ = _read(_file(tmp_path / "a.mcap", data))
    assert len(found) == 1
    assert [(loss.cause, loss.place, loss.messages) for loss in losses] == [(SkipCause.UNKNOWN_TYPE, "channel 7", 2)]


def test_a_channel_that_is_described_in_two_ways_is_not_believed(tmp_path: Path) -> None:
    data = _described() + _message(1, 5) + _described(topic="/r2/map") + _message(1, 6)
    found, losses, _ = _read(_file(tmp_path / "a.mcap", data))
    assert found == []
    assert [(loss.cause, loss.messages) for loss in losses] == [(SkipCause.UNKNOWN_TYPE, 2)]
    again = _described() + _message(1, 5) + _described() + _message(1, 6)
    assert len(_read(_file(tmp_path / "b.mcap", again))[0]) == 2


@pytest.mark.parametrize(
    "bad",
    [
        _chunk(_message(1, 6), size=7),
        _chunk(_message(1, 6)[:-1]),
        _chunk(_message(1, 6) + b"\x05"),
        _chunk(_message(1, 6) + struct.pack("<BQ", 5, 1 << 63)),
        _chunk(_message(1, 6) + struct.pack("<BQ", 5, 3) + b"abc"),
        _chunk(_message(1, 6) + struct.pack("<BQ", 3, 14) + struct.pack("<HIII", 1, 1 << 31, 0, 0)),
        _chunk(_message(1, 6) + struct.pack("<BQ", 4, 16) + struct.pack("<HHIII", 1, 1, 0, 0, 4)),
        _chunk(_message(1, 6) + bytes(9)),
    ],
)
def test_a_chunk_whose_records_do_not_fit_is_left_out(tmp_path: Path, bad: bytes) -> None:
    before = _chunk(_described() + _message(1, 5))
    path = _file(tmp_path / "a.mcap", before + bad + _chunk(_message(1, 7)))
    found, losses, _ = _read(path)
    assert [time for _, time, _ in found] == [5, 7]
    place = f"the chunk at byte {path.read_bytes().index(bad)}"
    assert [(loss.cause, loss.place) for loss in losses] == [(SkipCause.DAMAGED, place)]


@pytest.mark.parametrize("compression", ["zstd", "lz4", ""])
@pytest.mark.parametrize("promised", [30 << 20, 100, 1 << 62])
def test_a_chunk_that_is_larger_than_is_read_is_named(tmp_path: Path, compression: str, promised: int) -> None:
    plain = bytes(30 << 20)
    data = {"zstd": zstandard.compress, "lz4": lz4.frame.compress, "": bytes}[compression](plain)
    bomb = _built(Chunk(compression, data, 0, 0, zlib.crc32(plain), promised))
    path = _file(tmp_path / "a.mcap", _chunk(_described() + _message(1, 5)) + bomb + _chunk(_message(1, 6)))
    with McapFile(path, most_bytes=1 << 20) as source:
        assert [each.log_time_ns for each in source.messages(["/r1/map"])] == [5, 6]
        (loss,) = source.losses.all
    # More than it should have is given up on before it is more than is read.
    cause = SkipCause.DAMAGED if compression and promised < 1 << 20 else SkipCause.OVER_MEMORY
    assert (loss.cause, loss.place) == (cause, f"the chunk at byte {path.read_bytes().index(bomb)}")


def test_bytes_that_are_missing_over_several_chunks(tmp_path: Path) -> None:
    """Only the last chunk that they reach into is followed by its index: there is more missing than that counts."""
    path = bags.write_mcap(tmp_path / "a.mcap", SMALL, chunk_bytes=400)
    one, _, third, *rest = bags.chunks(path)
    assert rest
    data = path.read_bytes()
    path.write_bytes(data[: one.start + one.size + 10] + data[third.start + third.size // 2 :])
    found, losses, _ = _read(path)
    missing = len(SMALL) - len(found)
    assert missing > 1
    named = [loss.messages for loss in losses]
    assert None in named or sum(each or 0 for each in named) >= missing


def test_a_message_that_is_larger_than_is_read_is_named(tmp_path: Path) -> None:
    path = _file(tmp_path / "a.mcap", _described() + _message(1, 5) + _message(1, 6, bytes(2000)) + _message(1, 7))
    with McapFile(path, most_bytes=1000) as source:
        assert [each.log_time_ns for each in source.messages(["/r1/map"])] == [5, 7]
        assert [(loss.cause, loss.messages) for loss in source.losses.all] == [(SkipCause.OVER_MEMORY, 1)]


def test_a_compressed_message_that_is_damaged_or_too_large_is_named(tmp_path: Path) -> None:
    good = zstandard.compress(b"\0\1\0\0" + bytes(100))
    large = zstandard.compress(b"\0\1\0\0" + bytes(10_000))
    data = b"".join(_message(1, time, each) for time, each in enumerate((good, good[:-5], large, good)))
    with McapFile(_file(tmp_path / "a.mcap", _chunk(_described() + data)), most_bytes=5000) as source:
        assert [each.log_time_ns for each in source.messages(["/r1/map"])] == [0, 3]
        found = [(loss.cause, loss.messages, loss.topic) for loss in source.losses.all]
    assert found == [(cause, 1, "/r1/map") for cause in (SkipCause.DAMAGED, SkipCause.OVER_MEMORY)]


# --- damaged records


@pytest.mark.parametrize("length", [1 << 63, (1 << 64) - 1, 10_000, 0, 21, 30])
def test_after_a_damaged_message_the_next_one_is_found(tmp_path: Path, length: int) -> None:
    data = _described() + b"".join(_message(1, time, bytes([time]) * 200) for time in range(5, 12))
    path = _file(tmp_path / "a.mcap", data)
    start, end = _place(path.read_bytes(), MESSAGE, 2)
    _changed(path, start + 1, struct.pack("<Q", length))
    found, losses, _ = _read(path)
    assert [time for _, time, _ in found] == [5, 6, 8, 9, 10, 11]
    assert [(loss.cause, loss.place) for loss in losses] == [(SkipCause.DAMAGED, f"bytes {start} to {end}")]


@pytest.mark.parametrize("index", INDEXES)
@pytest.mark.parametrize("compression", ["none", "lz4", "zstd"])
def test_after_a_damaged_chunk_header_the_next_chunk_is_found(tmp_path: Path, index: str, compression: Any) -> None:
    options = {"compression": compression, "chunk_bytes": 400, **INDEXES[index]}
    path = bags.write_mcap(tmp_path / "a.mcap", SMALL, **options)
    data = path.read_bytes()
    # the chunks before it describe the channels
    start, end = _place(data, CHUNK, 2)
    lost = {time for _, time in (_left(data, end)[0] - _left(data, start)[0])}
    for damage in (struct.pack("<BQ", 6, 1 << 50), bytes(9), b"\x15" * 9, b"\x86" * 9, struct.pack("<BQ", 6, 11)):
        path.write_bytes(data)
        _changed(path, start, damage)
        found, losses, _ = _read(path)
        assert found == [key for key in _written(SMALL) if key[1] not in lost]
        assert losses
        assert {loss.cause for loss in losses} == {SkipCause.DAMAGED}
        assert any(str(start) in loss.place for loss in losses)


@pytest.mark.parametrize("compression", ["none", "lz4", "zstd"])
@pytest.mark.parametrize("index", INDEXES)
def test_a_chunk_that_lost_bytes_does_not_take_the_next_one_along(tmp_path: Path, index: str, compression: Any) -> None:
    messages = [bags.recorded_map("/r1/map", START + number, seed=number, rows=20) for number in range(8)]
    path = bags.write_mcap(tmp_path / "a.mcap", messages, compression=compression, chunk_bytes=2000, **INDEXES[index])
    data, written = path.read_bytes(), _written(messages)
    chunks = [(start, end) for opcode, start, end in _records(data) if opcode == CHUNK]
    assert len(chunks) >= 4
    # the first one alone describes the channel where there is no summary
    for start, end in chunks[1:-1]:
        inner = _inner(data, start + 9)
        lost = {message for message in written if message[2] in inner}
        assert lost
        for length in (1, 16, 40, 100, 500):
            at = (start + end) // 2
            path.write_bytes(data[:at] + data[at + length :])
            found, losses, _ = _read(path, ["/r1/map"])
            assert found == [message for message in written if message not in lost], length
            assert losses[0].place == f"the chunk at byte {start}"


@pytest.mark.parametrize("compression", ["none", "lz4", "zstd"])
@pytest.mark.parametrize("index", INDEXES)
def test_of_a_chunk_without_a_checksum_no_message_is_used_of_which_bytes_are_missing(
    tmp_path: Path, index: str, compression: Any
) -> None:
    options = {"compression": compression, "chunk_bytes": 400, "enable_crcs": False, **INDEXES[index]}
    path = bags.write_mcap(tmp_path / "a.mcap", SMALL, **options)
    data, written = path.read_bytes(), set(_written(SMALL))
    chunks = [(start, end) for opcode, start, end in _records(data) if opcode == CHUNK]
    assert _read(path)[:2] == (_written(SMALL), ())
    for start, end in chunks:
        for at in (end - 8, end - 40, (start + end) // 2):
            for length in (1, 4, 8, 16, 22, 31, 64, 100):
                for damaged in (data[:at] + data[at + length :], data[:at] + b"\x05" * length + data[at:]):
                    path.write_bytes(damaged)
                    found, losses, _ = _read(path)
                    assert set(found) <= written, (at, length)
                    assert losses


def test_a_message_that_ends_in_zeros_is_used_of_a_file_that_ends_with_it(tmp_path: Path) -> None:
    cells = {"data": np.zeros(2400, "i1")}
    zeros = Recorded("/r1/map", GRID_TYPE, START, bags.map_fields(bags.grid(1), START) | cells)
    path = bags.write_mcap(tmp_path / "a.mcap", [zeros, *SMALL], compression="none", chunk_bytes=1 << 20)
    data = path.read_bytes()
    end = data.index(bags.as_cdr(zeros)) + len(bags.as_cdr(zeros))
    for length, maps in ((end, 1), (end - 1, 0)):
        path.write_bytes(data[:length])
        assert [key[1] for key in _read(path)[0]] == [START] * maps
    # whether these zeros are of the message nothing can tell
    path.write_bytes(data[: end - 1000] + bytes(5000))
    assert _read(path)[0] == []


@pytest.mark.parametrize("number", [1, 15, 16, 300])
def test_however_many_private_records_there_are_no_message_is_lost(tmp_path: Path, number: int) -> None:
    path = bags.write_mcap(tmp_path / "a.mcap", SMALL, use_chunking=False, **NO_SUMMARY)
    data = path.read_bytes()
    _, end = _place(data, MESSAGE, 1)
    private = struct.pack("<BQ5s", 0x90, 5, b"hello") * number
    path.write_bytes(data[:end] + private + data[end:])
    assert _read(path)[:2] == (_written(SMALL), ())


def test_bytes_that_look_like_records_are_not_taken_for_them(tmp_path: Path) -> None:
    """Cells of a map are such bytes: zeros, and small numbers between them."""
    cells = np.random.default_rng(1)
    junk = np.where(cells.random(1 << 20) < 0.5, 0, cells.integers(0, 16, 1 << 20)).astype(np.uint8).tobytes()
    path = bags.write_mcap(tmp_path / "a.mcap", SMALL * 20, use_chunking=False, **NO_SUMMARY)
    data = path.read_bytes()
    start, _ = _place(data, MESSAGE, 60)
    path.write_bytes(data[:start] + junk + data[start:])
    found, losses, _ = _read(path)
    # the message before may be the one whose length is damaged
    assert 119 <= len(found) <= 120
    assert set(found) == set(_written(SMALL))
    (loss,) = losses
    assert loss.place.endswith(f" to {start + len(junk)}")


def test_records_of_private_and_later_types_are_passed_over(tmp_path: Path) -> None:
    private = struct.pack("<BQ", 0x80, 5) + b"hello" + struct.pack("<BQ", 0xFF, 0)
    data = private + _described() + _message(1, 5) + private + _message(1, 6) + private
    found, losses, _ = _read(_file(tmp_path / "a.mcap", data))
    assert [time for _, time, _ in found] == [5, 6]
    assert losses == ()
    hidden = b"\x85" + _message(1, 6)[1:]
    found, (loss,), _ = _read(_file(tmp_path / "c.mcap", _described() + _message(1, 5) + hidden + _message(1, 7)))
    assert [time for _, time, _ in found] == [5, 7]
    assert loss.cause == SkipCause.DAMAGED
    header = _built(Header("", "x" * 20))
    assert len(_read(_file(tmp_path / "d.mcap", _described() + header + _message(1, 7)))[1]) == 1
    later = struct.pack("<BQ", 0x20, 5) + b"hello"
    found, (loss,), _ = _read(_file(tmp_path / "b.mcap", _described() + _message(1, 5) + later + _message(1, 6)))
    assert [time for _, time, _ in found] == [5, 6]
    assert loss.cause == SkipCause.DAMAGED


def test_the_search_for_the_next_record_takes_a_step_a_byte(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What looks like a record everywhere is looked at once."""
    looked: Counter[int] = Counter()
    original = resume.Resumption._is_chain
    monkeypatch.setattr(
        resume.Resumption, "_is_chain", lambda self, start: (looked.update([start]), original(self, start))[1]
    )
    trap = struct.pack("<BQ", 5, 1 << 31) * 20_000
    path = _file(tmp_path / "a.mcap", _described() + _message(1, 5) + trap + _message(1, 6) * 3)
    found, losses, _ = _read(path)
    # the length of the first message may be what is damaged
    assert [time for _, time, _ in found] == [6, 6, 6]
    assert len(losses) == 1
    assert looked.total() <= 2 * len(trap)
    assert max(looked.values()) <= 2


# --- the checksum of the data


def _with_data_crc(path: Path, *, wrong: bool = False) -> Path:
    data = path.read_bytes()
    start, end = _place(data, DATA_END)
    _changed(path, end - 4, struct.pack("<I", zlib.crc32(data[:start]) ^ wrong))
    return path


@pytest.mark.parametrize("index", INDEXES)
def test_messages_that_only_the_wrong_checksum_of_the_data_covers_are_left_out(tmp_path: Path, index: str) -> None:
    path = bags.write_mcap(tmp_path / "a.mcap", SMALL, use_chunking=False, **INDEXES[index])
    assert _read(_with_data_crc(path))[:2] == (_written(SMALL), ())
    found, losses, info = _read(_with_data_crc(path, wrong=True))
    assert found == []
    assert [(loss.cause, loss.place, loss.messages) for loss in losses] == [
        (SkipCause.WRONG_CHECKSUM, "the data section", len(SMALL))
    ]
    assert sum(each.message_count for each in info.topics) == 0


def test_messages_that_a_checksum_of_their_own_covers_are_used_all_the_same(tmp_path: Path) -> None:
    chunks = _chunk(_described() + _message(1, 5)) + _chunk(_message(1, 6), crc=0)
    path = _with_data_crc(_file(tmp_path / "a.mcap", chunks + _message(1, 7)), wrong=True)
    found, losses, _ = _read(path)
    assert [time for _, time, _ in found] == [5]
    assert [(loss.cause, loss.messages) for loss in losses] == [(SkipCause.WRONG_CHECKSUM, 2)]


def test_messages_that_only_the_summary_knows_of_are_named(tmp_path: Path) -> None:
    path = bags.write_mcap(tmp_path / "a.mcap", SMALL, use_chunking=False)
    start, end = _place(path.read_bytes(), MESSAGE, 2)
    _changed(path, start, struct.pack("<BQ", 0x80, end - start - 9) + bytes(22))
    found, losses, _ = _read(path)
    assert found == _written([*SMALL[:2], *SMALL[3:]])
    assert [(loss.cause, loss.messages, loss.topic) for loss in losses] == [(SkipCause.DAMAGED, 1, "/r1/map")]


# --- definitions


def _defined(path: Path, definition: str, schema_encoding: str = "ros2msg", msgtype: str = GRID_TYPE) -> Path:
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        odd = writer.register_schema(msgtype, schema_encoding, definition.encode())
        right = writer.register_schema(GRID_TYPE, "ros2msg", ros2_message_definition(GRID_TYPE).encode())
        channels = writer.register_channel("/odd", "cdr", odd), writer.register_channel("/r2/map", "cdr", right)
        for index, each in enumerate(SMALL):
            writer.add_message(channels[index % 2], each.log_time_ns, bags.as_cdr(each), each.log_time_ns)
        writer.finish()
    return path


def test_maps_that_are_defined_otherwise_are_named_and_not_used(tmp_path: Path) -> None:
    text = ros2_message_definition(GRID_TYPE)
    path = _defined(tmp_path / "a.mcap", text.replace("float32 resolution", "float64 resolution"))
    found, losses, info = _read(path, ["/odd", "/r2/map"])
    assert {topic for topic, _, _ in found} == {"/r2/map"}
    assert len(found) == 3
    (loss,) = losses
    assert (loss.cause, loss.topic, loss.messages) == (SkipCause.UNKNOWN_TYPE, "/odd", 3)
    assert "resolution of nav_msgs/msg/MapMetaData is float64" in loss.detail
    assert [each.name for each in info.topics if each.msgtype == GRID_TYPE] == ["/r2/map"]


def test_transforms_that_are_defined_otherwise_are_named_and_not_used(tmp_path: Path) -> None:
    path = _defined(tmp_path / "a.mcap", "geometry_msgs/Transform[] transforms", msgtype=TF_TYPE)
    found, losses, info = _read(path, ["/odd"])
    assert found == []
    assert [(loss.cause, loss.topic) for loss in losses] == [(SkipCause.UNKNOWN_TYPE, "/odd")]
    assert TF_TYPE not in {each.msgtype for each in info.topics}


@pytest.mark.parametrize(
    ("definition", "encoding"),
    [("", "ros2msg"), ("int8 nothing", "protobuf"), ("int8 nothing", ""), ("# a comment\n" * 3, "ros2msg")],
)
def test_definitions_that_say_nothing_are_taken_as_the_standard(tmp_path: Path, definition: str, encoding: str) -> None:
    if definition.startswith("#"):
        definition += ros2_message_definition(GRID_TYPE)
    found, losses, _ = _read(_defined(tmp_path / "a.mcap", definition, encoding), ["/odd", "/r2/map"])
    assert len(found) == len(SMALL)
    assert losses == ()


def test_a_channel_whose_schema_is_nowhere_is_no_map(tmp_path: Path) -> None:
    channel = _built(Channel(1, "/r1/map", "cdr", {}, 4))
    found, losses, info = _read(_file(tmp_path / "a.mcap", channel + _message(1, 5)))
    assert found == []
    assert [(each.name, each.msgtype) for each in info.topics] == [("/r1/map", "unknown")]
    assert [(loss.cause, loss.topic, loss.messages) for loss in losses] == [(SkipCause.UNKNOWN_TYPE, "/r1/map", 1)]


# --- flips anywhere


@functools.cache
def _flippable(layout: str, index: str) -> bytes:
    with TemporaryDirectory() as folder:
        path = bags.write_mcap(Path(folder) / "a.mcap", SMALL, **LAYOUTS[layout], **INDEXES[index])
        return path.read_bytes()


def _may_be_unnoticed(data: bytes, layout: str, at: int) -> bool:
    """Tell whether a byte is one that no checksum covers: within a message, or what describes it, outside of chunks."""
    return layout == "unchunked" and any(
        start + 9 <= at < end for opcode, start, end in _records(data) if opcode in {3, 4, MESSAGE}
    )


@pytest.mark.parametrize("index", INDEXES)
@pytest.mark.parametrize("layout", LAYOUTS)
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(choice=st.data())
def test_a_flip_anywhere_never_makes_a_wrong_message(
    tmp_path: Path, layout: str, index: str, choice: st.DataObject
) -> None:
    data = _flippable(layout, index)
    at = choice.draw(st.integers(0, len(data) - 1))
    bits = choice.draw(st.integers(1, 255))
    flipped = bytearray(data)
    flipped[at] ^= bits
    path = tmp_path / "flipped.mcap"
    path.write_bytes(flipped)
    try:
        found, losses, _ = _read(path)
    except InputError as error:
        # no MCAP file any more, or one in another encoding
        assert "\n" not in str(error)  # noqa: PT017
        assert at < len(MAGIC) or _may_be_unnoticed(data, layout, at)
        return
    written = _written(SMALL)
    assert len(set(found)) == len(found)
    if not _may_be_unnoticed(data, layout, at):
        assert set(found) <= set(written)
        if len(found) < len(written):
            assert losses


def test_the_flips_above_are_where_it_matters() -> None:
    """Guards the test above: most bytes are covered."""
    for layout in LAYOUTS:
        for index in INDEXES:
            data = _flippable(layout, index)
            covered = sum(not _may_be_unnoticed(data, layout, at) for at in range(len(data)))
            assert covered > (0 if layout == "unchunked" else len(data) - 1)
