"""Maps in the Rerun recording: what is shown is the map at each time, and where little changes little is logged."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
import rerun as rr

from mapmerge.config import CellConfig
from mapmerge.grid import Grid
from mapmerge.plane import Box
from mapmerge.resample import in_bands
from mapmerge.sim2 import Sim2
from replay.sinks import rerun_patches
from replay.sinks.rerun_entities import GROUND
from replay.sinks.rerun_lattice import Lattice
from replay.sinks.rerun_patches import MOST_PATCHES, PatchedMap, patch_for

SIDE = 600
CELL_M = 0.05
CORNER = Sim2(-3.0, 7.0, 0.3)
WALL, FLOOR = 170, 84


class Shown:
    """What a recording shows of one map now, what was logged last and how many cells were in all."""

    def __init__(self) -> None:
        self.images: dict[str, tuple[float, np.ndarray, float, Sim2]] = {}
        self.logged: list[str] = []
        self.cells = 0
        self.lattice = Lattice()
        self.map = PatchedMap(self, ["map"], CellConfig(), 1.0)  # type: ignore[arg-type]

    def log(self, path: Sequence[str], *content: Any) -> None:
        (item,) = content
        name = "/".join(path)
        self.logged.append(name)
        if isinstance(item, rr.Clear):
            self.images.pop(name, None)
            return
        form = item.format.as_arrow_array().to_pylist()[0]
        data = np.array(item.data.as_arrow_array().to_pylist()[0], np.uint8)
        (x_m, y_m, _), *_ = item.translation.as_arrow_array().to_pylist()
        _, _, z, w = item.quaternion.as_arrow_array().to_pylist()[0]
        self.images[name] = (
            item.draw_order.as_arrow_array().to_pylist()[0],
            data.reshape(form["height"], form["width"])[::-1],
            item.cell_size.as_arrow_array().to_pylist()[0],
            Sim2(x_m, y_m, 2 * np.arctan2(z, w)),
        )
        self.cells += data.size

    def show(self, grid: Grid) -> list[str]:
        self.logged = []
        self.map.show(self.lattice.take(grid))
        return self.logged

    def shades_on(self, grid: Grid) -> np.ndarray:
        """Return what is seen at the cells of a grid, and that nothing is seen beyond it but the ground."""
        margin = 20
        seen = np.full((grid.rows + 2 * margin, grid.cols + 2 * margin), GROUND[0], np.uint8)
        for _, image, cell_m, pose in sorted(self.images.values(), key=lambda each: each[0]):
            assert cell_m == pytest.approx(grid.resolution_m)
            own = grid.map_from_grid.inverse() @ pose
            assert own.yaw_rad == pytest.approx(0.0, abs=1e-6)
            col, row = round(own.x_m / cell_m) + margin, round(own.y_m / cell_m) + margin
            seen[row : row + image.shape[0], col : col + image.shape[1]] = image
        inner = seen[margin:-margin, margin:-margin].copy()
        seen[margin:-margin, margin:-margin] = GROUND[0]
        assert (seen == GROUND[0]).all()
        return inner


def shades(cells: np.ndarray) -> np.ndarray:
    return np.select([cells < 0, cells == 0], [GROUND[0], FLOOR], WALL).astype(np.uint8)


def noise(seed: int, shape: tuple[int, int] = (SIDE, SIDE)) -> np.ndarray:
    return np.random.default_rng(seed).choice(np.array([-1, 0, 100], np.int8), shape)


def at(cells: np.ndarray, top: int = 0, left: int = 0) -> Grid:
    """Return cells that begin at a place of the map's lattice."""
    return Grid(cells.copy(), CELL_M, CORNER @ Sim2(left * CELL_M, top * CELL_M))


def test_what_is_shown_is_the_map_at_each_time() -> None:
    """Robots change squares of it, it grows and shrinks at all sides, jumps to another lattice and is blank."""
    draw = np.random.default_rng(7)
    whole, shown = noise(1), Shown()
    box = [50, 60, 400, 420]
    for step in range(120):
        for _ in range(int(draw.integers(1, 4))):
            row, col = draw.integers(0, SIDE - 40, 2)
            whole[row : row + 40, col : col + 40] = noise(step, (40, 40))
        if step % 4 == 0:
            side, by = int(draw.integers(4)), int(draw.integers(-15, 16))
            box[side] = int(np.clip(box[side] + by, 0 if side < 2 else 350, 200 if side < 2 else SIDE))
        grid = at(whole[box[0] : box[2], box[1] : box[3]], box[0], box[1])
        if step % 40 == 39:
            grid = Grid(grid.cells, CELL_M, Sim2(0.01 * step, 0.02, 1.0))
        if step == 70:
            grid = at(np.zeros((0, 0), np.int8))
        shown.show(grid)
        assert len(shown.images) <= 1 + MOST_PATCHES
        if step == 70:
            assert shown.images == {}
        else:
            assert np.array_equal(shown.shades_on(grid), shades(grid.cells))


def test_of_a_map_that_changes_in_two_places_little_is_logged() -> None:
    whole, shown = np.zeros((SIDE, SIDE), np.int8), Shown()
    steps = 100
    for step in range(steps):
        row = 20 if step % 2 else 500
        whole[row : row + 30, 5 * step : 5 * step + 30] = 100
        shown.show(at(whole))
    assert shown.cells < 0.15 * steps * SIDE * SIDE


def test_a_change_is_a_patch_and_nothing_is_logged_of_a_map_that_says_the_same() -> None:
    whole, shown = noise(1), Shown()
    assert shown.show(at(whole)) == ["map"]
    assert shown.show(at(whole)) == []
    whole[100:120, 30:70] = 50
    assert shown.show(at(whole)) == ["map/changes/0"]
    assert shown.images["map/changes/0"][1].shape[0] <= 20
    assert shown.images["map/changes/0"][0] > shown.images["map"][0]
    whole[10:500, 10:500] = 50
    assert shown.show(at(whole)) == ["map/changes/0"]
    whole[10:500, 10:500] = 0
    assert shown.show(at(whole)) == ["map/changes/0", "map"], "in patches there would be more than in the whole"
    assert list(shown.images) == ["map"]


def test_small_maps_are_logged_as_a_whole() -> None:
    cells, shown = noise(1, (200, 200)), Shown()
    shown.show(at(cells))
    cells[5, 5] = 50
    assert shown.show(at(cells)) == ["map"]


def test_patches_of_maps_that_are_shown_coarser_are_as_coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rerun_patches, "MAX_SIDE_CELLS", 250)
    whole, shown = np.zeros((SIDE, SIDE), np.int8), Shown()
    for row, col in ((1, 1), (301, 100), (599, 599)):
        whole[row, col] = 100
        shown.show(at(whole))
        coarse = in_bands(at(whole), 3, CellConfig())
        assert np.array_equal(shown.shades_on(coarse), shades(coarse.cells))
    assert shown.logged == ["map/changes/1"]
    shown.show(at(whole[:400, :400]))
    assert shown.logged == ["map/changes/0", "map/changes/1", "map"], "it can be shown finer"


def test_patches_meet_no_others_and_there_are_few() -> None:
    a, b, c = Box(0, 0, 10, 10), Box(0, 20, 10, 30), Box(50, 50, 60, 60)
    assert patch_for(c, {}) == (c, set())
    assert patch_for(c, {0: a, 1: b}) == (c, set())
    assert patch_for(Box(5, 5, 15, 25), {0: a, 1: b, 2: c}) == (Box(0, 0, 15, 30), {0, 1})
    assert patch_for(Box(55, 62, 58, 64), {0: a, 1: b, 2: c}) == (Box(50, 50, 60, 64), {2})
