"""Where robots drove, from the transforms that were recorded beside their maps."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import zstandard

from mapmerge.sim2 import Sim2
from replay import trajectories
from replay.codec import decode_transforms
from replay.errors import InputError
from replay.events import Event, Merged
from replay.messages import FrameLink
from replay.options import RunOptions, TrajectoryChoice
from replay.pipeline import merge
from replay.plan import Plan
from replay.pose3 import Pose3
from replay.runs import RunPath
from replay.sources import compressed_file, open_source
from replay.sources.base import RawMessage
from replay.thinned_transforms import Thinned
from replay.tracker import MOST_POSES, STEP_M, Tracker
from replay.trajectories import AUTO_BYTES
from tests.bags import SECOND, Recorded, write_mcap, write_rosbag1, write_rosbag2
from tests.pages import Page
from tests.program import Program
from tests.rrd import contents
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


def test_many_transforms_are_read_only_when_that_is_asked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_mcap(tmp_path / "run.mcap", recorded())
    monkeypatch.setattr(trajectories, "AUTO_MESSAGES", 80)
    assert set(driven(replayed(path, "auto"))) == {"r1", "r2"}
    monkeypatch.setattr(trajectories, "AUTO_MESSAGES", 79)
    assert driven(replayed(path, "auto")) == {}
    assert set(driven(replayed(path, "all"))) == {"r1", "r2"}


def test_what_is_compressed_as_a_file_is_decompressed_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plain = write_mcap(tmp_path / "run.mcap", recorded())
    path = tmp_path / "run.mcap.zstd"
    path.write_bytes(zstandard.ZstdCompressor().compress(plain.read_bytes()))
    assert driven(replayed(path, "auto")) == {}
    folder = write_rosbag2(tmp_path / "folder", recorded(), compression="file")
    assert driven(replayed(folder, "auto")) == {}
    times = []
    decompress = compressed_file.decompress_file
    monkeypatch.setattr(compressed_file, "decompress_file", lambda *known: times.append(known) or decompress(*known))
    assert same(driven(replayed(path, "all")), driven(replayed(plain, "all")))
    assert len(times) == 1


@pytest.mark.parametrize("jobs", [2, 3])
def test_it_is_the_same_with_several_jobs(jobs: int, tmp_path: Path) -> None:
    many = in_log_order(recorded(), drives("r1", 2.0, speed_m=0.5), drives("r2", 7.0, speed_m=0.4))
    path = write_mcap(tmp_path / "run.mcap", many)
    alone, beside = (
        [event.moved for event in replayed(path, jobs=count) if isinstance(event, Merged)] for count in (1, jobs)
    )
    assert len(alone) == len(beside)
    for one, other in zip(alone, beside, strict=True):
        assert [item.robot for item in one] == [item.robot for item in other]
        assert all(np.array_equal(mine.poses, its.poses) for mine, its in zip(one, other, strict=True))


def of_one_robot(path: Path, robot: str, first_s: float) -> Path:
    return write_mcap(path, in_log_order(drives(robot), growing(robot, first_s, frame=f"{robot}/map")))


def breaks_off(monkeypatch: pytest.MonkeyPatch, name: str, after: int) -> None:
    """Let a recording be one that cannot be read on when its transforms are looked at."""

    def messages(self: Thinned, topics: Collection[str]) -> Iterator[RawMessage]:
        for index, raw in enumerate(whole(self, topics)):
            if index == after and self.path.name == name:
                raise InputError(f"{name}: it is gone")
            yield raw

    whole = Thinned.messages
    monkeypatch.setattr(Thinned, "messages", messages)


def test_one_recording_that_cannot_be_read_on_is_one_remark(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    paths = [of_one_robot(tmp_path / "a.mcap", "r1", 0.0), of_one_robot(tmp_path / "b.mcap", "r2", 2.0)]
    options = RunOptions(tuple(RunPath(None, path) for path in paths), trajectories="all")
    whole = driven(list(merge(options)))
    program, outputs = Program(capsys, tmp_path), {}
    breaks_off(monkeypatch, "a.mcap", 30)
    events = list(merge(options))
    assert np.array_equal(driven(events)["r2"], whole["r2"])
    begun = driven(events)["r1"]
    assert 10 < len(begun) <= 30
    assert np.array_equal(begun, whole["r1"][: len(begun)])
    said = "where robots drove is not read on from a.mcap: a.mcap: it is gone"
    assert [remark for event in events if isinstance(event, Merged) for remark in event.remarks] == [said]
    for choice in ("none", "all"):
        output = tmp_path / choice / "out.mcap"
        output.parent.mkdir()
        outs = ("-o", output, "--report", output.with_suffix(".html"))
        done = program("merge", *paths, *outs, "--images", "none", "--trajectories", choice, "-v", "--strict")
        assert done.status == 0
        assert done.err.count(said) == (choice == "all")
        rows = str([each for each in contents(output.with_suffix(".rrd")) if each[0] == "/decisions"])
        assert rows.count(said) == (choice == "all")
        page = Page.read(output.with_suffix(".html"))
        assert ("A recording could not be read to the end for them." in page.words("map")) == (choice == "all")
        outputs[choice] = [output.with_suffix(suffix).read_bytes() for suffix in (".mcap", ".json")]
    assert outputs["none"] == outputs["all"]
    assert said not in program("merge", *paths, "-o", tmp_path / "usual.mcap", "--trajectories", "all").err


def test_the_page_shows_them_and_the_record_does_not_tell(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    """Also where no Rerun recording is written; and nothing is read where nothing shows it."""
    path, outputs = write_mcap(tmp_path / "run.mcap", recorded()), {}
    for choice in ("none", "auto", "all"):
        folder = tmp_path / choice
        folder.mkdir()
        flags = ("-o", folder / "out.mcap", "--no-rrd", "--report", folder / "out.html", "--images", "none")
        assert Program(capsys, tmp_path)("merge", path, *flags, "--trajectories", choice).status == 0
        outputs[choice] = {kind: (folder / f"out.{kind}").read_bytes() for kind in ("mcap", "json", "html")}
    for kind in ("mcap", "json"):
        assert outputs["none"][kind] == outputs["auto"][kind] == outputs["all"][kind]
    assert outputs["auto"]["html"] == outputs["all"]["html"]
    assert b'aria-label="Where r1, r2 drove"' in outputs["auto"]["html"]
    assert b"drove" not in Page(outputs["none"]["html"].decode()).words().encode()


@pytest.mark.parametrize(
    ("flags", "is_read"),
    [
        (("merge", "-o", "out.mcap"), True),
        (("merge", "-o", "out.mcap", "--no-rrd", "--report", "out.html"), True),
        (("merge", "-o", "out.mcap", "--no-rrd"), False),
        (("check", "--write-expect", "expect.yaml"), False),
        (("check", "--write-expect", "expect.yaml", "-o", "out.mcap"), True),
    ],
)
def test_it_is_read_where_an_output_shows_it(
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    flags: Sequence[str],
    is_read: bool,
) -> None:
    monkeypatch.chdir(tmp_path)
    path, asked = write_mcap(tmp_path / "run.mcap", recorded()), []
    wanted = trajectories.Trajectories._wanted

    def noticed(self: trajectories.Trajectories) -> list[int]:
        asked.append(wanted(self))
        return asked[-1]

    monkeypatch.setattr(trajectories.Trajectories, "_wanted", noticed)
    command, *rest = flags
    assert Program(capsys, tmp_path)(command, path, *rest).status == 0
    assert asked == [[0] if is_read else []]


def same(one: Mapping[str, np.ndarray], other: Mapping[str, np.ndarray]) -> bool:
    return set(one) == set(other) and all(np.array_equal(poses, other[robot]) for robot, poses in one.items())


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
