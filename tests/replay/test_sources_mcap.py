from __future__ import annotations

import io
import struct
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from mcap.data_stream import RecordBuilder
from mcap.reader import make_reader
from mcap.records import Message
from mcap.writer import IndexType, Writer

from replay.sources import open_source
from replay.sources.chunks import FEW_CHUNKS, ChunkCache
from replay.sources.mcap import chunk as mcap_chunk
from replay.sources.mcap import chunk_reader
from replay.sources.mcap import file as mcap_file
from replay.sources.mcap import scan as mcap_scan
from replay.sources.mcap.record_file import RecordFile
from replay.sources.mcap.records import MAGIC
from tests import bags
from tests.bags import NO_INDEX, NO_SUMMARY, SAMPLE, START, in_order
from tests.replay.test_sources_open import refused

TOPICS = {"/r1/map", "/r2/map", "/r1/map_updates"}


def _times(path: Path, *topics: str) -> list[int]:
    with open_source(path) as source:
        return [each.log_time_ns for each in source.messages(topics or TOPICS)]


def _expected(*topics: str) -> list[int]:
    return [each.log_time_ns for each in in_order(SAMPLE, topics or TOPICS)]


# --- with and without an index


@pytest.mark.parametrize("options", [NO_INDEX, NO_SUMMARY])
def test_without_an_index_damage_anywhere_is_found(tmp_path: Path, options: dict[str, Any]) -> None:
    chunk = next(each for each in bags.chunks(bags.write_mcap(tmp_path / "a.mcap")) if each.topics == {"/chatter"})
    path = bags.write_mcap(tmp_path / "b.mcap", **options)
    bags.damage(path, chunk)
    with open_source(path) as source:
        assert any(loss.place.startswith("the chunk at byte ") for loss in source.losses.all)


def test_with_an_index_the_file_is_not_passed_through(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = bags.write_mcap(tmp_path / "a.mcap")
    monkeypatch.setattr("replay.sources.mcap.file.scan", None)
    assert _times(path) == _expected()


@pytest.mark.parametrize(
    "options", [{}, NO_SUMMARY, NO_INDEX, {"index_types": IndexType.CHUNK}, {"use_chunking": False}]
)
def test_the_latest_message_is_the_last_one_up_to_a_time(tmp_path: Path, options: dict[str, Any]) -> None:
    path = bags.write_mcap(tmp_path / "a.mcap", **options)
    every = _expected("/r1/map")
    with mcap_file.McapFile(path) as file:
        for until_ns, expected in ((None, every[-1]), (every[0], every[0]), (every[-1] - 1, every[-2]), (0, None)):
            found = file.latest(["/r1/map"], until_ns)
            assert (found and found.log_time_ns) == expected
            assert found is None or found.data in [message.data for message in file.messages(["/r1/map"])]


def test_for_the_latest_message_one_chunk_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = bags.write_mcap(tmp_path / "a.mcap")
    loaded: list[int] = []
    original = mcap_chunk.chunk_content
    monkeypatch.setattr(
        chunk_reader, "chunk_content", lambda file, start: (loaded.append(start), original(file, start))[1]
    )
    with mcap_file.McapFile(path) as file:
        assert file.latest(["/r1/map"]) is not None
    assert len(loaded) == 1
    assert len(bags.chunks(path)) > 2


def test_a_channel_that_is_indexed_in_part_is_passed_through(tmp_path: Path) -> None:
    """A message of an indexed channel lies outside of the chunks; only the statistics know of it."""
    path = bags.write_mcap(tmp_path / "a.mcap")
    data = path.read_bytes()
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    (channel,) = (key for key, each in summary.channels.items() if each.topic == "/r1/map")
    # Put it at the end of the data, and count it in the statistics.
    loose = RecordBuilder()
    Message(channel, START + 7, bags.as_cdr(SAMPLE[1]), START + 7, 0).write(loose)
    record = loose.end()
    summary_start, _, _ = struct.unpack("<QQI", data[-28:-8])
    data_end = summary_start - 13
    counted = summary.statistics
    old, new = RecordBuilder(), RecordBuilder()
    counted.write(old)
    counted.channel_message_counts[channel] += 1
    counted.message_count += 1
    counted.write(new)
    tail = data[data_end:-28].replace(old.end(), new.end())
    footer = struct.pack("<QQI", summary_start + len(record), 0, 0)
    path.write_bytes(data[:data_end] + record + tail + footer + MAGIC)

    assert _times(path, "/r1/map") == sorted([*_expected("/r1/map"), START + 7])
    assert _times(path, "/r2/map") == _expected("/r2/map")


@pytest.mark.parametrize("options", [NO_SUMMARY, NO_INDEX, {"index_types": IndexType.CHUNK}])
def test_without_an_index_the_maps_are_looked_for_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: dict[str, Any]
) -> None:
    scans: list[Path] = []
    original = mcap_file.scan
    monkeypatch.setattr(mcap_file, "scan", lambda file, *rest: (scans.append(file.path), original(file, *rest))[1])
    path = bags.write_mcap(tmp_path / "a.mcap", **options)
    with open_source(path) as source:
        for topics in ({"/r1/map"}, {"/r2/map", "/r1/map_updates"}, {"/r1/map"}, TOPICS):
            assert [each.log_time_ns for each in source.messages(topics)] == _expected(*topics)
        assert scans == [path]
        assert [each.log_time_ns for each in source.messages(["/chatter"])] == _expected("/chatter")
        assert len(scans) == 2


def test_a_damaged_summary_is_not_believed(tmp_path: Path) -> None:
    path = bags.write_mcap(tmp_path / "a.mcap")
    data = bytearray(path.read_bytes())
    data[-100] ^= 0xFF
    path.write_bytes(data)
    assert _times(path) == _expected()


def test_other_topics_of_an_unindexed_file_are_found_when_asked_for(tmp_path: Path) -> None:
    path = bags.write_mcap(tmp_path / "a.mcap", **NO_SUMMARY)
    assert _times(path, "/chatter", "/r1/map") == _expected("/chatter", "/r1/map")


def test_an_unindexed_file_is_read_a_chunk_at_a_time(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = bags.write_mcap(tmp_path / "a.mcap", **NO_SUMMARY)
    loaded: list[int] = []
    original = mcap_chunk.chunk_content
    for module in (chunk_reader, mcap_scan):
        monkeypatch.setattr(
            module, "chunk_content", lambda file, start: (loaded.append(start), original(file, start))[1]
        )
    with open_source(path) as source:
        in_scan = len(loaded)
        assert loaded == sorted(set(loaded))
        messages = source.messages(["/r1/map"])
        next(messages)
        assert len(loaded) == in_scan + 1


def test_messages_outside_of_chunks_beside_chunks(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    chunked = bags.write_mcap(tmp_path / "b.mcap").read_bytes()
    unchunked = bags.write_mcap(tmp_path / "c.mcap", use_chunking=False).read_bytes()
    # Cut both down to their data.
    first, second = (data[: struct.unpack("<Q", data[-28:-20])[0] - 13] for data in (chunked, unchunked))
    header_end = 8 + 9 + struct.unpack("<Q", second[9:17])[0]
    footer = b"\x0f" + struct.pack("<QI", 4, 0) + b"\x02" + struct.pack("<QQQI", 20, 0, 0, 0) + MAGIC
    path.write_bytes(first + second[header_end:] + footer)
    with open_source(path) as source:
        assert sum(each.message_count for each in source.info.topics) == 2 * len(SAMPLE)
        assert source.losses.all == ()
    assert _times(path) == sorted([*_expected(), *_expected()])


# --- files with more in them than is needed


def test_bytes_after_the_end_do_not_matter(tmp_path: Path) -> None:
    path = bags.write_mcap(tmp_path / "a.mcap")
    path.write_bytes(path.read_bytes() + bytes(1000))
    assert _times(path) == _expected()


# --- channels


def test_maps_in_another_encoding_are_listed_and_refused(tmp_path: Path) -> None:
    path = bags.write_mcap(tmp_path / "a.mcap", encoding="json")
    with open_source(path) as source:
        assert ("/r1/map", "nav_msgs/msg/OccupancyGrid (json)") in {(t.name, t.msgtype) for t in source.info.topics}
    refused(path, "'json'", "cdr or ros1")


def test_channels_without_a_schema_do_no_harm(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        channel = writer.register_channel("/odd", "", 0)
        writer.add_message(channel, 5, b"", 5)
        writer.finish()
    with open_source(path) as source:
        assert [(t.name, t.msgtype, t.message_count) for t in source.info.topics] == [
            ("/odd", "unknown (no encoding)", 1)
        ]


def test_several_channels_of_one_topic_are_one(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2")
        schema = writer.register_schema("nav_msgs/msg/OccupancyGrid", "ros2msg", b"")
        for publisher in range(3):
            channel = writer.register_channel("/map", "cdr", schema, metadata={"publisher": str(publisher)})
            for each in range(2):
                writer.add_message(channel, 10 * each + publisher, b"data", 0)
        writer.finish()
    with open_source(path) as source:
        assert [(t.name, t.message_count) for t in source.info.topics] == [("/map", 6)]
    assert _times(path, "/map") == [0, 1, 2, 10, 11, 12]


def test_file_without_messages(tmp_path: Path) -> None:
    for name, options in (("a", {}), ("b", NO_SUMMARY), ("c", {"index_types": IndexType.NONE})):
        with open_source(bags.write_mcap(tmp_path / f"{name}.mcap", [], **options)) as source:
            assert (source.info.topics, source.info.start_ns, source.info.stop_ns) == ((), None, None)


# --- memory


def test_chunks_that_are_needed_in_turn_are_loaded_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    loads: Counter[int] = Counter()
    content = chunk_reader.chunk_content

    def counted(file: RecordFile, start: int) -> tuple[bytes, bool]:
        loads[start] += 1
        return content(file, start)

    monkeypatch.setattr(chunk_reader, "chunk_content", counted)
    robots, maps = 9, 20
    one_after_the_other = [
        replace(bags.recorded_map(f"/r{robot}/map", bags.START, seed=robot), log_time_ns=bags.START + number)
        for robot in range(robots)
        for number in range(maps)
    ]
    path = bags.write_mcap(tmp_path / "a.mcap", one_after_the_other, chunk_bytes=maps * 2600)
    with open_source(path) as source:
        found = [message.topic for message in source.messages([f"/r{robot}/map" for robot in range(robots)])]
    assert found[:robots] == [f"/r{robot}/map" for robot in range(robots)]
    assert len(loads) > FEW_CHUNKS
    assert set(loads.values()) == {1}


def cached(uses: Sequence[int], size: int, most_bytes: int) -> tuple[list[int], int]:
    """Return which chunks are loaded if they are used in this order, and how many are held at most."""
    loads: list[int] = []
    most = 0

    def load(offset: int) -> bytes:
        loads.append(offset)
        return bytes([offset]) * size

    cache = ChunkCache(load, uses, most_bytes)
    for offset in uses:
        assert cache[offset] == bytes([offset]) * size
        most = max(most, len(cache))
    assert len(cache) == 0
    return loads, most


def test_chunks_are_held_as_long_as_they_are_needed_and_are_not_too_large() -> None:
    rounds = [*range(10)] * 5
    assert cached(rounds, 100, 10_000) == (list(range(10)), 10)
    loads, most = cached(rounds, 100, 250)
    assert most == FEW_CHUNKS
    # one that lets go of what was used first finds nothing that it needs
    assert len(loads) < len(rounds) * 3 // 4
    assert cached([1, 1, 2, 2, 3], 100, 10_000) == ([1, 2, 3], 1)


def test_a_chunk_is_let_go_of_once_all_its_messages_are_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    caches: list[ChunkCache] = []

    class Watched(ChunkCache):
        def __init__(self, load: Callable[[int], bytes], uses: Iterable[int], most_bytes: int) -> None:
            super().__init__(load, uses, most_bytes)
            caches.append(self)

    monkeypatch.setattr("replay.sources.mcap.chunk_reader.ChunkCache", Watched)
    with open_source(bags.write_mcap(tmp_path / "a.mcap", chunk_bytes=1)) as source:
        for _ in source.messages(["/r1/map"]):
            assert len(caches[-1]) == 0


def test_message_data_do_not_keep_their_chunk(tmp_path: Path) -> None:
    with open_source(bags.write_mcap(tmp_path / "a.mcap", chunk_bytes=1 << 20)) as source:
        message = next(iter(source.messages(["/r1/map"])))
    assert isinstance(message.data, bytes)
    assert io.BytesIO(message.data).getbuffer().nbytes < 3000
