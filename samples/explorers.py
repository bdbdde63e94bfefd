"""Several robots that map one site, each on a visit of its own."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mapmerge.grid import Grid
from mapmerge.sim2 import IDENTITY, Sim2
from samples.drive import follow, route, stops, survey, tour, window
from samples.mess import Mess, robot_of
from samples.mission import Run, explore
from samples.sites import Site, Visit, visited
from samples.world import Rng

_STOP_AREA_M2 = 22.0
_MOST_STOPS = 18
_PLANNING_CELL_M = 0.2
_MIN_OCCUPIED, _MAX_FREE = 65, 25


@dataclass(frozen=True, slots=True)
class Strip:
    """Which stops of a site a robot visits, see `samples.drive.window`."""

    lo: float
    hi: float
    direction_rad: float


@dataclass(frozen=True, slots=True, eq=False)
class MapOf:
    """A map that a robot published, and when: the truth is in the run up to then.

    Parameters
    ----------
    time_s
        After the run's start.
    grid
        As it was published.
    """

    time_s: float
    grid: Grid


@dataclass(frozen=True, slots=True, eq=False)
class Explored:
    """What came of one robot.

    Parameters
    ----------
    run
        What it did.
    maps
        What it published, the last at the end.
    published_from_map
        Where the run's map frame lies in that of the published maps.
    mess
        What they suffer from.
    """

    run: Run
    maps: tuple[MapOf, ...]
    published_from_map: Sim2
    mess: Mess


def explored(site: Site, number: int, strip: Strip, mess: Mess, resolution_m: float, maps: int, rng: Rng) -> Explored:
    """Return what one robot maps of a site.

    Parameters
    ----------
    site
        Where.
    number
        Tells its visit from those of others.
    strip
        Which part of the site it goes to.
    mess, resolution_m
        What its maps are like.
    maps
        How many it publishes.
    rng
        Source of chance.
    """
    visit = visited(site, mess.changes, number)
    robot = robot_of(mess, resolution_m, rng)
    run = explore(visit.world, follow(_way(visit, strip, rng), _any_heading(rng), robot.pace), robot, maps, rng)
    published_from_map = _drawn_frame(rng)
    shown = (
        MapOf(snapshot.time_s, published(snapshot.grid, published_from_map, is_trinary=mess.is_trinary))
        for snapshot in run.snapshots
    )
    return Explored(run, tuple(shown), published_from_map, mess)


def _way(visit: Visit, strip: Strip, rng: Rng) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """Return the way through a strip of the site: not to every stop, if there are many."""
    terrain = survey(visit.plan, cell_m=_PLANNING_CELL_M)
    everywhere = stops(visit.plan, terrain, _STOP_AREA_M2)
    chosen = window(everywhere, strip.lo, strip.hi, strip.direction_rad) or everywhere[:1]
    kept = np.sort(rng.choice(len(chosen), min(len(chosen), _MOST_STOPS), replace=False))
    return visit.bend.apply(route(terrain, tour(visit.plan, [chosen[index] for index in kept.tolist()])))


def _any_heading(rng: Rng) -> float:
    return float(rng.uniform(-math.pi, math.pi))


def _drawn_frame(rng: Rng) -> Sim2:
    """Return where a run's map frame lies in the published one: half of all robots do not begin at its origin."""
    x_m, y_m, yaw_rad = rng.uniform((-30.0, -30.0, -math.pi), (30.0, 30.0, math.pi)).tolist()
    return Sim2(x_m, y_m, yaw_rad) if rng.uniform() < 0.5 else IDENTITY


def published(grid: Grid, published_from_map: Sim2 = IDENTITY, *, is_trinary: bool) -> Grid:
    """Return a map as a robot publishes it: in a frame of its own; trinary: free, occupied or unknown, nothing else."""
    cells = grid.cells
    if is_trinary:
        unsure = np.where(cells >= _MIN_OCCUPIED, 100, -1)
        cells = np.where((cells >= 0) & (cells <= _MAX_FREE), 0, unsure).astype(np.int8)
    return Grid(cells, grid.resolution_m, published_from_map @ grid.map_from_grid)
