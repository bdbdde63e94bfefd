from __future__ import annotations

import bz2
import struct
import tracemalloc
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
from rosbags.rosbag1 import Reader

from replay.errors import InputError
from replay.skip_cause import SkipCause
from replay.sources import open_source
from replay.sources.base import GRID_TYPE
from replay.sources.losses import Loss
from replay.sources.rosbag1.file import Rosbag1File
from tests import bags
from tests.bags import SECOND, START
from tests.replay.test_sources_open import refused

# so small that every byte can be tried
SMALL = tuple(bags.recorded_map(f"/r{1 + each % 2}/map", START + each * SECOND, seed=each, rows=1) for each in range(6))
SMALL_CHUNK_BYTES = 300
COMPRESSIONS = ("none", "bz2", "lz4")

Message = tuple[str, int, bytes]


def _read(path: Path) -> tuple[list[Message], tuple[Loss, ...]]:
    """Return all messages of a bag and what is lost of it."""
    with open_source(path) as source:
        topics = [each.name for each in source.info.topics]
        found = [(each.topic, each.log_time_ns, bytes(each.data)) for each in source.messages(topics)]
        listed = Counter({each.name: each.message_count for each in source.info.topics if each.message_count})
        losses = source.losses.all
    if _causes(losses) <= {"ends_early"}:
        assert listed == Counter(topic for topic, _, _ in found)
    return found, losses


def _recorded(messages: Iterable[bags.Recorded]) -> list[Message]:
    ordered = sorted(messages, key=lambda each: each.log_time_ns)
    return [(each.topic, each.log_time_ns, bags.as_ros1(each)) for each in ordered]


def _changed(path: Path, change: Callable[[bytearray], None]) -> Path:
    data = bytearray(path.read_bytes())
    change(data)
    path.write_bytes(data)
    return path


def _with_index_pos(path: Path, index_pos: int) -> Path:
    def change(data: bytearray) -> None:
        start = data.index(b"index_pos=") + len(b"index_pos=")
        data[start : start + 8] = struct.pack("<Q", index_pos)

    return _changed(path, change)


def _small(path: Path, compression: str = "none") -> Path:
    return bags.write_rosbag1(path, SMALL, compression, SMALL_CHUNK_BYTES)


def _causes(losses: Iterable[Loss]) -> set[str]:
    return {str(each.cause) for each in losses}


# --- bags that are not whole


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_an_unfinished_bag_is_read_without_its_index(tmp_path: Path, compression: str) -> None:
    """As the recorder leaves it that was killed: it has all its chunks, and no index."""
    path = bags.write_rosbag1(tmp_path / "a.bag.active", compression=compression)
    with Reader(path) as reader:
        end = max(reader.chunks)
    _with_index_pos(path, 0)
    found, losses = _read(path)
    assert found == _recorded(bags.SAMPLE)
    assert [(each.cause, each.place) for each in losses] == [("ends_early", f"byte {path.stat().st_size}")]
    assert "not ended properly" in losses[0].detail
    assert end


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_the_chunk_that_a_recorder_had_begun_has_no_length_yet(tmp_path: Path, compression: str) -> None:
    path = _with_index_pos(_small(tmp_path / "a.bag.active", compression), 0)
    last = bags_chunks(path)[-1]

    def begun(data: bytearray) -> None:
        del data[last.end :]
        data[last.length : last.data] = bytes(4)
        data[last.size : last.size + 4] = bytes(4)

    found, losses = _read(_changed(path, begun))
    assert found == _recorded(SMALL)
    assert _causes(losses) == {"ends_early"}


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_of_a_chunk_without_a_length_all_that_can_be_decompressed_is_read(tmp_path: Path, compression: str) -> None:
    """rosbag names the compression when it begins a chunk, and fills in both lengths when it ends it."""
    path = _with_index_pos(_small(tmp_path / "a.bag", compression), 0)
    data, chunks = bytearray(path.read_bytes()), bags_chunks(path)
    last = chunks[-1]
    whole = bytes(data)
    data[last.length : last.data] = bytes(4)
    data[last.size : last.size + 4] = bytes(4)
    cut = tmp_path / "cut.bag.active"
    for length in {*range(last.data, last.end, 7), last.end}:
        cut.write_bytes(data[:length])
        found, losses = _read(cut)
        assert found == [each for chunk in chunks for each in chunk.messages_within(whole, length, compression)], length
        assert _causes(losses) == {"ends_early"}


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_of_a_truncated_bag_every_whole_message_is_read(tmp_path: Path, compression: str) -> None:
    """At every byte: of uncompressed chunks each message that is there, of others what can be decompressed."""
    path = _small(tmp_path / "a.bag", compression)
    data, chunks = path.read_bytes(), bags_chunks(path)
    cut = tmp_path / "cut.bag"
    for length in _lengths(chunks, len(data)):
        cut.write_bytes(data[:length])
        expected = [each for chunk in chunks for each in chunk.messages_within(data, length, compression)]
        found, losses = _read(cut)
        assert found == expected, length
        assert [each.cause for each in losses if each.cause == "ends_early"] == ["ends_early"], (length, losses)
        assert _causes(losses) <= {"ends_early", "damaged"}
        is_within_index = length >= chunks[-1].end_of_index
        if is_within_index:
            assert found == _recorded(SMALL)
            assert [each.messages for each in losses] == [0]


def _lengths(chunks: list[_Chunk], length: int) -> list[int]:
    """Return lengths to cut a bag at: all where a record begins or ends, many elsewhere."""
    first, last = chunks[0].start, chunks[-1].end_of_index
    edges = {each + shift for chunk in chunks for each in (chunk.data, chunk.end) for shift in range(-9, 10)}
    return sorted(
        {13, 14, 100, *range(first - 9, first + 60), *edges, *range(first, last, 5), *range(last, length, 11)}
    )


def test_a_file_without_its_first_line_is_no_bag(tmp_path: Path) -> None:
    data = _small(tmp_path / "a.bag").read_bytes()
    for length in range(1, 13):
        path = tmp_path / "cut.bag"
        path.write_bytes(data[:length])
        refused(path)


def test_bytes_that_were_reserved_and_never_written(tmp_path: Path) -> None:
    path = _with_index_pos(_small(tmp_path / "a.bag.active"), 0)
    path.write_bytes(path.read_bytes()[: bags_chunks(_small(tmp_path / "b.bag"))[-1].end_of_index] + bytes(5000))
    found, losses = _read(path)
    assert found == _recorded(SMALL)
    assert _causes(losses) == {"ends_early"}


# --- damaged bags


@pytest.mark.parametrize("compression", COMPRESSIONS)
@pytest.mark.parametrize("which", [0, 1])
def test_a_damaged_chunk_is_named_and_the_others_are_read(tmp_path: Path, compression: str, which: int) -> None:
    path = _small(tmp_path / "a.bag", compression)
    chunk = bags_chunks(path)[which]

    def overwrite(data: bytearray) -> None:
        data[chunk.data : chunk.end] = b"\xee" * (chunk.end - chunk.data)

    found, losses = _read(_changed(path, overwrite))
    lost = {(topic, log_time_ns) for topic, log_time_ns, _ in chunk.messages}
    assert found == [each for each in _recorded(SMALL) if each[:2] not in lost]
    named = {each.place: each for each in losses}[f"the chunk at byte {chunk.start}"]
    assert named.messages == len(lost)
    assert named.cause in {SkipCause.DAMAGED, SkipCause.WRONG_CHECKSUM}


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_a_damaged_chunk_of_a_bag_without_an_index(tmp_path: Path, compression: str) -> None:
    path = _with_index_pos(_small(tmp_path / "a.bag", compression), 0)
    chunk = bags_chunks(path)[1]

    def overwrite(data: bytearray) -> None:
        data[chunk.data : chunk.end] = b"\xee" * (chunk.end - chunk.data)

    found, losses = _read(_changed(path, overwrite))
    lost = {(topic, log_time_ns) for topic, log_time_ns, _ in chunk.messages}
    assert found == [each for each in _recorded(SMALL) if each[:2] not in lost]
    assert [each.messages for each in losses if each.place == f"the chunk at byte {chunk.start}"] == [len(lost)]


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_damage_to_any_byte_outside_of_messages_makes_no_other_message(tmp_path: Path, compression: str) -> None:
    """What is read is always what was recorded, or less and named.

    Of uncompressed chunks, and of lz4 without a checksum, nothing protects what is within a message, nor a topic's
    name, so that only what is around is tried.
    """
    path = _small(tmp_path / "a.bag", compression)
    data, recorded = path.read_bytes(), _recorded(SMALL)
    protected = bytearray(len(data))
    for chunk in bags_chunks(path):
        if compression != "bz2":
            protected[chunk.data : chunk.end] = b"\1" * (chunk.end - chunk.data)
    broken = tmp_path / "broken.bag"
    # an odd step meets each of the four bytes of a number here or there
    for index in range(13, len(data), 3):
        if protected[index] or data[index : index + 1] == b" ":
            continue
        for flip in (0x01, 0x80):
            broken.write_bytes(data[:index] + bytes([data[index] ^ flip]) + data[index + 1 :])
            found, losses = _read(broken)
            times = {each.log_time_ns: each for each in SMALL}
            assert all(bags.as_ros1(times[log_time_ns]) == content for _, log_time_ns, content in found), index
            if found != recorded and {topic for topic, _, _ in found} <= {"/r1/map", "/r2/map"}:
                assert losses, index
                assert [each for each in recorded if each in found] == sorted(found, key=lambda each: each[1])


def test_a_length_that_is_wrong_ends_before_the_next_message(tmp_path: Path) -> None:
    """In an uncompressed chunk: the message with it is left out, those around it are read."""
    path = bags.write_rosbag1(tmp_path / "a.bag", SMALL, chunk_bytes=100_000)
    (chunk,) = bags_chunks(path)
    third = chunk.messages[2][2]

    def shorten(data: bytearray) -> None:
        data[data.index(third) - 4] ^= 1

    found, losses = _read(_changed(path, shorten))
    assert found == [each for each in _recorded(SMALL) if each[2] != third]
    assert [each.messages for each in losses if each.place == f"the chunk at byte {chunk.start}"] == [1]


def test_bytes_that_are_missing_within_a_message(tmp_path: Path) -> None:
    """As after a transfer that converts line endings: all that follows is displaced."""
    path = bags.write_rosbag1(tmp_path / "a.bag", SMALL, chunk_bytes=500)
    chunks = bags_chunks(path)
    assert len(chunks) > 1
    lost = [chunks[0].messages[0][2], chunks[-1].messages[-1][2]]

    def remove(data: bytearray) -> None:
        for each in lost:
            at = data.index(each) + len(each) // 2
            del data[at : at + 1]

    found, losses = _read(_changed(path, remove))
    assert found == [each for each in _recorded(SMALL) if each[2] not in lost]
    assert {each.place for each in losses} >= {f"the chunk at byte {chunks[0].start}"}


def test_however_many_bytes_are_missing_of_a_message_it_is_not_used(tmp_path: Path) -> None:
    """Also as many as the index behind its chunk has, and where little of the file is left behind it."""
    messages = [bags.recorded_map("/r1/map", START + each * SECOND, seed=each, rows=20) for each in range(4)]
    path = bags.write_rosbag1(tmp_path / "a.bag", messages, chunk_bytes=100)
    data, written = path.read_bytes(), _recorded(messages)
    chunks = bags.chunks(path)
    assert len(chunks) == len(written)
    for chunk, message in ((chunks[1], written[1]), (chunks[3], written[3])):
        at = chunk.start + chunk.size - 500
        for length in range(1, 240):
            path.write_bytes(data[:at] + data[at + length :])
            found, losses = _read(path)
            assert found == [each for each in written if each != message], length
            assert losses


@pytest.mark.parametrize("compression", ["bz2", "lz4"])
def test_bytes_that_are_missing_from_one_chunk_to_the_next(tmp_path: Path, compression: str) -> None:
    """What is left of two chunks looks like one: the index, which lists both, tells that there was another."""
    path = _small(tmp_path / "a.bag", compression)
    chunks = bags_chunks(path)
    one, other = chunks[:2]

    def remove(data: bytearray) -> None:
        del data[one.data + 20 : one.data + 20 + other.end - one.end]

    found, losses = _read(_changed(path, remove))
    assert found == [each for chunk in chunks[2:] for each in chunk.messages]
    named = [each for each in losses if each.place == "the index"]
    assert [(each.detail, each.messages) for each in named if each.messages is None] == [
        (f"it lists {len(chunks)} chunks, {len(chunks) - 1} were found", None)
    ]


def test_a_message_of_which_the_index_says_another_time(tmp_path: Path) -> None:
    path = _small(tmp_path / "a.bag")
    chunk = bags_chunks(path)[1]
    other = chunk.messages[0]

    def change(data: bytearray) -> None:
        # in the message's own record; the index keeps the old one
        data[data.index(b"time=", chunk.data) + len(b"time=")] ^= 1

    found, losses = _read(_changed(path, change))
    assert found == [each for each in _recorded(SMALL) if each != other]
    (named,) = (each for each in losses if each.place == f"the chunk at byte {chunk.start}")
    assert (named.messages, named.cause) == (1, SkipCause.DAMAGED)
    assert "another time" in named.detail


def test_an_index_that_points_elsewhere_is_replaced_by_a_pass_through_the_file(tmp_path: Path) -> None:
    path = _small(tmp_path / "a.bag")
    chunk = bags_chunks(path)[2]

    def change(data: bytearray) -> None:
        # the place of the only message that this index record lists
        data[chunk.end_of_index - 4] ^= 1

    found, losses = _read(_changed(path, change))
    assert found == _recorded(SMALL)
    assert [(each.place, each.messages) for each in losses] == [("the index", 0)]
    assert f"does not fit the chunk at byte {chunk.start}" in losses[0].detail


@pytest.mark.parametrize("field", [b"chunk_count=", b"conn_count="])
def test_a_header_that_counts_too_little(tmp_path: Path, field: bytes) -> None:
    path = _small(tmp_path / "a.bag")

    def change(data: bytearray) -> None:
        start = data.index(field) + len(field)
        data[start : start + 4] = bytes(4)

    found, losses = _read(_changed(path, change))
    assert found == _recorded(SMALL)
    assert [(each.cause, each.place, each.messages) for each in losses] == [("damaged", "the index", 0)]


def test_uncompressed_chunk_of_the_wrong_size(tmp_path: Path) -> None:
    path = bags.write_rosbag1(tmp_path / "a.bag", bags.SAMPLE[1:2])

    def change(data: bytearray) -> None:
        data[data.index(b"size=") + len(b"size=")] ^= 1

    found, losses = _read(_changed(path, change))
    assert found == _recorded(bags.SAMPLE[1:2])
    assert [(each.cause, each.place, each.messages) for each in losses] == [("damaged", "the chunk at byte 4109", 0)]


def test_a_wrong_checksum_is_told_from_other_damage(tmp_path: Path) -> None:
    path = tmp_path / "a.bag"
    bags.write_rosbag1(path, SMALL, "bz2", SMALL_CHUNK_BYTES)
    (losses,) = (_read(_changed(path, lambda data: _flip(data, bags_chunks(path)[1].data + 10)))[1],)
    assert _causes(losses) == {"wrong_checksum"}


def _flip(data: bytearray, index: int) -> None:
    data[index] ^= 0xFF


def test_a_chunk_in_another_compression(tmp_path: Path) -> None:
    path = _small(tmp_path / "a.bag")

    def change(data: bytearray) -> None:
        start = data.index(b"compression=none") + len(b"compression=")
        data[start : start + 4] = b"nine"

    found, losses = _read(_changed(path, change))
    assert len(found) < len(SMALL)
    assert "'nine'; none, bz2 and lz4 are read" in " ".join(each.detail for each in losses)


# --- limits


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_a_chunk_over_the_limit_is_left_out(tmp_path: Path, compression: str) -> None:
    big = bags.recorded_map("/r1/map", START + 9 * SECOND, seed=1, rows=100)
    path = bags.write_rosbag1(tmp_path / "a.bag", [*SMALL, big], compression, SMALL_CHUNK_BYTES)
    with Rosbag1File(path, most_bytes=5000) as source:
        found = [(each.topic, each.log_time_ns, bytes(each.data)) for each in source.messages(["/r1/map", "/r2/map"])]
        assert [(each.cause, each.messages) for each in source.losses.all] == [("over_memory", 1)]
    assert found == _recorded(SMALL)


@pytest.mark.parametrize("compression", ["bz2", "lz4"])
def test_no_more_of_a_chunk_is_in_memory_than_is_read(tmp_path: Path, compression: str) -> None:
    """A few hundred bytes of bz2 may be as many megabytes."""
    huge = bags.recorded_map("/r1/map", START, seed=1, rows=1)
    huge = replace(
        huge, fields={**huge.fields, "height": 1 << 10, "width": 1 << 16, "data": np.zeros(1 << 26, np.int8)}
    )
    path = bags.write_rosbag1(tmp_path / "a.bag", [huge, *SMALL], compression, SMALL_CHUNK_BYTES)
    most_bytes = 1 << 20
    with Rosbag1File(path, most_bytes=most_bytes) as source:
        tracemalloc.start()
        try:
            found = len(list(source.messages(["/r1/map", "/r2/map"])))
            _, peak_bytes = tracemalloc.get_traced_memory()
        finally:
            tracemalloc.stop()
        assert [(each.cause, each.messages) for each in source.losses.all] == [("over_memory", 1)]
    assert found == len(_recorded(SMALL))
    assert peak_bytes < 8 * most_bytes


def test_a_chunk_that_says_it_is_huge_is_not_believed(tmp_path: Path) -> None:
    path = _small(tmp_path / "a.bag", "lz4")
    chunk = bags_chunks(path)[1]

    def change(data: bytearray) -> None:
        data[chunk.size : chunk.size + 4] = b"\xff" * 4

    found, losses = _read(_changed(path, change))
    assert len(found) == len(SMALL) - len(chunk.messages)
    assert [(each.cause, each.messages) for each in losses] == [("damaged", len(chunk.messages))]


# --- what is said of topics


def test_a_topic_with_another_definition_is_no_map(tmp_path: Path) -> None:
    path = _small(tmp_path / "a.bag")

    def rename(data: bytearray) -> None:
        # of both, where they are described and in the index
        start = 0
        while (start := data.find(b"uint32 width", start)) >= 0:
            data[start : start + 12] = b"uint32 girth"

    with open_source(_changed(path, rename)) as source:
        assert GRID_TYPE not in {each.msgtype for each in source.info.topics}
        assert [(each.cause, each.topic, each.messages) for each in source.losses.all] == [
            ("unknown_type", "/r1/map", 3),
            ("unknown_type", "/r2/map", 3),
        ]
        assert "girth" in source.losses.all[0].detail
        assert list(source.messages(["/r1/map"])) == []


def test_another_version(tmp_path: Path) -> None:
    path = tmp_path / "a.bag"
    path.write_bytes(b"#ROSBAG V3.7\n" + bytes(100))
    refused(path, "#ROSBAG V3.7")


def test_a_version_that_is_no_text(tmp_path: Path) -> None:
    (tmp_path / "a.bag").write_bytes(b"#ROSBAG V2L\x0cz\x07\x1e" + bytes(range(100)))
    with pytest.raises(InputError) as refused, open_source(tmp_path / "a.bag"):
        pass
    assert str(refused.value).isprintable()
    assert "version 2.0 is read" in str(refused.value)


def test_bag_without_messages(tmp_path: Path) -> None:
    with open_source(bags.write_rosbag1(tmp_path / "a.bag", [])) as source:
        assert source.info.topics == ()
        assert source.info.start_ns is None
        assert list(source.messages(["/map"])) == []
        assert source.losses.all == ()


# --- where things are in a bag, as rosbags says


class _Chunk:
    """A chunk: where its header's two lengths, its data, its end and the end of its index are; its messages."""

    def __init__(self, data: bytes, start: int, messages: list[Message]) -> None:
        (header,) = struct.unpack_from("<I", data, start)
        self.start = start
        self.size = data.index(b"size=", start) + len(b"size=")
        self.length = start + 4 + header
        self.data = self.length + 4
        self.end = self.data + struct.unpack_from("<I", data, self.length)[0]
        self.messages = messages
        self.end_of_index = self.end
        while (record := _index_record(data, self.end_of_index)) is not None:
            self.end_of_index = record

    def messages_within(self, data: bytes, length: int, compression: str) -> list[Message]:
        """Return the messages of which no byte is at or after ``length``."""
        if length >= self.end:
            return self.messages
        there = _decompressed(data[self.data : max(length, self.data)], compression)
        whole = _decompressed(data[self.data : self.end], compression)
        return [each for each in self.messages if whole.index(each[2]) + len(each[2]) <= len(there)]


def _index_record(data: bytes, start: int) -> int | None:
    """Return where the index record that begins here ends."""
    if start + 4 > len(data):
        return None
    (header,) = struct.unpack_from("<I", data, start)
    if b"op=\x04" not in data[start + 4 : start + 4 + header]:
        return None
    return int(start + 8 + header + struct.unpack_from("<I", data, start + 4 + header)[0])


def _decompressed(data: bytes, compression: str) -> bytes:
    if compression == "bz2":
        return bz2.BZ2Decompressor().decompress(data)
    # asked for a limited number of bytes, lz4 returns also what is there of a block that was stored as it is
    return lz4.frame.LZ4FrameDecompressor().decompress(data, 1 << 20) if compression == "lz4" else data


def bags_chunks(path: Path) -> list[_Chunk]:
    """Return the chunks of a bag that is whole, but for the place of its index."""
    data = path.read_bytes()
    start, found = 4109 + 8, []
    start = data.index(b"#ROSBAG V2.0\n") + 4109
    while True:
        (header,) = struct.unpack_from("<I", data, start)
        if b"op=\x05" not in data[start + 4 : start + 4 + header]:
            return found
        chunk = _Chunk(data, start, [])
        inner = _decompressed(data[chunk.data : chunk.end], _compression(data, start))
        known = [(inner.index(each[2]), each) for each in _recorded((*SMALL, *bags.SAMPLE)) if each[2] in inner]
        chunk.messages.extend(each for _, each in sorted(known))
        found.append(chunk)
        start = chunk.end_of_index


def _compression(data: bytes, start: int) -> str:
    return next(name for name in COMPRESSIONS if f"compression={name}".encode() in data[start : start + 60])


def test_a_bag_of_a_writer_whose_fields_have_another_order(tmp_path: Path) -> None:
    """The fields of a header have no order; records are found again whatever it is."""
    path = _small(tmp_path / "a.bag")
    chunk = bags_chunks(path)[0]

    def change(data: bytearray) -> None:
        fields = data[chunk.start + 4 : chunk.length]
        parts, at = [], 0
        while at < len(fields):
            size = 4 + struct.unpack_from("<I", fields, at)[0]
            parts.append(bytes(fields[at : at + size]))
            at += size
        data[chunk.start + 4 : chunk.length] = b"".join(reversed(parts))
        # so that this chunk has to be looked for
        data[20] ^= 0xFF

    found, losses = _read(_changed(path, change))
    assert found == _recorded(SMALL)
    assert losses != ()
    assert replace(losses[0], messages=0).cause == "damaged"
