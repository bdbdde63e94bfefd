"""How well two maps' walls agree at a placement, to tell whether another one explains them as well as the truth."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmerge.grid import Grid
from mapmerge.sim2 import Points, Sim2
from samples.mission import known_at

MIN_OCCUPIED, MAX_FREE = 65, 25
_TOLERANCE_M = 0.15
_MOST_POINTS = 2000
_ALIKE = 0.97
_ALIKE_AREA = 0.7


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """A map, ready to be compared.

    Parameters
    ----------
    grid
        The map.
    wall_distance_m
        Shape (rows, columns): distance of each cell to the nearest wall.
    walls_m, known_m
        Some cells of its walls, and some of all that it knows, shape (N, 2), in the map frame.
    known_m2
        What one of ``known_m`` stands for.
    """

    grid: Grid
    wall_distance_m: NDArray[np.float32]
    walls_m: Points
    known_m: Points
    known_m2: float


def look(grid: Grid) -> Look:
    """Make a map ready to be compared."""
    free = (grid.cells < MIN_OCCUPIED).astype(np.uint8)
    known_m = thinned(grid.centres_m(grid.known), _MOST_POINTS)
    return Look(
        grid=grid,
        wall_distance_m=np.asarray(cv2.distanceTransform(free, cv2.DIST_L2, 5), np.float32) * grid.resolution_m,
        walls_m=thinned(grid.centres_m(grid.cells >= MIN_OCCUPIED), _MOST_POINTS),
        known_m=known_m,
        known_m2=grid.known_area_m2 / max(len(known_m), 1),
    )


def thinned(points: Points, most: int) -> Points:
    """Return evenly many of the points, about ``most`` at most."""
    return points[:: max(1, len(points) // most)]


def shared_m2(target: Look, source: Look, target_from_source: Sim2) -> float:
    """Return the area that both maps know, to within some per cent."""
    return int(np.count_nonzero(known_at(target.grid, target_from_source.apply(source.known_m)))) * source.known_m2


def agreement(target: Look, source: Look, target_from_source: Sim2) -> float:
    """Return the share of walls that agree, in the worse of both directions."""
    coarse_m = 1.5 * max(target.grid.resolution_m, source.grid.resolution_m)
    reach_m = max(_TOLERANCE_M, coarse_m)
    ahead = _met(target, target_from_source.apply(source.walls_m), reach_m)
    return min(ahead, _met(source, target_from_source.inverse().apply(target.walls_m), reach_m))


def _met(look_at: Look, walls_m: Points, reach_m: float) -> float:
    """Return the share of the walls that meet one of a map's, of those that it can judge."""
    grid = look_at.grid
    cells = np.floor(grid.map_from_grid.inverse().apply(walls_m) / grid.resolution_m).astype(np.intp)
    cells = cells[((cells >= 0) & (cells < (grid.cols, grid.rows))).all(axis=1)]
    met = look_at.wall_distance_m[cells[:, 1], cells[:, 0]] <= reach_m
    value = grid.cells[cells[:, 1], cells[:, 0]]
    judged = int(np.count_nonzero(met | ((value >= 0) & (value <= MAX_FREE))))
    return int(np.count_nonzero(met)) / judged if judged else 0.0


def explains_as_well(target: Look, source: Look, truth: Sim2, other: Sim2) -> bool:
    """Tell whether another placement explains two maps about as well as the true one.

    The area that both maps know must be at least 0.7 times as large, and the walls must agree at least 0.97 times as
    well, in the worse of both directions.
    """
    if shared_m2(target, source, other) < _ALIKE_AREA * shared_m2(target, source, truth):
        return False
    return agreement(target, source, other) >= _ALIKE * agreement(target, source, truth)
