"""Where maps truly lie: told by their cells, because a damaged recording may give them another name or origin."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from benchmarks.faults.pieces import alike, shifts
from benchmarks.faults.world import (
    FLOOR_FROM_MAP,
    ODD_BUILDINGS,
    PARTS_M,
    RESOLUTION_M,
    STRANGER,
    drawn_map,
    robot_map,
)
from mapmerge.grid import Grid
from mapmerge.sim2 import Sim2, wrap_angle
from replay.events import Merged

MOST_M, MOST_DEG = 0.30, 3.0
"""Two cells."""
MOST_OF_DAMAGED_M = 0.60
"""Of a map of which a part lies elsewhere than the rest: what fits both best may lie between them."""
_WHOLE = 0.99
_LEAST_ALIKE = 0.8


def misplaced(event: Merged, latest: Mapping[str, Grid]) -> list[str]:
    """Return which maps are placed where their cells do not lie, in words."""
    robots = event.result.robots
    reference = next(iter(robots))
    if reference not in latest:
        return []
    found = []
    for robot, outcome in robots.items():
        if robot == reference or outcome.merged_from_map is None or robot not in latest:
            continue
        error = error_of(reference, latest[reference], robot, latest[robot], outcome.merged_from_map)
        if error:
            found.append(f"{robot} is placed {error}")
    return found


def error_of(reference: str, target: Grid, robot: str, source: Grid, target_from_source: Sim2) -> str:
    """Return what is wrong with a placement; "" if nothing."""
    found = [
        _error(true_target, target, true_source, source, target_from_source)
        for true_target in _shown(target, reference)
        for true_source in _shown(source, robot)
    ]
    return "" if "" in found else found[0]


@dataclass(frozen=True, slots=True)
class _Shown:
    """Whose map a grid shows, or a piece of it, by how many columns and rows it is shifted, and whether that is all."""

    robot: str
    shift: tuple[int, int] = (0, 0)
    is_whole: bool = False


def _error(true_target: _Shown, target: Grid, true_source: _Shown, source: Grid, target_from_source: Sim2) -> str:
    if (true_target.robot == STRANGER) != (true_source.robot == STRANGER):
        return f"though its map is of {true_source.robot} and the reference's of {true_target.robot}"
    cell = np.array([[source.cols / 2, source.rows / 2]])
    found_m = target.map_from_grid.inverse().apply(
        target_from_source.apply(source.map_from_grid.apply(cell * source.resolution_m))
    )
    true = FLOOR_FROM_MAP[true_target.robot].inverse() @ FLOOR_FROM_MAP[true_source.robot]
    true_cell = true.apply((cell - true_source.shift) * RESOLUTION_M)[0] / RESOLUTION_M + true_target.shift
    # In cells, so that a resolution that is not the true one shows as well.
    off_m = float(np.hypot(*(found_m[0] / target.resolution_m - true_cell))) * RESOLUTION_M
    yaw_rad = target_from_source.yaw_rad + source.map_from_grid.yaw_rad - target.map_from_grid.yaw_rad
    off_deg = abs(math.degrees(wrap_angle(yaw_rad - true.yaw_rad)))
    most_m = MOST_M if true_target.is_whole and true_source.is_whole else MOST_OF_DAMAGED_M
    return "" if off_m <= most_m and off_deg <= MOST_DEG else f"{off_m:.2f} m and {off_deg:.1f}° from where it lies"


def _shown(grid: Grid, name: str) -> list[_Shown]:
    """Return what a grid shows: told by its cells or, where they are like nobody's, by its name.

    Damage can move bytes, and so shift some of the cells of a map, or put cells of another robot's map there.
    Such a grid shows several things, and lies where any of them does.
    """
    same = {robot: _alike(grid, robot) for robot in FLOOR_FROM_MAP}
    best = max(same, key=lambda robot: same[robot])
    if same[best] >= _LEAST_ALIKE:
        return [_Shown(best, is_whole=same[best] >= _WHOLE)]
    known = name if name in FLOOR_FROM_MAP else best
    return [each for robot in FLOOR_FROM_MAP for each in _pieces(grid, robot)] or [_Shown(known)]


def _alike(grid: Grid, robot: str) -> float:
    """Return the largest share of cells that are the same in one of a robot's maps, of those known in either."""
    odd = [] if robot == STRANGER else _odd_cells(robot)
    return max(alike(grid.cells, cells) for cells in (*_all_cells(robot), *odd))


@functools.cache
def _all_cells(robot: str) -> list[np.ndarray]:
    return [robot_map(robot, part).cells for part in range(len(PARTS_M))]


@functools.cache
def _odd_cells(robot: str) -> list[np.ndarray]:
    return [drawn_map(robot, len(PARTS_M) - 1, walls).cells for walls in ODD_BUILDINGS]


def _pieces(grid: Grid, robot: str) -> Iterator[_Shown]:
    """Yield what a grid shows of a robot's maps that is shifted."""
    for cells in _all_cells(robot):
        for shift in shifts(grid.cells, cells):
            yield _Shown(robot, shift)
