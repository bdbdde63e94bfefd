"""What a map is said to need is not less than what it takes."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

from mapmerge.config import MergeConfig
from mapmerge.footprint import may_need_bytes, needed_bytes
from mapmerge.grid import Cells, Grid
from mapmerge.merger import Merger
from tests.floors import filled, flat

CONFIG = MergeConfig()
SIDE = 1200
PAGE_BYTES = 1 << 20


def rooms() -> Cells:
    cells = np.zeros((SIDE, SIDE), np.int8)
    cells[::80] = cells[:, ::80] = 100
    return cells


CELLS = {
    "rooms": rooms,
    "noise": lambda: np.random.default_rng(1).choice(np.array([-1, 0, 0, 0, 100], np.int8), (SIDE, SIDE)),
    "walls": lambda: np.full((SIDE, SIDE), 100, np.int8),
    "free": lambda: np.zeros((SIDE, SIDE), np.int8),
}


@pytest.mark.parametrize("resolution_m", [0.01, 0.05, 0.2])
@pytest.mark.parametrize("kind", CELLS)
def test_a_map_takes_no_more_than_it_is_said_to_need(kind: str, resolution_m: float) -> None:
    grid = Grid(CELLS[kind](), resolution_m)
    merger = Merger(["a", "b"], CONFIG)
    # what is too small to be searched, so that what is measured is what is kept of the map
    merger.step({"b": filled(0, 20, 20)})
    tracemalloc.start()
    merger.step({"a": grid})
    _, peak_bytes = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak_bytes <= needed_bytes(grid, CONFIG) + PAGE_BYTES
    # and it is not refused for what it could never take
    assert needed_bytes(grid, CONFIG) <= 12 * peak_bytes + 4 * PAGE_BYTES


@pytest.mark.parametrize("grid", [flat(), filled(100, 50, 70), filled(-1, 50, 70), filled(0, 9, 9, resolution_m=5.0)])
def test_what_it_may_need_is_told_without_looking(grid: Grid) -> None:
    assert needed_bytes(grid, CONFIG) <= may_need_bytes(grid, CONFIG)


def test_a_larger_map_needs_more() -> None:
    sizes = [may_need_bytes(filled(0, side, side), CONFIG) for side in (1, 10, 100, 1000)]
    assert sizes == sorted(set(sizes))
