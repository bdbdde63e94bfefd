"""What maps that come bit by bit lead to, however they come: what the same maps lead to at once."""

import functools
from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mapmerge.config import MergeConfig
from mapmerge.fuse import fuse
from mapmerge.grid import Grid
from mapmerge.merger import Merger
from mapmerge.sim2 import Sim2
from mapmerge.warp import Layer
from tests.floors import flat

CONFIG = MergeConfig()
ROBOTS = ("r1", "r2", "r3")
FLOOR_FROM_MAP = (Sim2(-1.0, -1.0), Sim2(10.2, 1.3, 2.2), Sim2(-0.6, 6.9, -0.8))
CELL_M = 0.05
SAME_M, SAME_RAD = 1e-6, 1e-6
NEAR_RAD = 0.01

FEWER = settings().max_examples // 3
FEWEST = settings().max_examples // 6


@functools.cache
def whole(number):
    """Return all that a robot will know of the flat, on a grid that holds nothing else."""
    return flat(FLOOR_FROM_MAP[number], ragged=number + 1, size_m=14.0).cropped_to_known()


def seen(number, low, high):
    """Return what a robot knows as long as these shares of its map, low and high along both axes, are not seen yet."""
    grid = whole(number)
    top, left, bottom, right = (round(share * 80) for share in (*low, *high))
    corner = Sim2(left * CELL_M, top * CELL_M)
    cells = grid.cells[top : grid.rows - bottom, left : grid.cols - right]
    return Grid(cells, CELL_M, grid.map_from_grid @ corner)


@st.composite
def missions(draw, robots):
    """Return maps by robot, step by step: each robot's map grows on all sides, by odd numbers of cells as well."""
    rng = np.random.default_rng(draw(st.integers(0, 10_000)))
    left = {}
    for number, robot in enumerate(ROBOTS[:robots]):
        shares = np.sort(rng.uniform(0.0, 0.45, (draw(st.integers(1, 5)), 4)), axis=0)[::-1]
        if rng.random() < 0.8:
            shares[-1] = 0.0
        left[robot] = [seen(number, row[:2], row[2:]) for row in shares]
    steps = []
    while left:
        chosen = [robot for robot in left if rng.random() < 0.5] or [next(iter(left))]
        steps.append({robot: left[robot].pop(0) for robot in chosen})
        left = {robot: maps for robot, maps in left.items() if maps}
    return steps


def at_once(steps, robots):
    """Return what comes of the latest maps alone."""
    latest = {robot: grid for step in steps for robot, grid in step.items()}
    return Merger(ROBOTS[:robots], CONFIG).step(latest, is_last=True)


def assert_same(result, expected, *, distance_m, angle_rad):
    for robot, outcome in result.robots.items():
        other = expected.robots[robot]
        assert (outcome.status, outcome.reason.code) == (other.status, other.reason.code)
        assert (outcome.merged_from_map is None) == (other.merged_from_map is None)
        if outcome.merged_from_map is not None:
            at_m = result.grids[robot].middle_m
            assert outcome.merged_from_map.is_close(
                other.merged_from_map, distance_m=distance_m, angle_rad=angle_rad, at_m=at_m
            )


@settings(max_examples=FEWER)
@given(missions(2))
def test_wherever_two_robots_are_searched_only_their_latest_maps_count(steps):
    merger = Merger(ROBOTS[:2], CONFIG)
    for number, step in enumerate(steps):
        result = merger.step(step, is_last=number == len(steps) - 1)
        if result.searched:
            expected = at_once(steps[: number + 1], 2)
            assert_same(result, expected, distance_m=SAME_M, angle_rad=SAME_RAD)
    assert_same(result, at_once(steps, 2), distance_m=SAME_M, angle_rad=SAME_RAD)


@settings(max_examples=FEWER)
@given(missions(3), st.booleans())
def test_the_last_maps_of_three_robots_have_the_outcome_that_they_have_at_once(steps, says_so):
    """Whether it is said with them that they are the last ones, or afterwards."""
    merger = Merger(ROBOTS, CONFIG)
    for step in steps[:-1]:
        merger.step(step)
    result = merger.step(steps[-1], is_last=says_so)
    if not says_so:
        result = merger.step({}, is_last=True)
    assert_same(result, at_once(steps, 3), distance_m=CELL_M, angle_rad=NEAR_RAD)


@settings(max_examples=FEWEST)
@given(missions(3))
def test_the_merged_map_is_what_is_fused_of_the_placed_maps_anew(steps):
    """Up to cells whose middles lie on borders of others' cells."""
    merger = Merger(ROBOTS, CONFIG)
    for step in steps:
        result = merger.step(step)
        poses = {robot: outcome.merged_from_map for robot, outcome in result.robots.items()}
        placed = [Layer(result.grids[robot], pose) for robot, pose in poses.items() if pose is not None]
        assert (result.merged is None) == (placed == [])
        if result.merged is None:
            continue
        anew = fuse(placed, result.grids["r1"], CONFIG.cells).grid
        assert result.merged.cells.shape == anew.cells.shape
        assert result.merged.map_from_grid.is_close(
            anew.map_from_grid, distance_m=1e-9, angle_rad=1e-9, at_m=(0.0, 0.0)
        )
        assert np.count_nonzero(result.merged.cells != anew.cells) <= anew.cells.size / 1000


@settings(max_examples=FEWEST)
@given(missions(3))
def test_the_order_of_the_robots_that_are_placed_does_not_matter(steps):
    latest = {robot: grid for step in steps for robot, grid in step.items()}
    first, second = (Merger(order, CONFIG).step(latest, is_last=True) for order in (ROBOTS, ("r1", "r3", "r2")))
    assert {robot: outcome.status for robot, outcome in second.robots.items()} == {
        robot: outcome.status for robot, outcome in first.robots.items()
    }
    for robot, outcome in first.robots.items():
        if outcome.merged_from_map is not None:
            assert second.robots[robot].merged_from_map.is_close(
                outcome.merged_from_map, distance_m=SAME_M, angle_rad=SAME_RAD, at_m=latest[robot].middle_m
            )


@settings(max_examples=FEWEST)
@given(missions(3))
def test_the_same_maps_have_the_same_results_and_leave_earlier_ones_as_they_were(steps):
    merger, kept = Merger(ROBOTS, CONFIG), []
    for step in steps:
        result = merger.step(step)
        cells = None if result.merged is None else result.merged.cells.copy()
        kept.append((result, dict(result.robots), dict(result.pairs), dict(result.searched), result.changes, cells))
    with ThreadPoolExecutor(2) as pool:
        again = Merger(ROBOTS, CONFIG, pool.map)
        repeats = [again.step(step) for step in steps]
    for repeated, (result, robots, pairs, searched, changes, cells) in zip(repeats, kept, strict=True):
        assert (result.robots, result.searched, result.changes) == (robots, searched, changes)
        assert list(result.pairs.items()) == list(pairs.items())
        assert (repeated.robots, repeated.searched, repeated.changes) == (robots, searched, changes)
        assert list(map(told, repeated.pairs.values())) == list(map(told, pairs.values()))
        assert (result.merged is None) == (repeated.merged is None) == (cells is None)
        if cells is not None:
            np.testing.assert_array_equal(result.merged.cells, cells)
            np.testing.assert_array_equal(repeated.merged.cells, cells)


def told(match):
    """Return all that a match says."""
    return [getattr(match, field.name) for field in fields(match)]
