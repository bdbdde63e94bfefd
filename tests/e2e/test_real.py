"""Recordings of real buildings, whose truth is known: shared data, absent from the project."""

from __future__ import annotations

import tarfile
from pathlib import Path

import pytest

from benchmarks.recordings import RECORDINGS
from tests.data_paths import shared_data
from tests.outputs import maps, raw
from tests.program import Program
from tests.truth import check, read_truth


@pytest.mark.parametrize("name", RECORDINGS)
def test_end_where_the_truth_says(replay: Program, name: str) -> None:
    path = shared_data(f"real/{name}")
    ran = replay.merge(path)
    check(ran.robots, read_truth(path.parent / f"{path.stem}.truth.json"))
    assert ran.report["skipped"] == {}
    assert maps(ran.mcap)[-1].stamp_ns <= ran.report["stamp_ns"]


def test_one_corner_is_too_little_structure(replay: Program, tmp_path: Path) -> None:
    with tarfile.open(shared_data("recorded/corner_two_robots.tar.gz")) as archive:
        archive.extractall(tmp_path, filter="data")
    ran = replay.merge(f"a={tmp_path}/bags/apollon_corner.bag", f"b={tmp_path}/bags/boreas_corner.bag")
    assert ran.statuses == {"a": "reference", "b": "unmerged"}
    assert ran.robots["b"]["reason"]["code"] == "too_little_structure"
    assert len(raw(ran.mcap, "/merged/map")) < 27


def test_graded_costmaps_are_maps_if_there_are_no_others(replay: Program) -> None:
    ran = replay.merge(shared_data("recorded/graded_costmaps.bag"))
    assert ran.status == 0
    assert ran.report["updates"] > 0


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("line_endings_damaged.bag", "expected a topic of type nav_msgs/msg/OccupancyGrid"),
        ("no_grid_topic.mcap", "expected a topic of type nav_msgs/msg/OccupancyGrid"),
        ("no_grid_topic_db3", "expected a topic of type nav_msgs/msg/OccupancyGrid"),
        ("rosrecord_v1_2.bag", "rosbag fix"),
    ],
)
@pytest.mark.parametrize("command", ["merge", "info"])
def test_faulty(replay: Program, command: str, name: str, expected: str) -> None:
    path = shared_data(f"faulty/{name}")
    ran = replay(command, path)
    if command == "info" and name != "rosrecord_v1_2.bag":
        assert (ran.status, ran.err) == (0, "")
        assert expected in ran.out
        assert ("text mode" in ran.out) == name.startswith("line_endings")
        return
    assert ran.status == 2
    assert str(path) in ran.error
    assert expected in ran.error
    assert not list(replay.folder.iterdir())
