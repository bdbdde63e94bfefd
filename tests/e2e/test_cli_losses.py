"""What is said of recordings of which something is lost: which file, what to do, and how much is not listed."""

from __future__ import annotations

import os
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from replay.sources.zstd import zstd
from tests import bags
from tests.program import Program
from tests.runs import seen, two_robots


@pytest.mark.parametrize("storage", ["sqlite3", "mcap"])
def test_a_part_that_ends_early_is_named_as_what_ends_early(replay: Program, tmp_path: Path, storage) -> None:
    """That the file ends would read as if all were there up to the end, and others follow it."""
    run = bags.write_split_rosbag2(tmp_path / "run", two_robots(), storage)
    (part,) = run.glob("run_6.*")
    os.truncate(part, part.stat().st_size // 2)
    ran = replay.merge(run)
    assert ran.status == 0
    (line,) = (each for each in ran.err.splitlines() if each.startswith("run: recovered "))
    assert line.endswith(f" UTC; {part.name} ends early")


def test_several_parts_that_end_early_are_named(replay: Program, tmp_path: Path) -> None:
    run = bags.write_split_rosbag2(tmp_path / "run", two_robots())
    for name in ("run_6.db3", "run_8.db3"):
        os.truncate(run / name, (run / name).stat().st_size // 2)
    assert " UTC; run_6.db3, run_8.db3 end early\n" in replay.merge(run).err


def test_what_a_run_left_is_to_be_finished(replay: Program, two: Path, tmp_path: Path) -> None:
    """There is no other copy of it."""
    shutil.copy(two, tmp_path / "left.mcap.partial")
    os.truncate("left.mcap.partial", two.stat().st_size // 2)
    for ran in (replay.merge("left.mcap.partial"), replay("info", "left.mcap.partial")):
        (line,) = (each for each in ran.err.splitlines() + ran.out.splitlines() if ": ends_early: " in each)
        assert "`replay recover left.mcap.partial`" in line
        assert "copy it again" not in line


@pytest.mark.parametrize("write", [bags.write_mcap, bags.write_rosbag1, bags.write_bare_db3])
@pytest.mark.parametrize("is_compressed", [False, True])
def test_what_was_cut_off_is_to_be_copied_again(replay: Program, tmp_path: Path, write, is_compressed: bool) -> None:
    run = write(tmp_path / "run", [*two_robots(), *(each for each in bags.SAMPLE if each.topic == "/chatter")])
    data = run.read_bytes()
    if is_compressed:
        data = b"".join(zstd.compress(data[at : at + 500]) for at in range(0, len(data), 500))
    run.write_bytes(data[: len(data) // 2])
    lines = [each for each in replay("info", run).out.splitlines() if ": ends_early: " in each]
    assert lines
    assert all(each.endswith("copy it again if there is a whole one") for each in lines)


def test_a_bag_that_was_never_whole_is_not(replay: Program, tmp_path: Path) -> None:
    run = bags.write_rosbag1(tmp_path / "run.bag.active", two_robots())
    data = bytearray(run.read_bytes())
    at = data.index(b"index_pos=") + len(b"index_pos=")
    data[at : at + 8] = bytes(8)
    run.write_bytes(data)
    (line,) = (each for each in replay("info", run).out.splitlines() if ": ends_early: " in each)
    assert line.endswith("its recording was not ended properly")


def test_how_many_losses_are_not_listed(replay: Program, tmp_path: Path) -> None:
    odd = [replace(seen("r1", 0.1 * number), lost_bytes=9) for number in range(9)]
    lines = replay.merge(bags.write_mcap(tmp_path / "run.mcap", [*two_robots(), *odd])).err.splitlines()
    assert sum(": undecodable: " in each for each in lines) == 5
    assert "and 4 more of undecodable: the report lists them under skipped_at" in lines
    assert "9 messages skipped: 9 undecodable" in lines


def test_a_number_that_cannot_be_told_is_the_least_that_it_may_be(replay: Program, tmp_path: Path) -> None:
    run = bags.write_rosbag1(tmp_path / "run.bag", two_robots())
    os.truncate(run, run.stat().st_size // 2)
    assert "at least 1 message skipped: at least 1 ends_early" in replay.merge(run).err.splitlines()
