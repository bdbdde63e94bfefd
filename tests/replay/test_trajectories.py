"""Where robots drove, from the transforms that were recorded beside their maps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mapmerge.sim2 import Sim2
from replay.codec import decode_transforms
from replay.events import Event, Merged
from replay.messages import FrameLink
from replay.options import RunOptions, TrajectoryChoice
from replay.pipeline import merge
from replay.plan import Plan
from replay.pose3 import Pose3
from replay.runs import RunPath
from replay.sources import open_source
from replay.tracker import MOST_POSES, STEP_M, Tracker
from replay.trajectories import AUTO_BYTES, Thinned
from tests.bags import SECOND, Recorded, write_mcap, write_rosbag1, write_rosbag2
from tests.program import Program
from tests.runs import growing, in_log_order, link, linked, two_robots

FRAMES = {"r1": "r1/map"}


def at_x(parent: str, child: str, x_m: float) -> FrameLink:
    return FrameLink(parent, child, Pose3.of((x_m, 0.0, 0.3), (0.0, 0.0, 0.0, 1.0)))


def drives(robot: str, first_s: float = 0.0, frame: str | None = None, speed_m: float = 0.2) -> list[Recorded]:
    """Return transforms of a robot that drives along its map's x axis for twenty seconds."""
    frame = frame or f"{robot}/map"
    return [
        linked(first_s + 0.5 * index, link(frame, f"{robot}/base_link", Sim2(speed_m * index, 1.0)))
        for index in range(40)
    ]


def recorded() -> list[Recorded]:
    maps = in_log_order(growing("r1", frame="r1/map"), growing("r2", 2.0, frame="r2/map"))
    return in_log_order(drives("r1"), drives("r2"), maps)


def replayed(path: Path, choice: TrajectoryChoice = "auto", **options: object) -> list[Event]:
    return list(merge(replace(RunOptions((RunPath(None, path),), trajectories=choice), **options)))  # type: ignore[arg-type]


def driven(events: Sequence[Event]) -> dict[str, np.ndarray]:
    """Return all poses of each robot that moved."""
    found: dict[str, list[np.ndarray]] = {}
    for event in events:
        for item in event.moved if isinstance(event, Merged) else ():
            found.setdefault(item.robot, []).append(item.poses)
    return {robot: np.concatenate(poses) for robot, poses in found.items()}


@pytest.mark.parametrize("write", [write_mcap, write_rosbag1, write_rosbag2])
def test_robots_are_where_their_bases_are(write, tmp_path: Path) -> None:
    found = driven(replayed(write(tmp_path / "run", recorded())))
    assert set(found) == {"r1", "r2"}
    assert found["r1"] == pytest.approx(np.array([[0.2 * index, 1.0, 0.0] for index in range(40)]))


def test_of_each_time_what_was_recorded_until_then_is_told(tmp_path: Path) -> None:
    events = [each for each in replayed(write_mcap(tmp_path / "run.mcap", recorded())) if isinstance(each, Merged)]
    for event in events:
        for item in event.moved:
            reached_s = (event.stamp_ns - events[0].stamp_ns) / SECOND
            assert item.poses[-1, 0] <= 0.4 * reached_s + 1e-9
    assert [len(event.moved) for event in events].count(0) <= 2


def test_nothing_is_read_unless_it_is_wanted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_mcap(tmp_path / "run.mcap", recorded())
    assert driven(replayed(path, "none")) == {}
    monkeypatch.setattr(Plan, "input_bytes", lambda *_: AUTO_BYTES + 1)
    assert driven(replayed(path, "auto")) == {}
    assert set(driven(replayed(path, "all"))) == {"r1", "r2"}


def test_damaged_transforms_change_nothing(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    replay = Program(capsys, tmp_path)
    bad = [
        linked(3.0, link("r1/map", "r1/base_link", turn=(0.0, 0.0, 0.0, 0.0))),
        replace(linked(4.0, link("r1/map", "r1/base_link")), lost_bytes=9),
        linked(5.0, link("r1/base_link", "r1/map")),
    ]
    path = write_mcap(tmp_path / "run.mcap", in_log_order(recorded(), bad))
    outputs = {}
    for choice in ("none", "all"):
        folder = tmp_path / choice
        folder.mkdir()
        done = replay(
            "merge", path, "-o", folder / "out.mcap", "--images", "none", "--trajectories", choice, "--strict"
        )
        assert done.status == 0, done.err
        outputs[choice] = [(folder / f"out.{kind}").read_bytes() for kind in ("mcap", "json")]
    assert outputs["none"] == outputs["all"]


def test_without_a_base_or_with_frames_that_are_shared_nobody_moves(tmp_path: Path) -> None:
    assert driven(replayed(write_mcap(tmp_path / "none.mcap", two_robots()))) == {}
    lasers = in_log_order(two_robots(), [linked(1.0, link("map", "laser"))])
    assert driven(replayed(write_mcap(tmp_path / "laser.mcap", lasers))) == {}
    nameless = in_log_order(two_robots(), [linked(1.0, link("map", "base_link"))])
    assert driven(replayed(write_mcap(tmp_path / "shared.mcap", nameless))) == {}
    named = in_log_order(two_robots(), drives("r1", frame="map"), drives("r2", frame="map"))
    assert set(driven(replayed(write_mcap(tmp_path / "named.mcap", named)))) == {"r1", "r2"}


def test_of_transforms_that_come_often_enough_are_read(tmp_path: Path) -> None:
    fast = [
        linked(0.01 * index, link("r1/map" if is_map else "r1/odom", "r1/odom" if is_map else "r1/base_link"))
        for index in range(200)
        for is_map in (True, False)
    ]
    for number, write in enumerate((write_mcap, write_rosbag1)):
        path = write(tmp_path / f"fast{number}", in_log_order(recorded(), fast))
        with open_source(path) as source:
            raws = list(Thinned(source).messages(["/tf"]))
            assert len(raws) == pytest.approx(80 + 2 * 25, abs=2)
            assert all(isinstance(decode_transforms(raw).links[0], FrameLink) for raw in raws)


# The tracker


def followed(*links: FrameLink, frames: dict[str, str] | None = None) -> dict[str, list[tuple[float, float, float]]]:
    tracker = Tracker(frames or FRAMES)
    tracker.take(SECOND, links)
    return tracker.new_poses()


@pytest.mark.parametrize(
    "base", ["base_link", "base_footprint", "r1/base_link", "r1_base_footprint", "other/base_link"]
)
def test_a_base_hangs_on_the_map_frame_by_whatever_is_between(base: str) -> None:
    found = followed(at_x("r1/map", "odom", 2.0), at_x("odom", base, 1.5))
    assert found == {"r1": [pytest.approx((3.5, 0.0, 0.0))]}


@pytest.mark.parametrize(
    ("bases", "x_m"),
    [
        (("base_link", "base_footprint"), 2.0),
        (("base_footprint", "base_link"), 1.0),
        (("a/base_link", "r1/base_link"), 2.0),
        (("a/base_link", "b/base_link"), None),
        (("database_link",), None),
    ],
)
def test_of_several_bases_the_robots_own_is_taken(bases: Sequence[str], x_m: float | None) -> None:
    found = followed(*(at_x("r1/map", base, 1.0 + index) for index, base in enumerate(bases)))
    assert [poses[0][0] for poses in found.values()] == ([] if x_m is None else [x_m])


def test_static_transforms_complete_a_chain() -> None:
    tracker = Tracker(FRAMES)
    tracker.take(None, [at_x("odom", "base_link", 1.0)])
    tracker.take(SECOND, [at_x("r1/map", "odom", 1.0)])
    assert tracker.new_poses() == {"r1": [(2.0, 0.0, 0.0)]}
    assert tracker.new_poses() == {}


def test_steps_that_cannot_be_seen_are_left_out_and_long_ways_are_thinned() -> None:
    tracker = Tracker(FRAMES)
    for index in range(10):
        tracker.take((index + 1) * SECOND, [at_x("r1/map", "base_link", 0.04 * index)])
    assert [pose[0] for pose in tracker.new_poses()["r1"]] == pytest.approx([0.0, 0.12, 0.24, 0.36])
    tracker = Tracker(FRAMES)
    for index in range(3 * MOST_POSES):
        tracker.take((index + 1) * SECOND, [at_x("r1/map", "base_link", 1.01 * STEP_M * index)])
    assert len(tracker.new_poses()["r1"]) == pytest.approx(2 * MOST_POSES, abs=2)
