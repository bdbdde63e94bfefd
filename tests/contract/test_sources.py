"""What every source of recordings does, whatever its format."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import zstandard

from mapmerge.grid import Grid
from mapmerge.sim2 import Sim2
from replay.codec import decode
from replay.messages import GridMessage, UpdateMessage
from replay.sources import SOURCES, open_source
from replay.sources.base import GRID_TYPE, UPDATE_TYPE, RawMessage
from tests import bags
from tests.bags import SAMPLE, Recorded, in_order

MAP_TYPES = {GRID_TYPE, UPDATE_TYPE}


@dataclass(frozen=True)
class Format:
    """How to write a recording, and what is in it."""

    source: str
    write: Callable[[Path], Path]
    messages: tuple[Recorded, ...] = SAMPLE
    has_clock: bool = True


@dataclass(frozen=True)
class Bag:
    """A recording that was written."""

    path: Path
    format: Format

    @property
    def map_topics(self) -> set[str]:
        return {each.topic for each in self.format.messages if each.msgtype in MAP_TYPES}

    def expected(self, *topics: str) -> list[Recorded]:
        return in_order(self.format.messages, topics or self.map_topics)

    def read(self, *topics: str) -> list[RawMessage]:
        with open_source(self.path) as source:
            return list(source.messages(topics or self.map_topics))


SAVED = Grid(np.array([[0, -1, 100, 0], [100, 0, 0, -1]], np.int8), 0.05, Sim2(-1.5, 2.25, 0.3))
SAVED_PIXELS = np.array([[0, 254, 254, 205], [254, 205, 0, 254]], np.uint8)
SAVED_MESSAGE = Recorded("/map", GRID_TYPE, 0, bags.map_fields(SAVED))


def _formats() -> dict[str, Format]:
    formats = {
        f"rosbag1-{compression}": Format("rosbag1", partial(_rosbag1, compression=compression))
        for compression in ("none", "lz4", "bz2")
    }
    for storage in ("sqlite3", "mcap"):
        for compression in ("none", "file", "message"):
            options = {"storage": storage, "compression": compression}
            formats[f"rosbag2-{storage}-{compression}"] = Format("rosbag2", partial(_rosbag2, **options))
            formats[f"rosbag2-{storage}-{compression}-split"] = Format("rosbag2", partial(_split, **options))
    formats["rosbag2-without-metadata"] = Format("rosbag2", _without_metadata)
    for compression in ("none", "message"):
        formats[f"sqlite3-{compression}"] = Format("sqlite3", partial(_bare_db3, compression=compression))
        formats[f"zstd-sqlite3-{compression}"] = Format(
            "zstd", partial(_compressed, _bare_db3, compression=compression)
        )
    formats["zstd-mcap"] = Format("zstd", partial(_compressed, _mcap))
    formats["zstd-rosbag1"] = Format("zstd", partial(_compressed, _rosbag1, compression="lz4"))
    for suffix in ("pgm", "png", "bmp"):
        formats[f"map_server-{suffix}"] = Format(
            "map_server", partial(_saved_map, suffix=suffix), (SAVED_MESSAGE,), has_clock=False
        )
    return formats | _mcap_formats()


def _mcap_formats() -> dict[str, Format]:
    layouts: dict[str, dict[str, Any]] = {
        f"chunks-{compression}": {"compression": compression} for compression in ("none", "lz4", "zstd")
    }
    layouts["unchunked"] = {"use_chunking": False}
    indexes: dict[str, dict[str, Any]] = {
        "indexed": {},
        "no-index": bags.NO_INDEX,
        "no-summary": bags.NO_SUMMARY,
        "no-message-index": {"index_types": bags.IndexType.CHUNK},
        "no-statistics": {"use_statistics": False},
        "no-repeated-channels": {"repeat_channels": False, "repeat_schemas": False},
    }
    return {
        f"mcap-{profile or 'no-profile'}-{layout}-{index}": Format(
            "mcap", partial(_mcap, profile=profile, **layouts[layout], **indexes[index])
        )
        for profile in ("ros2", "ros1", "")
        for layout in layouts
        for index in indexes
    }


def _rosbag1(folder: Path, **options: Any) -> Path:
    return bags.write_rosbag1(folder / "recording.bag", **options)


def _rosbag2(folder: Path, **options: Any) -> Path:
    return bags.write_rosbag2(folder / "recording", **options)


def _split(folder: Path, **options: Any) -> Path:
    return bags.write_split_rosbag2(folder / "recording", **options)


def _without_metadata(folder: Path) -> Path:
    path = bags.write_split_rosbag2(folder / "recording")
    (path / "metadata.yaml").unlink()
    return path


def _bare_db3(folder: Path, **options: Any) -> Path:
    # The name has characters that mean something in the URI of a database.
    return bags.write_bare_db3(folder / "100%23 odd?name#1.db3", **options)


def _compressed(write: Callable[..., Path], folder: Path, **options: Any) -> Path:
    plain = write(folder, **options)
    path = plain.with_name(f"{plain.name}.zstd")
    path.write_bytes(zstandard.compress(plain.read_bytes()))
    plain.unlink()
    return path


def _mcap(folder: Path, **options: Any) -> Path:
    return bags.write_mcap(folder / "recording.mcap", **options)


def _saved_map(folder: Path, suffix: str) -> Path:
    return bags.write_saved_map(folder / "map.yaml", SAVED_PIXELS, image=f"map.{suffix}")


FORMATS = _formats()


@pytest.fixture(scope="module", params=FORMATS)
def bag(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Bag:
    known = FORMATS[request.param]
    return Bag(known.write(tmp_path_factory.mktemp("bag")), known)


def _digest(path: Path) -> dict[str, str]:
    """Return the digests of all files around the recording."""
    return {
        str(each.relative_to(path.parent)): hashlib.sha256(each.read_bytes()).hexdigest()
        for each in sorted(path.parent.rglob("*"))
        if each.is_file()
    }


def _matches(raw: RawMessage, expected: Recorded) -> bool:
    """Tell whether a message as read is the one that was recorded."""
    fields, found = expected.fields, decode(raw)
    rows = (fields["height"], fields["width"])
    assert (raw.topic, raw.msgtype, raw.log_time_ns) == (expected.topic, expected.msgtype, expected.log_time_ns)
    assert (found.stamp_ns, found.frame_id) == (fields["stamp_ns"], fields["frame_id"])
    if isinstance(found, UpdateMessage):
        assert (found.col, found.row) == (fields["x"], fields["y"])
        return np.array_equal(found.cells, fields["data"].reshape(rows))
    assert isinstance(found, GridMessage)
    grid, pose = found.grid, found.grid.map_from_grid
    assert grid.resolution_m == pytest.approx(fields["resolution"], abs=1e-8)
    assert (pose.x_m, pose.y_m) == fields["position"][:2]
    assert np.sin(pose.yaw_rad / 2.0) == pytest.approx(fields["orientation"][2], abs=1e-12)
    return np.array_equal(grid.cells, fields["data"].reshape(rows))


def test_every_source_is_tested() -> None:
    assert {each.source for each in FORMATS.values()} == set(SOURCES)


def test_lists_topics_with_counts_in_order_of_name(bag: Bag) -> None:
    with open_source(bag.path) as source:
        found = [(each.name, each.msgtype, each.message_count) for each in source.info.topics]
    messages = bag.format.messages
    names = sorted({(each.topic, each.msgtype) for each in messages})
    assert found == [(*name, sum(each.topic == name[0] for each in messages)) for name in names]


def test_tells_its_format_and_its_time(bag: Bag) -> None:
    with open_source(bag.path) as source:
        info = source.info
        assert source.path == bag.path
    assert info.format == bag.format.source
    times = [each.log_time_ns for each in bag.format.messages]
    expected = (min(times), max(times)) if bag.format.has_clock else (None, None)
    assert (info.start_ns, info.stop_ns) == expected


def test_yields_the_maps_in_order_of_time_ties_as_written(bag: Bag) -> None:
    found, expected = bag.read(), bag.expected()
    assert len(found) == len(expected)
    assert all(map(_matches, found, expected))


def test_yields_only_the_topics_asked_for(bag: Bag) -> None:
    topic = min(bag.map_topics)
    found, expected = bag.read(topic), bag.expected(topic)
    assert [each.log_time_ns for each in found] == [each.log_time_ns for each in expected]
    assert {each.topic for each in found} == {topic}
    assert bag.read("/no/such/topic") == []


def test_yields_other_topics_too_if_asked(bag: Bag) -> None:
    topics = {each.topic for each in bag.format.messages}
    found, expected = bag.read(*topics), bag.expected(*topics)
    assert [(each.topic, each.log_time_ns) for each in found] == [(e.topic, e.log_time_ns) for e in expected]


def test_reads_the_same_twice_even_at_once(bag: Bag) -> None:
    with open_source(bag.path) as source:
        once = source.messages(bag.map_topics)
        first = next(once)
        again = list(source.messages(bag.map_topics))
        assert [first, *once] == again


def test_never_changes_the_recording(bag: Bag) -> None:
    before = _digest(bag.path)
    bag.read()
    assert _digest(bag.path) == before


def test_can_be_closed_half_way(bag: Bag) -> None:
    with open_source(bag.path) as source:
        messages = source.messages(bag.map_topics)
        assert _matches(next(messages), bag.expected()[0])
    assert len(bag.read()) == len(bag.expected())


def test_decoded_cells_are_read_only(bag: Bag) -> None:
    message = decode(bag.read()[0])
    assert isinstance(message, GridMessage)
    assert not message.grid.cells.flags.writeable


@pytest.mark.parametrize("name", ["rosbag1-lz4", "mcap-ros2-chunks-zstd-indexed", "sqlite3-none"])
def test_the_name_of_a_file_does_not_matter(name: str, tmp_path: Path) -> None:
    path = FORMATS[name].write(tmp_path).rename(tmp_path / "recording.txt")
    renamed = Bag(path, FORMATS[name])
    assert len(renamed.read()) == len(renamed.expected())


CHUNKED = [name for name in FORMATS if name.endswith("-indexed") and "chunks" in name] + ["rosbag1-lz4", "rosbag1-bz2"]


@pytest.mark.parametrize("name", CHUNKED)
def test_reads_only_the_chunks_that_hold_the_topics(name: str, tmp_path: Path) -> None:
    known = Bag(FORMATS[name].write(tmp_path), FORMATS[name])
    others = [chunk for chunk in bags.chunks(known.path) if not chunk.topics & known.map_topics]
    assert len(others) == 3
    for chunk in others:
        bags.damage(known.path, chunk)
    assert all(map(_matches, known.read(), known.expected()))
    with open_source(known.path) as source:
        found = list(source.messages(["/chatter"]))
        assert len(found) + len(source.losses.all) == 3
        # The chunks that rosbags compresses with lz4 have no checksum, so that damage to some goes unseen.
        assert found == [] or (name == "rosbag1-lz4" and source.losses.all)


@pytest.mark.parametrize("name", [name for name in CHUNKED if name != "rosbag1-lz4"])
def test_names_a_damaged_chunk_and_uses_all_others(name: str, tmp_path: Path) -> None:
    known = Bag(FORMATS[name].write(tmp_path), FORMATS[name])
    whole = known.read()
    chunk = next(chunk for chunk in bags.chunks(known.path) if "/r1/map" in chunk.topics)
    bags.damage(known.path, chunk)
    with open_source(known.path) as source:
        found = list(source.messages(known.map_topics))
        (loss,) = source.losses.all
    assert loss.place.startswith("the chunk at byte ")
    assert loss.messages is not None
    assert [each for each in whole if each in found] == found
    assert len(found) == len(whole) - loss.messages


def test_opencv_writes_what_the_saved_map_says() -> None:
    """Guards the sample above: the image's top row is the map's last."""
    assert np.array_equal(cv2.flip(SAVED_PIXELS, 0) == 0, SAVED.cells == 100)
