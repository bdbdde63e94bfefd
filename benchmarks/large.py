"""Two robots' maps of one large floor, of about so many cells a side: what speed is measured on."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from mapmerge.grid import Grid
from samples.drive import follow, route, stops, survey, tour, window
from samples.explorers import published
from samples.floorplan import FloorStyle, office_floor
from samples.lidar import Lidar
from samples.mess import drawn_mess, robot_of
from samples.mission import explore
from samples.world import World

RESOLUTION_M = 0.05
_AREA_OF_A_STOP_M2 = 60.0
_PARTS = ((0.0, 0.65), (1.0, 0.35))
_HEADINGS_RAD = (0.4, 1.9)


def large_pair(side_cells: int, seed: int = 1) -> tuple[Grid, Grid]:
    """Return the maps of two robots that went to about two thirds of the places of a floor of offices each.

    Their grids are turned against the floor, and larger than it; each knows about half of it, of small floors less.

    Parameters
    ----------
    side_cells
        Length of the floor's sides, in cells of 0.05 m.
    seed
        Of the floor and the runs.
    """
    side_m = side_cells * RESOLUTION_M
    world = office_floor(seed, FloorStyle(width_m=side_m, height_m=side_m))
    one, other = (_map(world, number, seed) for number in range(2))
    return one, other


def _map(world: World, number: int, seed: int) -> Grid:
    rng = np.random.default_rng([seed, number, 51])
    mess = replace(drawn_mess(rng), warp_m=0.0, field_rad=math.tau, reach_m=12.0)
    robot = replace(robot_of(mess, RESOLUTION_M, rng), scan_every_m=0.8, lidar=Lidar(360, math.tau, 12.0, 0.01, 0.01))
    terrain = survey(world, cell_m=0.2)
    chosen = window(stops(world, terrain, _AREA_OF_A_STOP_M2), *_PARTS[number], 0.3)
    way = route(terrain, tour(world, chosen))
    run = explore(world, follow(way, _HEADINGS_RAD[number], robot.pace), robot, 1, rng)
    return published(run.snapshots[-1].grid, is_trinary=True)
