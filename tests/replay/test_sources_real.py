"""Recordings made elsewhere, with other tools: shared data, absent from the project."""

from __future__ import annotations

import tarfile
from collections import Counter
from pathlib import Path

import pytest

from replay.codec import decode
from replay.messages import GridMessage
from replay.sources import open_source
from replay.sources.base import GRID_TYPE
from tests.data_paths import shared_data


def _read(path: Path) -> tuple[Counter[str], list[GridMessage]]:
    """Return the count of maps by topic, and each topic's last map."""
    counts: Counter[str] = Counter()
    last: dict[str, GridMessage] = {}
    with open_source(path) as source:
        topics = [topic for topic in source.info.topics if topic.msgtype == GRID_TYPE]
        before_ns = source.info.start_ns or 0
        for raw in source.messages([topic.name for topic in topics]):
            assert before_ns <= raw.log_time_ns
            before_ns = raw.log_time_ns
            message = decode(raw)
            assert isinstance(message, GridMessage)
            counts[raw.topic], last[raw.topic] = counts[raw.topic] + 1, message
        assert before_ns <= (source.info.stop_ns or 0)
        assert counts == {topic.name: topic.message_count for topic in topics}
    return counts, list(last.values())


@pytest.mark.parametrize(
    ("name", "robots"),
    [
        ("intel_two.mcap", 2),
        ("intel_res.mcap", 2),
        ("intel_three.bag", 3),
        ("odd_one_out.mcap", 3),
        ("fr101_two", 2),
        ("fr101_two/fr101_two.db3", 2),
    ],
)
def test_real_maps_grow(name: str, robots: int) -> None:
    counts, last = _read(shared_data(f"real/{name}"))
    assert sorted(counts) == [f"/r{robot}/map" for robot in range(1, robots + 1)]
    assert set(counts.values()) <= {8, 9}
    assert all(each.grid.known_area_m2 > 100.0 for each in last)


def test_graded_costmaps() -> None:
    counts, last = _read(shared_data("recorded/graded_costmaps.bag"))
    assert sum(counts.values()) == 2
    assert all(len(set(each.grid.cells.reshape(-1).tolist())) > 3 for each in last)


def test_bags_of_two_robots(tmp_path: Path) -> None:
    with tarfile.open(shared_data("recorded/corner_two_robots.tar.gz")) as archive:
        # A hundred MB each, of which these few chunks are enough to see that they are read.
        archive.extractall(tmp_path, filter="data")
    counts: Counter[str] = Counter()
    for path in sorted((tmp_path / "bags").iterdir()):
        counts += _read(path)[0]
    assert counts == {"/apollon/map": 27, "/boreas/map": 23}
