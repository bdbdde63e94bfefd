"""Images of cells that lie in the plane, as the Rerun library takes them."""

from __future__ import annotations

import math

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from mapmerge.sim2 import Sim2


def quaternion(yaw_rad: float) -> rr.Quaternion:
    """Return the turn about z."""
    return rr.Quaternion(xyzw=[0.0, 0.0, math.sin(yaw_rad / 2), math.cos(yaw_rad / 2)])


def grid_map(
    pixels: NDArray[np.uint8], cell_m: float, pose: Sim2, *, draw_order: float, height_m: float = 0.0
) -> rr.GridMap:
    """Return an image of cells.

    Parameters
    ----------
    pixels
        Shape (rows, columns) in shades, or (rows, columns, 4) in colours that are see-through; row 0 has the lowest y.
    cell_m
        Side of a cell.
    pose
        Where the outer corner of cell (0, 0) lies.
    draw_order
        Those with the higher one are drawn above.
    height_m
        How high they lie.
    """
    is_shades = pixels.ndim == 2
    return rr.GridMap(
        # Row 0 has the lowest y in a map, and is the top one in a picture.
        data=pixels[::-1].tobytes(),
        format=rr.components.ImageFormat(
            width=pixels.shape[1],
            height=pixels.shape[0],
            color_model="L" if is_shades else "RGBA",
            channel_datatype="U8",
        ),
        cell_size=cell_m,
        translation=[pose.x_m, pose.y_m, height_m],
        quaternion=quaternion(pose.yaw_rad),
        # The library mixes what is below in only where the whole is not quite opaque.
        opacity=None if is_shades else 0.995,
        draw_order=draw_order,
        colormap=rr.components.Colormap.Grayscale if is_shades else None,
    )
