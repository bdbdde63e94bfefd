"""Walls in the Rerun recording: at each time those of the map, and only tiles in which they changed are logged."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
import rerun as rr

from mapmerge.config import CellConfig
from mapmerge.grid import Grid
from mapmerge.sim2 import Sim2
from replay.sinks.rerun_entities import RobotEntities
from replay.sinks.rerun_lattice import Lattice
from replay.sinks.rerun_walls import POINTS_ACROSS, TILE_POINTS, WallScene

SIDE = 3 * TILE_POINTS
CELL_M = 0.05
CORNER = Sim2(-3.0, 7.0, 0.3)


class Shown:
    """What a recording shows of one robot's walls now, and which entities were logged last."""

    def __init__(self) -> None:
        self.points_m: dict[str, np.ndarray] = {}
        self.logged: list[str] = []
        self.lattice = Lattice()
        self.scene = WallScene(self, RobotEntities("r1", 0), CellConfig())  # type: ignore[arg-type]

    def log(self, path: Sequence[str], *content: Any) -> None:
        (item,) = content
        name = "/".join(path)
        self.logged.append(name)
        if isinstance(item, rr.Clear):
            del self.points_m[name]
        else:
            self.points_m[name] = np.array(item.positions.as_arrow_array().to_pylist())

    def show(self, grid: Grid) -> list[str]:
        self.logged.clear()
        self.scene.show(self.lattice.take(grid))
        return self.logged

    @property
    def all_m(self) -> np.ndarray:
        points_m = np.concatenate([np.zeros((0, 3)), *self.points_m.values()])[:, :2]
        return points_m[np.lexsort(points_m.T)]


def expected_m(grid: Grid) -> np.ndarray:
    points_m = grid.centres_m(grid.cells >= 65)
    return points_m[np.lexsort(points_m.T)]


def cells(seed: int, shape: tuple[int, int] = (SIDE, SIDE)) -> np.ndarray:
    return np.where(np.random.default_rng(seed).random(shape) < 0.01, 100, 0).astype(np.int8)


def part(whole: np.ndarray, top: int, left: int, bottom: int, right: int) -> Grid:
    """Return a part of a map on the map's lattice."""
    return Grid(whole[top:bottom, left:right].copy(), CELL_M, CORNER @ Sim2(left * CELL_M, top * CELL_M))


def test_at_each_time_they_are_those_of_the_map() -> None:
    whole, other = cells(1), cells(2)
    shown = Shown()
    for grid in (
        part(whole, 100, 200, 400, 500),
        part(whole, 50, 200, 400, 700),
        part(whole, 0, 0, SIDE, SIDE),
        part(whole, 300, 300, 500, 500),
        part(whole, 300, 300, 300, 300),
        part(other, 10, 20, 500, 600),
        Grid(other, CELL_M, Sim2(0.01, 0.02, 1.0)),
        Grid(whole, 0.1, CORNER),
    ):
        shown.show(grid)
        found_m, known_m = shown.all_m, expected_m(grid)
        assert len(found_m) == len(known_m)
        assert all(np.hypot(*(known_m - point_m).T).min() < 1e-4 for point_m in found_m)


def test_only_tiles_that_changed_are_logged() -> None:
    whole = cells(1)
    shown = Shown()
    assert len(shown.show(part(whole, 0, 0, SIDE, SIDE))) == 9
    assert shown.show(part(whole, 0, 0, SIDE, SIDE)) == []
    changed = whole.copy()
    changed[TILE_POINTS + 3, 5] = 100 - changed[TILE_POINTS + 3, 5]
    assert shown.show(part(changed, 0, 0, SIDE, SIDE)) == ["merged/robots/r1/walls/1_0"]
    free = np.where(changed == 0, 10, changed).astype(np.int8)
    assert shown.show(part(free, 0, 0, SIDE, SIDE)) == []


def test_a_tile_without_walls_is_cleared_once() -> None:
    whole = np.zeros((SIDE, SIDE), np.int8)
    one = whole.copy()
    one[5, 6] = 100
    shown = Shown()
    assert shown.show(Grid(whole, CELL_M)) == []
    assert shown.show(Grid(one, CELL_M)) == shown.show(Grid(whole, CELL_M)) == ["merged/robots/r1/walls/0_0"]
    assert shown.points_m == {}
    assert shown.show(Grid(whole, CELL_M)) == []


@pytest.mark.parametrize(("side", "most"), [(POINTS_ACROSS, 1), (2 * POINTS_ACROSS, 2), (5 * POINTS_ACROSS, 5)])
def test_those_of_large_maps_are_thinned(side: int, most: int) -> None:
    row = np.zeros((10, side), np.int8)
    row[4] = 100
    shown = Shown()
    shown.show(Grid(row, CELL_M))
    assert len(shown.all_m) == side // most
    assert shown.all_m[:, 1] == pytest.approx(4.5 * CELL_M)
