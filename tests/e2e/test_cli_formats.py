"""The same recording in every format, and formats mixed."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from replay.codec import ros2_typestore
from tests import bags
from tests.outputs import raw
from tests.program import Program
from tests.runs import at, flat_map, growing, in_log_order, is_right, reference_from, seen, two_robots, updated

CELLS = np.full((4, 6), 100, np.int8)
RECORDED = in_log_order(
    two_robots(),
    [updated("r1", 21.0, 30, 30, CELLS), seen("r2", 23.0, resolution=-0.1), seen("r2", 24.0, stamp_ns=at(3.5))],
)

FORMATS: dict[str, Callable[[Path], Path]] = {
    "rosbag1": lambda folder: bags.write_rosbag1(folder / "run.bag", RECORDED),
    "rosbag1-lz4": lambda folder: bags.write_rosbag1(folder / "run.bag", RECORDED, "lz4"),
    "rosbag1-bz2": lambda folder: bags.write_rosbag1(folder / "run.bag", RECORDED, "bz2"),
    "rosbag2-sqlite3": lambda folder: bags.write_rosbag2(folder / "run", RECORDED),
    "rosbag2-sqlite3-file": lambda folder: bags.write_rosbag2(folder / "run", RECORDED, compression="file"),
    "rosbag2-sqlite3-message": lambda folder: bags.write_rosbag2(folder / "run", RECORDED, compression="message"),
    "rosbag2-mcap": lambda folder: bags.write_rosbag2(folder / "run", RECORDED, "mcap"),
    "rosbag2-split": lambda folder: bags.write_split_rosbag2(folder / "run", RECORDED),
    "db3": lambda folder: bags.write_bare_db3(folder / "run.db3", RECORDED),
    "mcap": lambda folder: bags.write_mcap(folder / "run.mcap", RECORDED),
    "mcap-ros1": lambda folder: bags.write_mcap(folder / "run.mcap", RECORDED, "ros1"),
    "mcap-no-profile": lambda folder: bags.write_mcap(folder / "run.mcap", RECORDED, ""),
    "mcap-no-index": lambda folder: bags.write_mcap(folder / "run.mcap", RECORDED, **bags.NO_INDEX),
    "mcap-no-summary": lambda folder: bags.write_mcap(folder / "run.mcap", RECORDED, **bags.NO_SUMMARY),
    "mcap-unchunked": lambda folder: bags.write_mcap(folder / "run.mcap", RECORDED, use_chunking=False),
}


def outcome(program: Program, path: Path) -> dict[str, Any]:
    """Return all that a run found, apart from what is said of its inputs."""
    ran = program.merge(path, images="changed")
    report = ran.report
    del report["inputs"]
    for item in report["skipped_at"]:
        del item["input"]
    written = {topic: raw(ran.mcap, topic) for topic in ("/merged/map", "/tf", "/merged/images/r2/overlay")}
    return {"report": report, **written}


@pytest.fixture(scope="module")
def expected() -> dict[str, Any]:
    """What the first format gave."""
    return {}


@pytest.mark.parametrize("name", FORMATS)
def test_equal_results(replay: Program, tmp_path: Path, expected: dict[str, Any], name: str) -> None:
    (tmp_path / "in").mkdir()
    found = outcome(replay, FORMATS[name](tmp_path / "in"))
    assert found["report"]["robots"]["r2"]["status"] == "merged"
    assert found["report"]["skipped"] == {"bad_resolution": 1}
    assert len(found["/merged/map"]) > 3
    assert len(found["/merged/images/r2/overlay"]) > 1
    assert found == (expected or found)
    expected.update(found)


def test_mixed_formats(replay: Program, tmp_path: Path) -> None:
    bags.write_rosbag1(tmp_path / "a.bag", growing("r1", topic="/map"))
    bags.write_rosbag2(tmp_path / "b", growing("r2", 1.0, topic="/map"))
    bags.write_mcap(tmp_path / "c.mcap", growing("r3", 2.0, topic="/map"), "ros1")
    ran = replay.merge("a=a.bag", "b=b", "c=c.mcap")
    assert ran.statuses == {"a": "reference", "b": "merged", "c": "merged"}
    assert [(item["format"], item["robots"]) for item in ran.report["inputs"]] == [
        ("rosbag1", ["a"]),
        ("rosbag2", ["b"]),
        ("mcap", ["c"]),
    ]
    for name, robot in (("b", "r2"), ("c", "r3")):
        assert is_right(ran.robots[name]["merged_from_map"], reference_from(robot))


def test_repeats_itself_to_the_byte(replay: Program, two: Path) -> None:
    written = []
    for _ in range(2):
        ran = replay.merge(two, "--copy-maps", images="changed")
        written.append((ran.mcap.read_bytes(), ran.report_path.read_bytes()))
    assert written[0] == written[1]


def test_where_and_when_it_was_made_is_not_written(replay: Program, two: Path, tmp_path: Path) -> None:
    ran = replay.merge(two)
    for content in (ran.mcap.read_bytes(), ran.report_path.read_bytes()):
        assert str(tmp_path).encode() not in content
        assert str(two.parent).encode() not in content


class TestInputs:
    def test_what_is_said_of_them(self, replay: Program, two: Path) -> None:
        (found,) = replay.merge(two).report["inputs"]
        assert len(found.pop("sha256")) == 64
        assert found == {
            "name": "two.mcap",
            "format": "mcap",
            "size_bytes": two.stat().st_size,
            "said_of": None,
            "robots": ["r1", "r2"],
            "clocks": {"/r1/map": "header", "/r2/map": "header"},
            "offsets_ns": {"/r1/map": 0, "/r2/map": 0},
            "messages": 6,
            "until_ns": 1_700_000_022_000_000_000,
            "late": 0,
            "bad_stamps": 0,
            "transforms": {},
        }

    def test_the_digest_is_that_of_the_messages_used(self, replay: Program, tmp_path: Path) -> None:
        def digest(name: str, messages: list[bags.Recorded], *options: str) -> str:
            ran = replay.merge(bags.write_mcap(tmp_path / name, messages), "--robots", "r1", *options)
            return str(ran.report["inputs"][0]["sha256"])

        own = growing("r1")
        known = digest("1.mcap", own)
        assert digest("2.mcap", in_log_order(own, growing("r2"))) == known
        assert digest("3.mcap", [*own, seen("r1", 50.0)], "--stop", "40") == known
        assert digest("4.mcap", [*own, seen("r1", 50.0)]) != known


class TestSavedMaps:
    @staticmethod
    def save(path: Path, robot: str, **keys: Any) -> Path:
        known = flat_map(robot)
        pixels = np.select([known.cells == 0, known.cells == 100], [254, 0], 205).astype(np.uint8)
        pose = known.map_from_grid
        origin = [pose.x_m, pose.y_m, pose.yaw_rad]
        image = f"{path.stem}.pgm"
        return bags.write_saved_map(path, cv2.flip(pixels, 0), image, resolution=0.1, **{"origin": origin, **keys})

    def test_beside_a_recording(self, replay: Program, tmp_path: Path) -> None:
        run = bags.write_mcap(tmp_path / "run.mcap", growing("r1"))
        ran = replay.merge(run, f"old={self.save(tmp_path / 'map.yaml', 'r2')}", "--robots", "r1,old")
        assert ran.statuses == {"r1": "reference", "old": "merged"}
        assert is_right(ran.robots["old"]["merged_from_map"], reference_from("r2"))
        saved = ran.report["inputs"][1]
        assert (saved["format"], saved["clocks"], saved["messages"]) == ("map_server", {"/map": "none"}, 1)
        assert raw(ran.mcap, "/tf")[0][0] == at(0.0)

    def test_as_the_reference(self, replay: Program, tmp_path: Path) -> None:
        run = bags.write_mcap(tmp_path / "run.mcap", growing("r1"))
        ran = replay.merge(f"old={self.save(tmp_path / 'map.yaml', 'r2')}", run, "--robots", "old,r1")
        assert ran.statuses == {"old": "reference", "r1": "merged"}
        assert is_right(ran.robots["r1"]["merged_from_map"], reference_from("r1", "r2"))
        assert ran.report["stamp_ns"] == at(20.0)

    def test_alone(self, replay: Program, tmp_path: Path) -> None:
        runs = [f"{robot}={self.save(tmp_path / f'{robot}.yaml', robot)}" for robot in ("r1", "r2")]
        ran = replay.merge(*runs)
        assert ran.statuses == {"r1": "reference", "r2": "merged"}
        assert ran.report["stamp_ns"] == 0

    def test_a_robot_s_own_from_before(self, replay: Program, tmp_path: Path) -> None:
        run = bags.write_mcap(tmp_path / "run.mcap", growing("r1", topic="/map"))
        ran = replay.merge(f"r1={self.save(tmp_path / 'map.yaml', 'r2')}", f"r1={run}")
        assert ran.robots["r1"]["updates"] == 3  # it gives way to the first map of the same time
        assert ran.report["inputs"][0]["clocks"] == {"/map": "none"}
        assert raw(ran.mcap, "/tf")[0][0] == at(0.0)


def test_images_are_those_of_the_method(replay: Program, two: Path) -> None:
    ran = replay.merge(two, images="all")
    for step in ("orientation_spectra", "correlation_surface", "overlay"):
        found = raw(ran.mcap, f"/merged/images/r2/{step}")
        assert found
        for _, data in found:
            image: Any = ros2_typestore().deserialize_cdr(data, "sensor_msgs/msg/Image")
            assert image.encoding == "rgb8"
            assert 64 <= max(image.width, image.height) <= 1024
            assert len(image.data) == image.step * image.height == image.width * image.height * 3


def test_every_report_is_printed_alike(replay: Program, two: Path) -> None:
    """Text that is not ASCII stays readable."""
    text = replay.merge(two).report_path.read_text(encoding="utf-8")
    assert "m² overlap" in text
    assert json.loads(text)["robots"]["r2"]["reason"]["code"] == "accepted"
