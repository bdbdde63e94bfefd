"""Images of cells that lie in the plane, as the Rerun library takes them."""

from __future__ import annotations

import math

import cv2
import numpy as np
import rerun as rr
from numpy.typing import NDArray

from mapmerge.grid import Grid
from mapmerge.sim2 import Sim2
from replay.sinks.rerun_entities import GROUND

Pixels = NDArray[np.uint8]

# Of cells that are free, as likely free as occupied, and occupied.
_FLOOR, _UNSURE, _WALL = 84, 50, 170


def _shades() -> Pixels:
    """Return the shade of each cell's byte: floors dim, walls light, what is not known as the ground behind the map."""
    percent = np.arange(101)
    shades = np.full(256, GROUND[0], np.uint8)
    shades[:101] = np.interp(percent, (0, 50, 100), (_FLOOR, _UNSURE, _WALL)).astype(np.uint8)
    return shades


_SHADES = _shades()


def quaternion(yaw_rad: float) -> rr.Quaternion:
    """Return the turn about z."""
    return rr.Quaternion(xyzw=[0.0, 0.0, math.sin(yaw_rad / 2), math.cos(yaw_rad / 2)])


def shades_of(grid: Grid) -> Pixels:
    """Return the shade of each cell: floors dim, walls light, what is not known as the ground behind the map."""
    return np.asarray(cv2.LUT(grid.cells.view(np.uint8), _SHADES), np.uint8)


def grid_map(pixels: Pixels, cell_m: float, pose: Sim2, *, draw_order: float) -> rr.GridMap:
    """Return an image of cells.

    Parameters
    ----------
    pixels
        Shape (rows, columns) in shades, or (rows, columns, 3) in colours; row 0 has the lowest y.
    cell_m
        Side of a cell.
    pose
        Where the outer corner of cell (0, 0) lies.
    draw_order
        Those with the higher one are drawn above.
    """
    is_shades = pixels.ndim == 2
    return rr.GridMap(
        # Row 0 has the lowest y in a map, and is the top one in a picture.
        data=pixels[::-1].tobytes(),
        format=rr.components.ImageFormat(
            width=pixels.shape[1],
            height=pixels.shape[0],
            color_model="L" if is_shades else "RGB",
            channel_datatype="U8",
        ),
        cell_size=cell_m,
        translation=[pose.x_m, pose.y_m, 0.0],
        quaternion=quaternion(pose.yaw_rad),
        draw_order=draw_order,
        colormap=rr.components.Colormap.Grayscale if is_shades else None,
    )
