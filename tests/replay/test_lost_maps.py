"""An update belongs to the full map before it: where that one may be lost, it is of no older one."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from replay.events import Skipped
from replay.feeds import Tally
from replay.open_plan import open_plan
from replay.options import RunOptions
from replay.runs import RunPath
from replay.skip_cause import SkipCause
from replay.sources import open_source
from replay.sources.lapses import AT_END, EARLIEST, LATEST, Lapse, Lapses, Written, lapse_of
from replay.timeline import Tick, ticks
from tests.bags import (
    SECOND,
    START,
    Recorded,
    chunks,
    damage,
    grid,
    recorded_map,
    recorded_update,
    write_bare_db3,
    write_mcap,
    write_rosbag1,
    write_split_rosbag2,
)

LOST_S = 10
"""The full map of this time is lost; what follows until the next one has nothing that it belongs to."""
LOST_ROWS = 65
"""So large that of a SQLite file it takes a page of its own."""


INDEX_BYTES = 31
"""Length of the index of a chunk of one message."""

Cells = npt.NDArray[np.int8]


def recorded(robots: int) -> list[Recorded]:
    """Return of each robot, in seconds: maps at 0, 10 and 30, and updates at 5, 20 and 40."""
    found = []
    for robot in (f"/r{number + 1}" for number in range(robots)):
        maps = [(0, 1, 40), (LOST_S, 2, LOST_ROWS), (30, 3, 45)]
        found += [recorded_map(f"{robot}/map", START + at * SECOND, seed, rows) for at, seed, rows in maps]
        found += [recorded_update(f"{robot}/map_updates", START + at * SECOND, at) for at in (5, 20, 40)]
    return sorted(found, key=lambda each: each.log_time_ns)


def bad_row(path: Path) -> Path:
    db3 = write_bare_db3(path / "run.db3", recorded(1))
    with sqlite3.connect(db3) as database:
        database.execute("UPDATE messages SET data = 'x' WHERE timestamp = ?", [START + LOST_S * SECOND])
    database.close()
    return db3


def bad_page(path: Path) -> Path:
    """Overwrite the beginning of the page on which the row of the map is, so that pages are read instead of rows."""
    db3 = write_bare_db3(path / "run.db3", recorded(1))
    data = bytearray(db3.read_bytes())
    page_bytes = int.from_bytes(data[16:18], "big")
    start = data.index(grid(2, LOST_ROWS).cells.tobytes()) // page_bytes * page_bytes
    data[start : start + 8] = bytes(8)
    db3.write_bytes(data)
    return db3


def bad_chunk(path: Path, robots: int = 1, chunk_bytes: int = 100) -> Path:
    mcap = write_mcap(path / "run.mcap", recorded(robots), chunk_bytes=chunk_bytes)
    with_maps = [chunk for chunk in chunks(mcap) if "/r1/map" in chunk.topics]
    damage(mcap, with_maps[1])
    return mcap


def cut_off(path: Path) -> Path:
    path.write_bytes(path.read_bytes()[:-60])
    return path


def bad_start_of_chunk(path: Path) -> Path:
    """Overwrite where the chunk begins as well, so that nothing says what is there."""
    mcap = bad_chunk(path)
    data = bytearray(mcap.read_bytes())
    start = [chunk for chunk in chunks(mcap) if "/r1/map" in chunk.topics][1].start
    data[start - 60 : start + 8] = bytes(68)
    mcap.write_bytes(data)
    return cut_off(mcap)


def doubtful_chunk(path: Path, missing_bytes: int) -> Path:
    """Take bytes from the end of a chunk without a checksum, which has what follows it in their place."""
    options: dict[str, Any] = {"compression": "none", "chunk_bytes": 100, "enable_crcs": False}
    mcap = write_mcap(path / "run.mcap", recorded(1), **options)
    chunk = [chunk for chunk in chunks(mcap) if "/r1/map" in chunk.topics][1]
    data, at = mcap.read_bytes(), chunk.start + chunk.size - 40
    mcap.write_bytes(data[:at] + data[at + missing_bytes :])
    return mcap


def bad_chunk_of_bag(path: Path, compression: str) -> Path:
    bag = write_rosbag1(path / "run.bag", recorded(1), compression, chunk_bytes=100)
    damage(bag, [chunk for chunk in chunks(bag) if "/r1/map" in chunk.topics][1])
    return bag


def undecodable(path: Path) -> Path:
    is_lost = START + LOST_S * SECOND
    messages = [replace(each, lost_bytes=9) if each.log_time_ns == is_lost else each for each in recorded(1)]
    return write_mcap(path / "run.mcap", messages)


def missing_part(path: Path, *, is_listed: bool = True, cut: str = "") -> Path:
    folder = write_split_rosbag2(path / "bag", recorded(1), "mcap")
    parts = sorted(folder.glob("*.mcap"), key=lambda part: int(part.stem.split("_")[1]))
    if cut == "end":
        parts[2].write_bytes(parts[2].read_bytes()[:-2500])
    elif cut == "all":
        parts[2].write_bytes(b"nothing")
    else:
        parts[2].unlink()
    if not is_listed:
        (folder / "metadata.yaml").unlink()
    return folder


DAMAGED: dict[str, Callable[[Path], Path]] = {
    "undecodable": undecodable,
    "row": bad_row,
    "page": bad_page,
    "chunk": bad_chunk,
    "chunk by a pass": lambda path: cut_off(bad_chunk(path)),
    "chunk of two robots": lambda path: bad_chunk(path, 2, 6500),
    "chunk of two robots by a pass": lambda path: cut_off(bad_chunk(path, 2, 6500)),
    "gap": bad_start_of_chunk,
    "doubtful end of a chunk": lambda path: doubtful_chunk(path, 4),
    "index in a chunk": lambda path: doubtful_chunk(path, INDEX_BYTES),
    "bz2": lambda path: bad_chunk_of_bag(path, "bz2"),
    "bz2 by a pass": lambda path: cut_off(bad_chunk_of_bag(path, "bz2")),
    "missing part": missing_part,
    "missing part by number": lambda path: missing_part(path, is_listed=False),
    "cut part": lambda path: missing_part(path, cut="end"),
    "useless part": lambda path: missing_part(path, cut="all"),
}


@pytest.mark.parametrize("start_s", [None, 15, 25])
@pytest.mark.parametrize("kind", DAMAGED)
def test_no_update_is_applied_to_a_map_before_one_that_is_lost(kind: str, start_s: int | None, tmp_path: Path) -> None:
    path = DAMAGED[kind](tmp_path)
    start_ns = None if start_s is None else START + start_s * SECOND
    with open_plan(RunOptions(runs=(RunPath(None, path),))) as plan:
        window = replace(plan.window, start_ns=start_ns)
        tallies = tuple(Tally() for _ in plan.feeds)
        items = list(ticks(plan.feeds, tallies, window, strict=False))
    robots = 2 if "two robots" in kind else 1
    found = [known for tick in items if isinstance(tick, Tick) for known in tick.grids.values()]
    # a chunk of two robots has the updates before the lost maps as well
    before = [cells(1), cells(1, 5)] if robots == 1 else [cells(1)]
    wanted = [*(before if start_s is None else before[-1:]), cells(3), cells(3, 40)]
    assert [each.cells.tolist() for each in found] == [each.tolist() for each in wanted for _ in range(robots)]
    causes = [item.cause for item in items if isinstance(item, Skipped)]
    assert causes.count(SkipCause.UPDATE_BEFORE_GRID) == (robots if start_s in {None, 15} else 0)


def cells(seed: int, *updates: int) -> Cells:
    """Return the cells of a map with those of updates."""
    found = grid(seed, {1: 40, 3: 45}[seed]).cells.copy()
    for each in updates:
        found[2:6, 3:8] = grid(each, 4, 5).cells
    return found


def test_of_a_file_that_lost_a_page_in_its_middle_only_maps_around_that_are_parted(tmp_path: Path) -> None:
    times_ns = [START + each * SECOND for each in range(8)]
    messages = [recorded_map("/r1/map", time_ns, seed, rows=400) for seed, time_ns in enumerate(times_ns)]
    whole = write_bare_db3(tmp_path / "whole.db3", messages).read_bytes()
    page_bytes = int.from_bytes(whole[16:18], "big")
    path = tmp_path / "run.db3"
    for lost in (2, 4, 5):
        within = messages[lost].fields["data"].tobytes()[12_000:12_300]
        at = whole.index(within) // page_bytes * page_bytes
        path.write_bytes(whole[:at] + whole[at + page_bytes :])
        with open_source(path) as source:
            found = [message.log_time_ns for message in source.messages(["/r1/map"])]
            parted = [(first, last) for first, last in pairwise(found) if source.losses.part("/r1/map", first, last)]
        assert found == [*times_ns[:lost], *times_ns[lost + 1 :]]
        assert parted == [(times_ns[lost - 1], times_ns[lost + 1])]


def test_what_is_lost_was_recorded_between_what_is_left() -> None:
    written = Written([((0, 0), 10), ((1, 0), 20), ((4, 0), 50), ((5, 0), 60)])
    lapse = written.between((2, 0), (3, 0))
    assert lapse.parts(20, 50)
    assert lapse.parts(10, 60)
    assert not lapse.parts(10, 20)
    assert not lapse.parts(50, 60)
    assert written.between((6, 0), (9, 0)) == AT_END
    assert written.between((-1, 0), (0, 0)) == Lapse(EARLIEST, 9)


def test_it_may_be_out_of_order_as_far_as_the_others_are() -> None:
    written = Written([((0, 0), 10), ((1, 0), 20), ((4, 0), 13), ((5, 0), 60)])
    lapse = written.between((2, 0), (3, 0))
    assert not lapse.parts(10, 12)
    assert lapse.parts(10, 14)
    assert lapse.parts(13, 20)
    assert not lapse.parts(21, 60)


def test_lapses_say_what_each_of_them_says() -> None:
    random = np.random.default_rng(5)
    for _ in range(200):
        pairs = random.integers(0, 30, (12, 2)).tolist()
        each = [Lapse(first, last) for first, last in pairs] + [Lapse(LATEST, LATEST)]
        lapses = Lapses()
        for lapse in each:
            lapses.add(lapse)
        for map_ns in range(-1, 31, 3):
            for update_ns in range(map_ns, 31, 3):
                assert lapses.part(map_ns, update_ns) == any(lapse.parts(map_ns, update_ns) for lapse in each)


def test_of_times_that_are_known_the_lapse_is_just_these() -> None:
    assert lapse_of([5, 3, 4]) == Lapse(3, 5)
    assert lapse_of([]) == AT_END
    assert Lapse(3, 9).within(Lapse(5)) == Lapse(5, 9)
