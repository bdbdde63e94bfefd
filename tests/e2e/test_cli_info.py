"""`replay info` for programs: --json and --strict."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.bags import write_mcap
from tests.program import Program
from tests.runs import growing, in_log_order, seen, two_robots


@pytest.fixture
def run(tmp_path: Path) -> Path:
    return write_mcap(tmp_path / "run.mcap", two_robots())


def test_json_says_what_the_lines_say(replay: Program, run: Path) -> None:
    ran = replay("info", run, "--json")
    found = json.loads(ran.out)
    assert ran.status == 0
    (item,) = found["inputs"]
    assert (item["path"], item["format"], item["losses"]) == (str(run), "mcap", [])
    assert found["schema"] == "replay.info/1"
    assert found["robots"] == [
        {"robot": "r1", "map_topic": "/r1/map", "has_map": True},
        {"robot": "r2", "map_topic": "/r2/map", "has_map": True},
    ]
    assert found["problem"] is None
    assert item["topics"][0] == {
        "name": "/r1/map",
        "type": "nav_msgs/msg/OccupancyGrid",
        "messages": 3,
        "unusable": 0,
        "sizes_cells": [{"cols": 120, "rows": 100}],
        "resolutions_m": [0.1],
        "frames": ["map"],
        "header_times": True,
    }


def test_json_names_what_is_lost(replay: Program, run: Path) -> None:
    run.write_bytes(run.read_bytes()[: run.stat().st_size // 2])
    losses = json.loads(replay("info", run, "--json").out)["inputs"][0]["losses"]
    assert [loss["cause"] for loss in losses] == ["ends_early"]


def test_json_steers_no_terminal(replay: Program, tmp_path: Path) -> None:
    name = "/r1\x1b[31m/map"
    run = write_mcap(tmp_path / "run.mcap", [seen("r1", 0.0, topic=name)])
    said = replay("info", run, "--json").out
    assert "\x1b" not in said
    assert json.loads(said)["inputs"][0]["topics"][0]["name"] == name


def test_strict_is_content_with_what_is_whole(replay: Program, run: Path) -> None:
    assert replay("info", run, "--strict").status == 0


@pytest.mark.parametrize("flags", [(), ("--json",)])
def test_strict_tells_by_its_status_what_is_lost_or_not_merged(
    replay: Program, run: Path, tmp_path: Path, flags: tuple[str, ...]
) -> None:
    alone = write_mcap(tmp_path / "alone.mcap", growing("r1"))
    bad = write_mcap(tmp_path / "bad.mcap", in_log_order(two_robots(), [seen("r1", 9.0, resolution=0.0)]))
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(run.read_bytes()[: run.stat().st_size // 2])
    for path in (alone, bad, cut):
        assert replay("info", path, *flags).status == 0
        assert replay("info", path, "--strict", *flags).status == 1
    assert replay("info", run, "--robots", "r1,r9", "--strict", *flags).status == 1
    assert replay("info", tmp_path / "nothing.mcap", "--strict", *flags).status == 2
