from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from replay.errors import InputError, UsageError
from replay.open_plan import open_plan
from replay.options import RunOptions, TimeBound
from replay.plan import MERGED_FRAME, Plan
from replay.runs import RunPath
from replay.sources.base import UPDATE_TYPE
from tests.bags import SECOND, Recorded, write_mcap, write_rosbag2
from tests.fakes import FakeSource
from tests.runs import at, growing, in_log_order, link, linked, seen, two_robots


def planned(*runs: str | Path, **options: Any) -> Plan:
    with open_plan(RunOptions(tuple(RunPath.parse(str(run)) for run in runs), **options)) as plan:
        return plan


@pytest.fixture
def two(tmp_path: Path) -> Path:
    return write_mcap(tmp_path / "two.mcap", two_robots())


def test_robots(two: Path) -> None:
    r1, r2 = planned(two).robots
    assert (r1.robot, r1.topic, r1.frame, r1.clock, r1.inputs) == ("r1", "/r1/map", "r1/map", "header", (0,))
    assert (r2.robot, r2.message_count) == ("r2", 3)
    assert MERGED_FRAME == "merged"


def test_only_what_is_needed_is_read(two: Path) -> None:
    (feed,) = planned(two, robots=("r2",)).feeds
    assert dict(feed.robot_of) == {"/r2/map": "r2"}


def test_updates_are_fed_to_their_robot(tmp_path: Path) -> None:
    update = {"stamp_ns": 0, "frame_id": "", "x": 0, "y": 0, "width": 1, "height": 1}
    messages = [
        seen("r1", 0.0),
        Recorded("/r1/map_updates", UPDATE_TYPE, at(1.0), {**update, "data": np.zeros(1, np.int8)}),
    ]
    plan = planned(write_mcap(tmp_path / "run.mcap", messages))
    assert dict(plan.feeds[0].robot_of) == {"/r1/map": "r1", "/r1/map_updates": "r1"}
    assert plan.robots[0].message_count == 2


def test_a_topic_that_is_only_called_like_updates_is_not(tmp_path: Path) -> None:
    text = Recorded("/r1/map_updates", "std_msgs/msg/String", at(1.0), {"data": "no map"})
    plan = planned(write_mcap(tmp_path / "run.mcap", [seen("r1", 0.0), text]))
    assert dict(plan.feeds[0].robot_of) == {"/r1/map": "r1"}
    assert plan.robots[0].message_count == 1


def test_one_clock_a_robot(tmp_path: Path) -> None:
    """If one part of a robot's recording has no header times, all its times are the log's."""
    a = write_mcap(tmp_path / "a.mcap", growing("r1"))
    b = write_mcap(tmp_path / "b.mcap", growing("r1", 60.0, stamp_ns=0))
    plan = planned(a, b)
    assert plan.robots[0].clock == "log"
    assert [dict(feed.clocks) for feed in plan.feeds] == [{"/r1/map": "log"}] * 2


def test_window(two: Path) -> None:
    window = planned(two, start=TimeBound(3, relative=True), stop=TimeBound(at(9.0), relative=False)).window
    assert (window.start_ns, window.stop_ns, window.reorder_ns) == (at(0.0) + 3, at(9.0), 5 * SECOND)
    with pytest.raises(UsageError, match="--stop is not after --start"):
        planned(two, start=TimeBound(SECOND, relative=True), stop=TimeBound(SECOND, relative=True))


def test_what_is_said_of_inputs_before_they_are_read(tmp_path: Path, two: Path) -> None:
    bag = write_rosbag2(tmp_path / "bag", growing("r3"))
    first, second = planned(two, bag).describe_inputs()
    assert (first["name"], first["size_bytes"]) == ("two.mcap", two.stat().st_size)
    assert (second["name"], second["format"], second["robots"]) == ("bag", "rosbag2", ["r3"])
    assert second["size_bytes"] == sum(file.stat().st_size for file in bag.iterdir())
    assert (first["messages"], first["late"], first["sha256"]) == (None, None, None)


class TestTransforms:
    TF = (linked(0.5, link("world", "r1/map"), static=True), linked(1.0, link("world", "r2/map")))

    def test_are_read_only_if_asked_for(self, tmp_path: Path) -> None:
        run = write_mcap(tmp_path / "run.mcap", in_log_order(self.TF, two_robots()))
        assert planned(run).transform_feeds is None
        static, moving = planned(run, use_tf=True).transform_feeds or ()
        assert dict(static.robot_of) == {"/tf_static": ""}
        assert dict(moving.robot_of) == {"/tf": ""}
        assert (dict(static.clocks), dict(moving.clocks)) == ({"/tf_static": "none"}, {"/tf": "header"})

    def test_are_on_the_clock_of_the_maps_beside_them(self, tmp_path: Path) -> None:
        a = write_mcap(tmp_path / "a.mcap", growing("r1"))
        b = write_mcap(tmp_path / "b.mcap", in_log_order(self.TF[1:], growing("r2", 100.0, stamp_ns=0)))
        (moving,) = planned(a, b, use_tf=True, align_starts=True).transform_feeds or ()
        assert moving.source.path == b
        assert (dict(moving.clocks), dict(moving.offsets_ns)) == ({"/tf": "log"}, {"/tf": -100 * SECOND})

    def test_topics_that_are_only_called_so_are_not(self, tmp_path: Path) -> None:
        text = Recorded("/tf", "std_msgs/msg/String", at(1.0), {"data": "no transform"})
        run = write_mcap(tmp_path / "run.mcap", in_log_order([text], two_robots()))
        assert planned(run, use_tf=True).recordings_with_transforms() == []

    def test_frames_are_told_as_recorded(self, tmp_path: Path) -> None:
        messages = [seen("r1", 0.0, frame="/map"), seen("r2", 1.0, frame="map"), seen("r3", 2.0, resolution=0.0)]
        plan = planned(write_mcap(tmp_path / "run.mcap", messages))
        assert dict(plan.map_frames) == {"r1": "map", "r2": "map", "r3": None}


def test_no_recording() -> None:
    with pytest.raises(UsageError, match="no recording was given"):
        planned()


def test_a_recording_that_is_none(tmp_path: Path, two: Path) -> None:
    with pytest.raises(InputError, match="does not exist"):
        planned(two, tmp_path / "nowhere.bag")


def test_inputs_are_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    closed = []

    class Source(FakeSource):
        def close(self) -> None:
            closed.append(self)

    monkeypatch.setattr("replay.sources.open_source", lambda path, _: Source(growing(path.stem)))
    with pytest.raises(UsageError):
        planned("r1.bag", "r2.bag", robots=("r9",))
    assert len(closed) == 2
    planned("r1.bag")
    assert len(closed) == 3
