"""Maps that are kept up to date are what they would be if they were prepared anew."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mapmerge.config import MergeConfig, SearchConfig, VerifyConfig
from mapmerge.grid import Grid
from mapmerge.prepare import LiveMap
from mapmerge.prepared import PreparedMap
from mapmerge.sim2 import Sim2

SIDE = 90
CONFIGS = (
    MergeConfig(),
    MergeConfig(search=SearchConfig(wall_spacing_m=0.13)),
    MergeConfig(search=SearchConfig(wall_spacing_m=0.3), verify=VerifyConfig(near_m=2.5)),
)


def world(seed: int) -> np.ndarray:
    """Return cells with walls, free space, unsure cells and unknown ones."""
    rng = np.random.default_rng(seed)
    cells = np.full((SIDE, SIDE), -1, np.int8)
    for _ in range(6):
        top, left, rows, cols = rng.integers(0, SIDE - 8), rng.integers(0, SIDE - 8), *rng.integers(4, 40, 2)
        cells[top : top + rows, left : left + cols] = rng.choice([0, 10, 50])
    for _ in range(8):
        row, col, length = (int(value) for value in rng.integers((0, 0, 1), (SIDE, SIDE, 50)))
        if rng.random() < 0.5:
            cells[row : row + int(rng.integers(1, 4)), col : col + length] = 100
        else:
            cells[row : row + length, col : col + int(rng.integers(1, 4))] = 100
    return cells


def same(one: PreparedMap, other: PreparedMap) -> None:
    for name in ("classes", "meets", "wall_cells_m", "walls_m", "directions", "free_m"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)
    assert one.known_area_m2 == other.known_area_m2
    assert (one.margin, one.extent_m, one.grid.map_from_grid) == (
        other.margin,
        other.extent_m,
        other.grid.map_from_grid,
    )
    rng = np.random.default_rng(0)
    x_m, y_m = rng.uniform(-2.0, 2.0 + max(one.extent_m), (2, 4000)).astype(np.float32)
    walls, others = one.nearest.wall_at(x_m, y_m), other.nearest.wall_at(x_m, y_m)
    np.testing.assert_array_equal(one.nearest.x_m[walls], other.nearest.x_m[others])
    np.testing.assert_array_equal(one.nearest.y_m[walls], other.nearest.y_m[others])
    np.testing.assert_array_equal(one.nearest.directions[walls], other.nearest.directions[others])


windows = st.tuples(*[st.integers(0, SIDE)] * 4).map(
    lambda sides: (min(sides[:2]), min(sides[2:]), max(sides[:2]), max(sides[2:]))
)


@given(
    seeds=st.lists(st.integers(0, 40), min_size=1, max_size=3),
    seen=st.lists(st.tuples(windows, windows, st.integers(0, 2)), min_size=1, max_size=5),
    config=st.sampled_from(CONFIGS),
    resolution_m=st.sampled_from([0.05, 0.08, 0.2]),
    yaw_rad=st.sampled_from([0.0, 0.7]),
)
def test_a_map_that_grows_and_changes_is_the_map_prepared_anew(seeds, seen, config, resolution_m, yaw_rad):
    """A window of a world becomes known or is forgotten, and is seen through another window, the message's extent."""
    shown = np.full((SIDE, SIDE), -1, np.int8)
    live = LiveMap(resolution_m, config)
    for number, ((top, left, bottom, right), extent, kind) in enumerate(seen):
        if kind:
            shown[top:bottom, left:right] = world(seeds[number % len(seeds)])[top:bottom, left:right]
        else:
            shown[top:bottom, left:right] = -1
        corner = Sim2(yaw_rad=yaw_rad) @ Sim2(extent[1] * resolution_m, extent[0] * resolution_m)
        grid = Grid(shown[extent[0] : extent[2], extent[1] : extent[3]].copy(), resolution_m, Sim2(3.0, -1.0) @ corner)
        kept = live.update(grid)
        renewed = live.renewed() or kept
        same(renewed, LiveMap(resolution_m, config).update(grid))


@given(seed=st.integers(0, 1000), steps=st.integers(1, 4))
def test_what_is_kept_up_to_date_equals_what_is_prepared_at_once(seed, steps):
    """Without being renewed, a map that keeps its corner is the same to the bit."""
    rng = np.random.default_rng(seed)
    cells = world(seed)
    cells[0, 0] = cells[-1, -1] = 0
    live = LiveMap(0.05, MergeConfig())
    live.update(Grid(cells.copy(), 0.05))
    for step in range(steps):
        top, left = rng.integers(0, SIDE - 20, 2).tolist()
        cells[top : top + 15, left : left + 19] = world(seed + step + 1)[top : top + 15, left : left + 19]
        cells[0, 0] = cells[-1, -1] = 0
        grid = Grid(cells.copy(), 0.05)
        same(live.update(grid), LiveMap(0.05, MergeConfig()).update(grid))


@pytest.mark.parametrize("moved", [Sim2(0.02, 0.0), Sim2(yaw_rad=0.01)])
def test_a_map_on_other_cells_is_prepared_anew(moved):
    live = LiveMap(0.05, MergeConfig())
    live.update(Grid(world(1), 0.05))
    grid = Grid(world(2), 0.05, moved)
    same(live.update(grid), LiveMap(0.05, MergeConfig()).update(grid))


@pytest.mark.parametrize("config", CONFIGS)
def test_free_space_alone_changes(config):
    cells = world(3)
    cells[0, 0] = cells[-1, -1] = 0
    opened, closed = cells.copy(), cells.copy()
    opened[20:60, 10:70][cells[20:60, 10:70] < 0] = 0
    closed[5:80, 5:80][cells[5:80, 5:80] == 0] = 50
    live = LiveMap(0.05, config)
    for shown in (cells, opened, closed, cells):
        grid = Grid(shown.copy(), 0.05)
        same(live.update(grid), LiveMap(0.05, config).update(grid))


def test_all_walls_vanish_and_come_back():
    cells = world(5)
    cells[0, 0] = cells[-1, -1] = 0
    live = LiveMap(0.05, MergeConfig())
    for shown in (cells, np.where(cells == 100, 0, cells), cells, np.where(cells == 100, -1, cells)):
        shown[0, 0] = shown[-1, -1] = 0
        grid = Grid(shown.astype(np.int8), 0.05)
        same(live.update(grid), LiveMap(0.05, MergeConfig()).update(grid))


@pytest.mark.parametrize("config", CONFIGS)
@pytest.mark.parametrize("step", [(0, -30), (-30, 0), (-30, -60), (30, 60), (-10, 20)])
def test_a_map_grows_to_the_left_or_the_top(config, step):
    """By whole squares of the first settings, so that nothing is renewed; those of the others are no whole cells."""
    live, cells = LiveMap(0.05, config), world(7)
    cells[cells < 0] = 0
    for top, left in ((60, 60), (60 + min(step[0], 0), 60 + min(step[1], 0)), (60 + step[0], 60 + step[1])):
        shown = np.tile(cells, (3, 3))[top : top + 100, left : left + 110].copy()
        grid = Grid(shown, 0.05, Sim2(left * 0.05, top * 0.05))
        kept, renewed = live.update(grid), live.renewed()
        assert config is not CONFIGS[0] or renewed is None
        same(renewed or kept, LiveMap(0.05, config).update(grid))
