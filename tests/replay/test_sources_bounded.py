"""What is held of a recording does not grow with what else it holds."""

from __future__ import annotations

import gc
import struct
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from replay.sources import open_source
from tests import bags
from tests.bags import SECOND, START, TEXT_TYPE, Recorded, recorded_map

CHUNK_BYTES = 50_000
FEW, MANY = 1000, 40_000
# A row for each message would take at least 24 bytes.
MOST_GROWTH_BYTES = 10 * (MANY - FEW)
WRITERS: dict[str, Callable[[Path, list[Recorded]], Path]] = {
    "bag": lambda path, messages: bags.write_rosbag1(path, messages, chunk_bytes=CHUNK_BYTES),
    "mcap": lambda path, messages: bags.write_mcap(path, messages, chunk_bytes=CHUNK_BYTES),
    "db3": bags.write_bare_db3,
}


def recording(chatter: int) -> list[Recorded]:
    """Return a map, much chatter, and a map."""
    words = [Recorded("/chatter", TEXT_TYPE, START + number, {"data": "x"}) for number in range(1, chatter + 1)]
    return [recorded_map("/r1/map", START, 1), *words, recorded_map("/r1/map", START + SECOND, 2)]


def held_bytes(path: Path) -> int:
    """Return how much more is held at most while the maps of a recording are read than when it is closed."""

    def read() -> None:
        with open_source(path) as source:
            assert source.info.topics
            for message in source.messages(["/r1/map"]):
                assert message.data
                held.append(tracemalloc.get_traced_memory()[0])

    held: list[int] = []
    read()  # imports
    held.clear()
    gc.collect()
    tracemalloc.start()
    try:
        read()
    finally:
        tracemalloc.stop()
    return max(held)


@pytest.mark.parametrize("is_cut", [False, True], ids=["whole", "cut off"])
@pytest.mark.parametrize("name", WRITERS)
def test_messages_of_other_topics_are_not_held(name: str, is_cut: bool, tmp_path: Path) -> None:
    found = []
    for chatter in (FEW, MANY):
        folder = tmp_path / str(chatter)
        folder.mkdir()
        path = WRITERS[name](folder / f"large.{name}", recording(chatter))
        if is_cut:
            path.write_bytes(path.read_bytes()[:-200])
        found.append(held_bytes(path))
    # a chunk that is not full is smaller than one that is
    assert found[1] - found[0] < MOST_GROWTH_BYTES + 2 * CHUNK_BYTES


@pytest.mark.parametrize("name", WRITERS)
def test_they_can_be_read_all_the_same(name: str, tmp_path: Path) -> None:
    path = WRITERS[name](tmp_path / f"a.{name}", recording(FEW))
    path.write_bytes(path.read_bytes()[:-200])
    with open_source(path) as source:
        listed = {item.name: item.message_count for item in source.info.topics}
        chatter = [message.log_time_ns for message in source.messages(["/chatter"])]
        both = [message.log_time_ns for message in source.messages(["/chatter", "/r1/map"])]
    assert len(chatter) == listed["/chatter"] > FEW // 2
    assert len(both) == listed["/chatter"] + listed["/r1/map"]
    assert set(chatter) < set(both)
    assert both == sorted(both)


LARGE_BYTES = 100 << 20
SCHEMA, CHANNEL, MESSAGE_INDEX = 3, 4, 7


def put_in(path: Path, at: int, opcode: int, content: bytes) -> int:
    """Put a record into a file that is as large as it is because of the zeros at its end; return how large it is."""
    data = path.read_bytes()
    head = struct.pack("<BQ", opcode, len(content) + LARGE_BYTES) + content
    with path.open("wb") as file:
        file.write(data[:at] + head)
        file.seek(LARGE_BYTES, 1)
        file.write(data[at:])
    return len(head) + LARGE_BYTES


def maps_and_peak(path: Path) -> tuple[int, int]:
    """Return how many maps are read of a recording, and how much memory that takes at most."""
    tracemalloc.start()
    try:
        with open_source(path) as source:
            maps = len(list(source.messages(["/r1/map"])))
        return maps, tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def three_maps(path: Path, **options: Any) -> Path:
    messages = [recorded_map("/r1/map", START + number, number, rows=4) for number in range(3)]
    return bags.write_mcap(path, messages, chunk_bytes=1, **options)


@pytest.mark.parametrize(
    ("opcode", "content"),
    [
        (SCHEMA, struct.pack("<HI4sI7sI", 9, 4, b"a/B ", 7, b"ros2msg", LARGE_BYTES)),
        (CHANNEL, struct.pack("<HHI2sI3sI", 9, 0, 2, b"/x", 3, b"cdr", LARGE_BYTES)),
    ],
)
def test_a_description_that_is_large_is_not_read(tmp_path: Path, opcode: int, content: bytes) -> None:
    path = three_maps(tmp_path / "a.mcap", **bags.NO_SUMMARY)
    data = path.read_bytes()
    put_in(path, 8 + 9 + struct.unpack_from("<Q", data, 9)[0], opcode, content)
    maps, peak_bytes = maps_and_peak(path)
    assert maps == 3
    assert peak_bytes < LARGE_BYTES // 4
    with open_source(path) as source:
        assert ["at most 16777216 are read" in loss.detail for loss in source.losses.all] == [True]


def test_a_message_index_that_is_large_is_not_read(tmp_path: Path) -> None:
    path = three_maps(tmp_path / "a.mcap", enable_crcs=False)
    data = bytearray(path.read_bytes())
    (summary,) = struct.unpack_from("<Q", data, len(data) - 28)
    own_index = data.index(struct.pack("<BQHI", MESSAGE_INDEX, 22, 1, 16))
    in_summary = data.index(struct.pack("<HQ", 1, own_index), summary)
    place = summary - 13
    struct.pack_into("<Q", data, in_summary + 2, place)
    path.write_bytes(data)
    grown = put_in(path, place, MESSAGE_INDEX, struct.pack("<HI", 1, LARGE_BYTES))
    with path.open("r+b") as file:
        file.seek(-28, 2)
        file.write(struct.pack("<Q", summary + grown))
    maps, peak_bytes = maps_and_peak(path)
    assert maps == 3
    assert peak_bytes < LARGE_BYTES // 4
