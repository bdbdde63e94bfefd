"""The floor itself as a map: what a robot that saw every reachable place without an error would have mapped."""

from __future__ import annotations

import cv2
import numpy as np

from mapmerge.grid import UNKNOWN, Grid
from mapmerge.sim2 import Sim2
from samples.world import World

_MARGIN_M = 1.0
_OCCUPIED = 100
_SUBPIXEL_BITS = 8


def true_map(world: World, world_from_map: Sim2, resolution_m: float = 0.05) -> Grid:
    """Return the true map in a robot's map frame.

    Cells that an edge of the world runs through are occupied; those that can be reached from the robot's start without
    crossing one are free; all others are unknown, such as rooms behind closed doors and what is inside of walls.

    Parameters
    ----------
    world_from_map
        Where the robot's map frame lies: it started at its origin.
    """
    extent = world.extent.grown(_MARGIN_M)
    cols, rows = (round(side_m / resolution_m) for side_m in (extent.width_m, extent.height_m))
    corner = np.array([extent.x0_m, extent.y0_m])
    walls = np.zeros((rows, cols), np.uint8)
    # OpenCV counts from the middles of pixels
    ends = (world.edges_m.reshape(-1, 2, 2) - corner) / resolution_m - 0.5
    for one, other in np.rint(ends * (1 << _SUBPIXEL_BITS)).astype(int).tolist():
        cv2.line(walls, one, other, 1, 1, cv2.LINE_8, _SUBPIXEL_BITS)
    _, parts = cv2.connectedComponents((walls == 0).astype(np.uint8), connectivity=4)
    col, row = np.floor((np.array([world_from_map.x_m, world_from_map.y_m]) - corner) / resolution_m).astype(int)
    cells = np.full((rows, cols), UNKNOWN, np.int8)
    cells[(parts == parts[row, col]) & (walls == 0)] = 0
    near = cv2.dilate((cells == 0).astype(np.uint8), np.ones((3, 3), np.uint8))
    cells[(walls == 1) & (near == 1)] = _OCCUPIED
    return Grid(cells, resolution_m, world_from_map.inverse() @ Sim2(extent.x0_m, extent.y0_m))
