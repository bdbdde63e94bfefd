"""Pairs of recorded maps, cut by straight lines so that they overlap as little as wanted, and strangers."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cache
from itertools import permutations

import numpy as np

from benchmarks.data import data_folder
from mapmerge.grid import Grid
from mapmerge.sim2 import IDENTITY, Points, Sim2
from replay.evaluation.truth import load_truth
from replay.feeds import Tally
from replay.open_plan import open_plan
from replay.options import RunOptions
from replay.runs import RunPath
from replay.timeline import Tick, ticks
from samples.mission import known_at
from samples.pairs import Pair
from samples.world import Rng

FITTED = ("intel_two.mcap", "intel_res.mcap", "intel_noise.mcap", "intel_three.bag", "fr101_two", "fr101_half.mcap")
HELD_OUT = ("fhw_two.mcap",)
_HELD_OUT_SHARE = 0.25
_LEAST_AREA_M2, _LEAST_SHARED_M2 = 30.0, 8.0

Maps = dict[str, list[Grid]]


def cut_pairs(seed: int, count: int) -> Iterator[tuple[Pair, bool]]:
    """Yield pairs of maps of one place, and whether it is held out; none where the recordings are absent."""
    if data_folder() is None:
        return
    rng = np.random.default_rng([seed, 78])
    made = 0
    while made < count:
        held_out = bool(rng.uniform() < _HELD_OUT_SHARE)
        names = HELD_OUT if held_out else FITTED
        found = _cut_pair(names[int(rng.integers(len(names)))], rng)
        if found is not None:
            made += 1
            yield found, held_out


def cut_strangers(seed: int, count: int) -> Iterator[tuple[Pair, bool]]:
    """Yield pairs of maps of two buildings, and whether one of them is held out."""
    if data_folder() is None:
        return
    rng = np.random.default_rng([seed, 79])
    made = 0
    while made < count:
        held_out = bool(rng.uniform() < _HELD_OUT_SHARE)
        one = FITTED[int(rng.integers(len(FITTED)))]
        others = HELD_OUT if held_out else [name for name in FITTED if building(name) != building(one)]
        target = _one_cut(one, rng)
        source = _one_cut(others[int(rng.integers(len(others)))], rng)
        if min(target.known_area_m2, source.known_area_m2) >= _LEAST_AREA_M2:
            made += 1
            yield unrelated("strangers", "recorded", target, source), held_out


def unrelated(name: str, kind: str, target: Grid, source: Grid) -> Pair:
    """Return two maps of different buildings."""
    return Pair(name, kind, target, source, None, (0.0, 0.0), 0.0, 0.0, False, "other building")


def building(recording: str) -> str:
    """Return which building a recording is of."""
    return recording.partition("_")[0]


@cache
def recorded(name: str) -> tuple[Maps, dict[str, Sim2]]:
    """Return each robot's maps, in order of time, and where its map frame lies in the reference's."""
    folder = data_folder()
    if folder is None:
        raise FileNotFoundError("the recordings are absent")
    path = folder / "real" / name
    truths = load_truth(folder / "real" / f"{path.name.partition('.')[0]}.truth.json").robots
    maps: Maps = {}
    with open_plan(RunOptions(runs=(RunPath(None, path),))) as plan:
        reference = plan.robots[0].robot
        for tick in ticks(plan.feeds, tuple(Tally() for _ in plan.feeds), plan.window, strict=True):
            for robot, grid in tick.grids.items() if isinstance(tick, Tick) else ():
                maps.setdefault(robot, []).append(grid)
    places = {robot: truth.reference_from_map for robot, truth in truths.items() if truth.reference_from_map}
    return maps, {reference: IDENTITY, **places}


def _cut_pair(name: str, rng: Rng) -> Pair | None:
    maps, places = recorded(name)
    robots = list(permutations(sorted(places), 2))
    one, two = robots[int(rng.integers(len(robots)))]
    target, source = (_any_map(maps[robot], rng) for robot in (one, two))
    truth = places[one].inverse() @ places[two]
    direction = _direction(rng)
    known_m = target.centres_m(target.known) @ direction, truth.apply(source.centres_m(source.known)) @ direction
    highest_m = float(np.quantile(known_m[0], rng.uniform(0.3, 1.0)))
    lowest_m = float(np.quantile(known_m[1], rng.uniform(0.0, 0.7)))
    target = _cut(target, IDENTITY, direction, -math.inf, highest_m)
    source = _cut(source, truth, direction, lowest_m, math.inf)
    points_m = source.centres_m(source.known)
    shared = known_at(target, truth.apply(points_m))
    shared_m2 = int(shared.sum()) * source.resolution_m**2
    smaller_m2 = min(target.known_area_m2, source.known_area_m2)
    if shared_m2 < _LEAST_SHARED_M2 or smaller_m2 < _LEAST_AREA_M2:
        return None
    x_m, y_m = points_m[shared].mean(axis=0).tolist()
    title = f"{name} {one}-{two}"
    return Pair(title, "recorded", target, source, truth, (x_m, y_m), shared_m2 / smaller_m2, 0.0, False, "same place")


def _one_cut(name: str, rng: Rng) -> Grid:
    maps, places = recorded(name)
    robots = sorted(places)
    grid = _any_map(maps[robots[int(rng.integers(len(robots)))]], rng)
    direction = _direction(rng)
    highest_m = float(np.quantile(grid.centres_m(grid.known) @ direction, rng.uniform(0.3, 1.0)))
    return _cut(grid, IDENTITY, direction, -math.inf, highest_m)


def _any_map(grids: list[Grid], rng: Rng) -> Grid:
    """Return one of a robot's maps, but not the very first."""
    return grids[int(rng.integers(min(1, len(grids) - 1), len(grids)))]


def _direction(rng: Rng) -> Points:
    angle = float(rng.uniform(0.0, math.tau))
    return np.array([math.cos(angle), math.sin(angle)])


def _cut(grid: Grid, common_from_map: Sim2, direction: Points, lowest_m: float, highest_m: float) -> Grid:
    """Return the grid with only those cells known that lie between two lines of the common frame."""
    known = grid.known
    along_m = common_from_map.apply(grid.centres_m(known)) @ direction
    cells = grid.cells.copy()
    cells[known] = np.where((along_m >= lowest_m) & (along_m <= highest_m), cells[known], -1)
    return Grid(cells, grid.resolution_m, grid.map_from_grid)
