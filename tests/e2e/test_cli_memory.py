"""--max-memory: what would need more is refused, and says so; all else stays as it is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mapmerge.config import MergeConfig
from mapmerge.grid import Grid
from replay.errors import BadMessage
from replay.footprint import MemoryLimit
from tests.bags import write_bare_db3, write_mcap, write_rosbag1, write_rosbag2
from tests.outputs import maps
from tests.program import Program
from tests.runs import flat_map, in_log_order, seen, two_robots, updated


def huge(side: int = 1500) -> Grid:
    cells = np.zeros((side, side), np.int8)
    cells[::40] = 100
    return Grid(cells, 0.05)


@pytest.mark.parametrize("write", [write_mcap, write_rosbag1])
def test_a_map_that_needs_more_is_skipped_and_named(replay: Program, tmp_path: Path, write) -> None:
    messages = in_log_order(two_robots(), [seen("r2", 13.0, huge())])
    run = write(tmp_path / "run.bag", messages)
    ran = replay.merge(run, "--max-memory", "20MB")
    assert ran.status == 0, ran.err
    assert ran.report["skipped"] == {"over_memory": 1}
    assert ran.report["settings"]["max_memory_bytes"] == 20_000_000
    assert ran.statuses == {"r1": "reference", "r2": "merged"}
    assert "a map of 1500 × 1500 cells of 0.05 m needs about " in ran.err
    assert "; --max-memory allows 20.0 MB" in ran.err
    assert replay.merge(run, "--max-memory", "20MB", "--strict").status == 2
    assert "skipped" not in replay.merge(run, "--max-memory", "2GiB", "--stop", "12").err


def test_unknown_margins_do_not_count(replay: Program, tmp_path: Path) -> None:
    grid = flat_map("r1")
    padded = Grid(np.pad(grid.cells, 1500, constant_values=-1), grid.resolution_m)
    ran = replay.merge(write_mcap(tmp_path / "run.mcap", [seen("r1", 0.0, padded)]), "--max-memory", "20MB")
    assert ran.report["skipped"] == {}


@pytest.mark.parametrize("start", [(), ("--start", "1.5")])
def test_a_map_that_an_update_makes_need_more(replay: Program, tmp_path: Path, start: tuple[str, ...]) -> None:
    """Hardly anything is known of it at first."""
    cells = np.full((1500, 1500), -1, np.int8)
    room = flat_map("r1").cells
    cells[: room.shape[0], : room.shape[1]] = room
    messages = [
        seen("r1", 0.0, Grid(cells, flat_map("r1").resolution_m)),
        updated("r1", 1.0, 0, 0, huge().cells),
        updated("r1", 2.0, 0, 0, np.full((2, 2), 100, np.int8)),
    ]
    ran = replay.merge(write_mcap(tmp_path / "run.mcap", messages), "--max-memory", "20MB", *start)
    assert ran.status == 0, ran.err
    assert ran.report["skipped"] == ({} if start else {"over_memory": 1})
    assert maps(ran.mcap)[-1].grid.cells.size < 2 * room.size


def test_what_is_unknown_takes_its_bytes() -> None:
    limit = MemoryLimit(20_000_000, MergeConfig())
    limit.refuse_over(Grid(np.full((4000, 4000), -1, np.int8), 0.05))
    with pytest.raises(BadMessage, match=r"5000 × 5000 cells of .* needs about 25\.0 MB"):
        limit.refuse_over(Grid(np.full((5000, 5000), -1, np.int8), 0.05))


def test_an_update_of_a_map_that_was_not_taken_is_not_put_on_the_one_before(replay: Program, tmp_path: Path) -> None:
    part = np.full((2, 2), 100, np.int8)
    messages = [
        seen("r1", 0.0),
        seen("r1", 1.0, huge()),
        updated("r1", 2.0, 0, 0, part),
        seen("r1", 3.0, flat_map("r1", 7.0)),
        updated("r1", 4.0, 0, 0, part),
    ]
    ran = replay.merge(write_mcap(tmp_path / "run.mcap", messages), "--max-memory", "20MB")
    assert ran.report["skipped"] == {"over_memory": 1, "update_before_grid": 1}
    assert ran.robots["r1"]["updates"] == 3


@pytest.mark.parametrize(
    "write",
    [
        lambda path, messages: write_mcap(path, messages, compression="zstd", chunk_bytes=100_000),
        lambda path, messages: write_rosbag1(path, messages, "bz2", 100_000),
        lambda path, messages: write_rosbag2(path, messages, storage="mcap"),
        lambda path, messages: write_rosbag2(path, messages, compression="message"),
        lambda path, messages: write_rosbag2(path, messages, storage="mcap", compression="message"),
        write_bare_db3,
    ],
    ids=["mcap", "bag", "folder", "folder of messages", "folder of messages in chunks", "db3"],
)
def test_no_more_than_that_is_read_at_once(replay: Program, tmp_path: Path, write) -> None:
    """Its unknown margins do not count for the map, but it would have to be in memory to see that."""
    grid = flat_map("r2")
    padded = Grid(np.pad(grid.cells, 2500, constant_values=-1), grid.resolution_m)
    run = write(tmp_path / "run", in_log_order(two_robots(), [seen("r2", 13.0, padded)]))
    ran = replay.merge(run, "--max-memory", "20MB")
    assert ran.status == 0, ran.err
    ((cause, detail),) = [(each["cause"], each["detail"]) for each in ran.report["skipped_at"]]
    assert cause == "over_memory"
    assert detail.startswith("it has more than 20000000 bytes, the most that is read at once; a larger --max-memory")
    assert ran.statuses == {"r1": "reference", "r2": "merged"}
    assert replay.merge(run, "--max-memory", "200MB", "--force").report["skipped"] == {}


def test_info_reads_no_more_at_once_either(replay: Program, tmp_path: Path) -> None:
    run = write_mcap(tmp_path / "run.mcap", two_robots(), chunk_bytes=2_000_000)
    assert "over_memory" not in replay("info", run, "--max-memory", "9M").out
    large = Grid(np.zeros((2000, 2000), np.int8), 0.05)
    run = write_mcap(tmp_path / "large.mcap", [seen("r1", 0.0, large)])
    ran = replay("info", run, "--max-memory", "2M")
    assert "over_memory: it has more than 2000000 bytes" in ran.out
    assert "nothing would be merged: " in ran.out


@pytest.mark.parametrize("text", ["", "2", "-1GB", "1e9", "2 XB", "nan", "GiB", "1023KiB", "٣GB", "2GB 3"])
def test_what_is_no_size(replay: Program, tmp_path: Path, text: str) -> None:
    ran = replay.merge(write_mcap(tmp_path / "run.mcap", [seen("r1", 0.0)]), f"--max-memory={text}")
    assert ran.status == 2
    assert ran.error.startswith(f"--max-memory: {text!r} is ")
    assert "expected one such as 2GiB" in ran.error


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("2GiB", 2 << 30),
        ("500MB", 500_000_000),
        ("1.5 gb", 1_500_000_000),
        ("1048576", 1 << 20),
        ("2048kb", 2_048_000),
        ("200M", 200_000_000),
        ("3g", 3 * 10**9),
        ("0.5T", 5 * 10**11),
        ("2000 K", 2_000_000),
    ],
)
def test_sizes(text: str, expected: int) -> None:
    from replay.footprint import size_to_bytes

    assert size_to_bytes(text) == expected
