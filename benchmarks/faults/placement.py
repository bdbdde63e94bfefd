"""Where maps truly lie: told by their cells, because a damaged recording may give them another name or origin."""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from benchmarks.faults.world import FLOOR_FROM_MAP, PARTS_M, RESOLUTION_M, STRANGER, robot_map
from mapmerge.grid import Grid
from mapmerge.sim2 import Sim2, wrap_angle
from replay.events import Merged

MOST_M, MOST_DEG = 0.30, 3.0
"""Two cells: what may come of a map of which a part is damaged."""
_LEAST_ALIKE = 0.8
_LEAST_ALIKE_IN_PIECE, _LEAST_PIECE = 0.95, 0.25
_SHIFTS = 8


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
    """Whose map a grid shows, or a piece of it, and by how many columns and rows it is shifted."""

    robot: str
    shift: tuple[int, int] = (0, 0)


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
    return "" if off_m <= MOST_M and off_deg <= MOST_DEG else f"{off_m:.2f} m and {off_deg:.1f}° from where it lies"


def _shown(grid: Grid, name: str) -> list[_Shown]:
    """Return what a grid shows: told by its cells or, where they are like nobody's, by its name.

    Damage can move bytes, and so shift some of the cells of a map, or put cells of another robot's map there.
    Such a grid shows several things, and lies where any of them does.
    """
    alike = {robot: _alike(grid, robot) for robot in FLOOR_FROM_MAP}
    best = max(alike, key=lambda robot: alike[robot])
    if alike[best] >= _LEAST_ALIKE:
        return [_Shown(best)]
    known = name if name in FLOOR_FROM_MAP else best
    return [each for robot in FLOOR_FROM_MAP for each in _pieces(grid, robot)] or [_Shown(known)]


def _alike(grid: Grid, robot: str) -> float:
    """Return the largest share of cells that are the same in one of a robot's maps, of those known in either."""
    return max((_same(grid.cells, cells) for cells in _all_cells(robot) if cells.shape == grid.cells.shape), default=0)


@functools.cache
def _all_cells(robot: str) -> list[np.ndarray]:
    return [robot_map(robot, part).cells for part in range(len(PARTS_M))]


def _same(cells: np.ndarray, others: np.ndarray) -> float:
    known = (cells >= 0) | (others >= 0)
    return float(np.mean(cells[known] == others[known])) if known.any() else 0.0


def _pieces(grid: Grid, robot: str) -> Iterator[_Shown]:
    """Yield by how much pieces of a robot's map are shifted that a grid shows from one byte to another."""
    flat = grid.cells.reshape(-1)
    for cells in _all_cells(robot):
        if cells.shape != grid.cells.shape or not (flat >= 0).any():
            continue
        for by in _likely_shifts(flat, cells.reshape(-1)):
            moved = _moved(cells.reshape(-1), by)
            if _piece(flat, moved) >= _LEAST_PIECE:
                rows = round(by / grid.cols)
                yield _Shown(robot, (by - rows * grid.cols, rows))


def _piece(flat: np.ndarray, other: np.ndarray) -> float:
    """Return which share of the known cells is in the longest stretch in which both are nearly the same."""
    known = (flat >= 0) | (other >= 0)
    # The stretch with the largest sum is one in which at least the wanted share agrees.
    against = _LEAST_ALIKE_IN_PIECE / (1 - _LEAST_ALIKE_IN_PIECE)
    sums = np.concatenate([[0.0], np.cumsum(np.where(flat == other, 1.0, -against) * known)])
    gains = sums - np.minimum.accumulate(sums)
    end = int(np.argmax(gains))
    begin = int(np.argmin(sums[: end + 1]))
    return float(np.sum(flat[begin:end] >= 0) / np.sum(flat >= 0))


def _moved(flat: np.ndarray, by: int) -> np.ndarray:
    """Return cells moved along the bytes, with unknown ones where there are none."""
    moved = np.full_like(flat, -1)
    if by >= 0:
        moved[by:] = flat[: len(flat) - by]
    else:
        moved[:by] = flat[-by:]
    return moved


def _likely_shifts(flat: np.ndarray, other: np.ndarray) -> list[int]:
    """Return the shifts at which most known cells, or most walls, are the same, and none.

    Walls are narrow: of a piece of a map they tell by how much it is shifted, where free space says little.
    """
    walls = _correlated(flat == 100, other == 100)
    known = walls + _correlated(flat == 0, other == 0)
    best = (int(by) for same in (walls, known) for by in np.argsort(same, kind="stable")[-_SHIFTS:])
    return sorted({0, *(by - len(walls) if by >= len(flat) else by for by in best)})


def _correlated(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return for each shift how often both are so; shifts to the left are at the end."""
    size = 2 * len(one)
    spectrum = np.fft.rfft(one, size) * np.conj(np.fft.rfft(other, size))
    return np.round(np.fft.irfft(spectrum, size))
