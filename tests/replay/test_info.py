from __future__ import annotations

from pathlib import Path

import pytest

from replay.errors import InputError
from replay.info import lines, summarise
from replay.options import RunOptions
from replay.runs import RunPath
from tests.bags import Recorded, write_mcap, write_rosbag1, write_saved_map
from tests.runs import bad_messages, flat_map, growing, in_log_order, seen, two_robots, updated


def said(*runs: str | Path) -> list[str]:
    return list(lines(summarise(RunOptions(tuple(RunPath.parse(str(run)) for run in runs)))))


def test_a_recording(tmp_path: Path) -> None:
    chatter = Recorded("/chatter", "std_msgs/msg/String", growing("r1")[0].log_time_ns, {"data": "x"})
    path = write_mcap(tmp_path / "run.mcap", [chatter, *two_robots()])
    head, r1, r2, plan = said(path)
    assert head == f"{path}: mcap, 22.0 s, 7 messages"
    assert r1.split() == [
        *("/r1/map", "nav_msgs/msg/OccupancyGrid", "3", "messages", "120", "×", "100", "0.1", "m"),
        *("frame", "map", "header", "times"),
    ]
    assert r2.startswith("  /r2/map")
    assert plan == "would be merged: r2 (/r2/map) into r1 (/r1/map), the reference"


def test_what_changes_and_what_cannot_be_used(tmp_path: Path) -> None:
    grown = flat_map("r1", resolution_m=0.05)
    messages = in_log_order(
        [seen("r1", 0.0, stamp_ns=0), seen("r1", 30.0, grown, stamp_ns=0)],
        list(bad_messages("r1", 5.0).values()),
        [updated("r1", 20.0, 0, 0, flat_map("r1").cells[:2, :3])],
    )
    _, row, updates, plan = said(write_rosbag1(tmp_path / "run.bag", messages))
    for part in ("8 messages (6 unusable)", "120 × 100 → 240 × 200", "0.05 m, 0.1 m", "frame map"):
        assert part in row
    assert "map_msgs/msg/OccupancyGridUpdate" in updates
    assert "1 message" in updates
    assert plan == "there is only one map, r1 (/r1/map): nothing to merge it with"


def test_log_times_and_no_frame(tmp_path: Path) -> None:
    _, row, _ = said(write_mcap(tmp_path / "run.mcap", growing("r1", stamp_ns=0, frame="")))
    assert row.endswith("no frame  log times only")


def test_several_recordings(tmp_path: Path) -> None:
    a = write_rosbag1(tmp_path / "a.bag", growing("r1", topic="/map"))
    pixels = flat_map("r2").cells.astype("uint8")
    b = write_saved_map(tmp_path / "map.yaml", pixels)
    found = said(f"a={a}", f"old={b}")
    assert found[0].startswith(f"{a}: rosbag1, 20.0 s")
    assert f"{b}: map_server, no clock, 1 message" in found
    assert found[-1] == "would be merged: old (/map) into a (/map), the reference"


def test_nothing_that_would_be_merged(tmp_path: Path) -> None:
    text = Recorded("/chatter", "std_msgs/msg/String", 5, {"data": "x"})
    found = said(write_mcap(tmp_path / "run.mcap", [text]))
    assert found[-1].startswith("nothing would be merged: ")
    assert "expected a topic of type nav_msgs/msg/OccupancyGrid" in found[-1]


def test_what_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(InputError):
        said(tmp_path / "nowhere.mcap")
