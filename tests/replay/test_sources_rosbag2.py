from __future__ import annotations

import tempfile
from collections.abc import Collection, Iterator
from pathlib import Path

import pytest

from replay.sources import open_source
from replay.sources.base import RawMessage, SourceInfo
from replay.sources.boundary import Closing
from replay.sources.rosbag2_folder import merged_by_time
from replay.sources.zstd import MAGIC, zstd
from tests import bags
from tests.bags import START
from tests.replay.test_sources_open import refused

TOPICS = {each.topic for each in bags.SAMPLE}


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


def test_a_missing_part_is_named(tmp_path: Path) -> None:
    path = bags.write_split_rosbag2(tmp_path / "bag")
    (path / "bag_7.db3").unlink()
    refused(path, "1 of the 10 parts", "bag_7.db3", "metadata.yaml")


def test_a_part_that_is_not_compressed_yet(tmp_path: Path, temporary: Path) -> None:
    path = bags.write_split_rosbag2(tmp_path / "bag", compression="file")
    plain = bags.write_split_rosbag2(tmp_path / "plain")
    (path / "bag_14.db3.zstd").unlink()
    (plain / "plain_14.db3").rename(path / "bag_14.db3")
    with open_source(path) as source:
        assert len(list(source.messages(TOPICS))) == len(bags.SAMPLE)
        assert len(list(temporary.iterdir())) == len(bags.SAMPLE) - 1
    assert list(temporary.iterdir()) == []


def test_without_metadata_a_part_and_its_compressed_copy_count_once(tmp_path: Path, temporary: Path) -> None:
    path = bags.write_rosbag2(tmp_path / "bag", compression="file")
    (path / "metadata.yaml").unlink()
    plain = bags.write_rosbag2(tmp_path / "plain")
    (plain / "plain.db3").rename(path / "bag.db3")
    with open_source(path) as source:
        assert len(list(source.messages(TOPICS))) == len(bags.SAMPLE)
        assert list(temporary.iterdir()) == []


@pytest.mark.parametrize("storage", ["sqlite3", "mcap"])
def test_a_truncated_compressed_part_leaves_no_copy(tmp_path: Path, temporary: Path, storage: str) -> None:
    path = bags.write_rosbag2(tmp_path / "bag", storage=storage, compression="file")
    (part,) = path.glob("*.zstd")
    part.write_bytes(part.read_bytes()[:-20])
    refused(path, str(part), "ended before")
    assert list(temporary.iterdir()) == []


def test_damage_in_a_compressed_part_names_the_part_not_its_copy(tmp_path: Path) -> None:
    path = bags.write_rosbag2(tmp_path / "bag", storage="mcap", compression="file")
    (part,) = path.glob("*.zstd")
    part.write_bytes(zstd.compress(bags.write_mcap(tmp_path / "inner.mcap").read_bytes()[:5000]))
    refused(path, str(part), "ends early at byte 5000")


def test_a_damaged_compressed_message(tmp_path: Path) -> None:
    path = bags.write_rosbag2(tmp_path / "bag", bags.SAMPLE[1:2], compression="message")
    (part,) = path.glob("*.db3")
    data = bytearray(part.read_bytes())
    start = data.index(MAGIC) + len(MAGIC)
    data[start : start + 20] = b"\xff" * 20
    part.write_bytes(data)
    refused(path, str(part), "ZstdError")


def test_another_compression(tmp_path: Path) -> None:
    path = bags.write_rosbag2(tmp_path / "bag", compression="message")
    metadata = path / "metadata.yaml"
    metadata.write_text(metadata.read_text().replace("compression_format: zstd", "compression_format: lz4"))
    refused(path, "'lz4'", "zstd", "ros2 bag convert")


@pytest.mark.parametrize(
    ("text", "word"),
    [("", "rosbag2_bagfile_information"), ("a: [", "cannot be read"), ("- 1", "rosbag2_bagfile_information")],
)
def test_metadata_that_is_none(tmp_path: Path, text: str, word: str) -> None:
    path = bags.write_rosbag2(tmp_path / "bag")
    (path / "metadata.yaml").write_text(text)
    refused(path, str(path / "metadata.yaml"), word)


def test_a_part_that_is_no_recording(tmp_path: Path) -> None:
    path = bags.write_rosbag2(tmp_path / "bag")
    (path / "bag.db3").write_bytes(b"something else")
    refused(path, str(path / "bag.db3"), "neither MCAP nor SQLite")


def test_a_wal_beside_a_part(tmp_path: Path) -> None:
    path = bags.write_rosbag2(tmp_path / "bag")
    (path / "bag.db3-wal").write_bytes(b"rows")
    refused(path, "bag.db3-wal")


def test_the_metadata_itself_points_to_its_folder(tmp_path: Path) -> None:
    path = bags.write_rosbag2(tmp_path / "bag")
    refused(path / "metadata.yaml", "give its folder", str(path))


# --- merging


class _Part(Closing):
    """A recording of one topic; tells whether it has been read from."""

    def __init__(self, name: str, *seconds: int) -> None:
        self.path = Path(name)
        self.seconds = seconds
        self.is_read = False

    @property
    def info(self) -> SourceInfo:
        times = [START + each for each in self.seconds]
        return SourceInfo("mcap", min(times, default=None), max(times, default=None), ())

    def messages(self, topics: Collection[str]) -> Iterator[RawMessage]:
        del topics
        self.is_read = True
        for each in self.seconds:
            yield RawMessage(str(self.path), "t", "cdr", START + each, b"")

    def close(self) -> None:
        pass


def test_parts_are_merged_by_time_and_ties_keep_the_order_of_the_parts() -> None:
    parts = [_Part("a", 2, 3, 5), _Part("b"), _Part("c", 1, 3, 3), _Part("d", 3, 9)]
    found = [(each.topic, each.log_time_ns - START) for each in merged_by_time(parts, ["t"])]
    assert found == [("c", 1), ("a", 2), ("a", 3), ("c", 3), ("c", 3), ("d", 3), ("a", 5), ("d", 9)]


def test_a_part_is_read_only_when_it_is_due() -> None:
    parts = [_Part("a", 1, 2), _Part("b", 3, 4), _Part("c", 5, 6)]
    messages = merged_by_time(parts, ["t"])
    next(messages)
    assert [part.is_read for part in parts] == [True, False, False]
    next(messages)
    next(messages)
    assert [part.is_read for part in parts] == [True, True, False]
