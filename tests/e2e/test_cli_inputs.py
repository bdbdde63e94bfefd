"""Inputs stay as they are, to the byte, and nothing appears beside them."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from tests import bags
from tests.program import Program
from tests.runs import two_robots

WRITERS: dict[str, tuple[str, Callable[..., Path]]] = {
    "ROS 1 bag": ("run.bag", bags.write_rosbag1),
    "MCAP": ("run.mcap", bags.write_mcap),
    "MCAP without an index": ("run.mcap", partial(bags.write_mcap, **bags.NO_SUMMARY)),
    "db3": ("run.db3", bags.write_bare_db3),
    **{
        f"{storage} folder, {compression}": (
            "run",
            lambda path, messages, storage=storage, compression=compression: bags.write_rosbag2(
                path, messages, storage, compression=compression
            ),
        )
        for storage in ("sqlite3", "mcap")
        for compression in ("none", "file", "message")
    },
}


def state_of(folder: Path) -> dict[str, tuple[str, int]]:
    """Return what is in a folder and below it, with digests and times of change."""
    return {
        str(each.relative_to(folder)): (
            hashlib.sha256(each.read_bytes()).hexdigest() if each.is_file() else "",
            each.stat().st_mtime_ns,
        )
        for each in [folder, *folder.rglob("*")]
    }


@pytest.fixture
def inputs(tmp_path: Path) -> Path:
    (tmp_path / "inputs").mkdir()
    return tmp_path / "inputs"


@pytest.mark.parametrize("name", WRITERS)
def test_of_any_format(replay: Program, inputs: Path, name: str) -> None:
    file, write = WRITERS[name]
    run = write(inputs / file, two_robots())
    before = state_of(inputs)
    assert replay("info", run).status == 0
    assert replay.merge(run, "--jobs", 2).statuses == {"r1": "reference", "r2": "merged"}
    assert state_of(inputs) == before


def test_saved_maps(replay: Program, inputs: Path) -> None:
    run = bags.write_saved_map(inputs / "map.yaml", np.zeros((40, 50), np.uint8))
    before = state_of(inputs)
    assert replay("info", run).status == 0
    assert replay.merge(run).status == 0
    assert state_of(inputs) == before


@pytest.mark.parametrize("name", WRITERS)
def test_that_is_cut_off(replay: Program, inputs: Path, name: str) -> None:
    """Whether it can be read or not."""
    file, write = WRITERS[name]
    run = write(inputs / file, two_robots())
    largest = max((each for each in [run, *run.rglob("*")] if each.is_file()), key=lambda each: each.stat().st_size)
    os.truncate(largest, largest.stat().st_size * 2 // 3)
    before = state_of(inputs)
    assert replay("info", run).status in (0, 2)
    assert replay.merge(run).status in (0, 2)
    assert replay("recover", largest, "-o", "again.mcap").status in (0, 2)
    assert state_of(inputs) == before
