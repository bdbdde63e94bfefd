from __future__ import annotations

import struct
from pathlib import Path

import pytest

from replay.errors import InputError
from replay.sources import open_source
from tests import bags
from tests.replay.test_sources_open import refused


def _with_index_pos(path: Path, index_pos: int) -> Path:
    data = bytearray(path.read_bytes())
    start = data.index(b"index_pos=") + len(b"index_pos=")
    data[start : start + 8] = struct.pack("<Q", index_pos)
    path.write_bytes(data)
    return path


def test_unindexed_says_to_reindex(tmp_path: Path) -> None:
    refused(_with_index_pos(bags.write_rosbag1(tmp_path / "a.bag.active"), 0), "no index", "rosbag reindex")


def test_truncated_says_where(tmp_path: Path) -> None:
    path = bags.write_rosbag1(tmp_path / "a.bag")
    path.write_bytes(path.read_bytes()[:9000])
    refused(path, "ends early at byte 9000", "rosbag reindex")


def test_truncated_index(tmp_path: Path) -> None:
    path = bags.write_rosbag1(tmp_path / "a.bag")
    path.write_bytes(path.read_bytes()[:-10])
    assert "text mode" not in refused(path, "index", "damaged", "rosbag reindex")


def test_another_version(tmp_path: Path) -> None:
    path = tmp_path / "a.bag"
    path.write_bytes(b"#ROSBAG V3.7\n" + bytes(100))
    refused(path, "#ROSBAG V3.7")


def test_every_truncation_is_one_line(tmp_path: Path) -> None:
    data = bags.write_rosbag1(tmp_path / "whole.bag", bags.SAMPLE[1:3], "lz4").read_bytes()
    for length in range(1, len(data), 97):
        path = tmp_path / "cut.bag"
        path.write_bytes(data[:length])
        refused(path)


def test_uncompressed_chunk_of_the_wrong_size(tmp_path: Path) -> None:
    path = bags.write_rosbag1(tmp_path / "a.bag", bags.SAMPLE[1:2])
    data = bytearray(path.read_bytes())
    start = data.index(b"size=") + len(b"size=")
    data[start] ^= 1
    path.write_bytes(data)
    refused(path, "the chunk at byte 4109 is damaged", "copy")


def test_bag_without_messages(tmp_path: Path) -> None:
    with open_source(bags.write_rosbag1(tmp_path / "a.bag", [])) as source:
        assert source.info.topics == ()
        assert source.info.start_ns is None
        assert list(source.messages(["/map"])) == []


def test_index_that_does_not_fit(tmp_path: Path) -> None:
    path = bags.write_rosbag1(tmp_path / "a.bag", bags.SAMPLE[1:3])
    (chunk, *_) = bags.chunks(path)
    data = bytearray(path.read_bytes())
    # The time in the message's own record; the index keeps the old one.
    start = data.index(b"time=", chunk.start) + len(b"time=")
    data[start] ^= 1
    path.write_bytes(data)
    with pytest.raises(InputError, match="index does not fit the chunk"), open_source(path) as source:
        list(source.messages(["/r1/map"]))
