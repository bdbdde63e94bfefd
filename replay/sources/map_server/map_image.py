"""Pixels → cells, as ``nav2_map_server`` reads the image of a saved map."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mapmerge.grid import UNKNOWN, Cells

Pixels = NDArray[np.uint8]
Mode = Literal["trinary", "scale", "raw"]

# The server works on 16-bit intensities: 255 is 65535 there.
_SCALE = 257
_MAX = 65535
_ALPHA = 3
# Brightness takes many times the memory of a pixel.
_ROWS_AT_ONCE = 256


@dataclass(frozen=True, slots=True)
class Thresholds:
    """What is occupied and free, as fractions of darkness (of brightness, if ``negate``)."""

    occupied: float
    free: float
    negate: bool


def cells_from_pixels(pixels: Pixels, mode: Mode, thresholds: Thresholds) -> Cells:
    """Return the cells that an image stands for.

    Parameters
    ----------
    pixels
        Shape (rows, columns) or (rows, columns, 3 or 4), the top row first; the fourth channel is opacity.
    mode
        ``trinary``: occupied, free or unknown by the thresholds; opacity counts as one more channel of brightness.
        ``scale``: graded between the thresholds; whatever is not opaque is unknown.
        ``raw``: the brightness, 0 to 255, is the value of the cell; above 100 it is unknown.

    Returns
    -------
    Cells
        Shape (rows, columns), the lowest y first.
    """
    image = pixels.reshape(*pixels.shape[:2], -1)[::-1]
    cells = np.empty(image.shape[:2], np.int8)
    for row in range(0, len(cells), _ROWS_AT_ONCE):
        part = slice(row, row + _ROWS_AT_ONCE)
        cells[part] = _cells(image[part], mode, thresholds)
    return cells


def _cells(image: Pixels, mode: Mode, thresholds: Thresholds) -> Cells:
    """Return the cells of pixels of shape (rows, columns, channels), in the order of their rows."""
    colours = image if mode == "trinary" else image[..., :_ALPHA]
    shade = _shade(colours)
    if mode == "raw":
        value = np.rint(shade * 255.0)
        return np.where(value <= 100.0, value, UNKNOWN).astype(np.int8)
    darkness = shade if thresholds.negate else 1.0 - shade
    cells = _between(darkness, mode, thresholds)
    cells[darkness < thresholds.free] = 0
    cells[darkness > thresholds.occupied] = 100
    if mode == "scale" and image.shape[-1] > _ALPHA:
        cells[image[..., _ALPHA] != 255] = UNKNOWN
    return cells


def _shade(colours: Pixels) -> NDArray[np.float64]:
    """Return how bright each pixel is, 0 to 1: the mean of its channels, cut to the server's 16 bits."""
    total = colours.sum(axis=-1, dtype=np.uint32) * np.uint32(_SCALE)
    shade: NDArray[np.float64] = (total // np.uint32(colours.shape[-1])) / np.float64(_MAX)
    return shade


def _between(darkness: NDArray[np.float64], mode: Mode, thresholds: Thresholds) -> Cells:
    """Return the cells as they are if neither threshold decides."""
    span = thresholds.occupied - thresholds.free
    if mode == "trinary" or span <= 0.0:
        return np.full(darkness.shape, UNKNOWN, np.int8)
    return np.rint(np.clip((darkness - thresholds.free) / span, 0.0, 1.0) * 100.0).astype(np.int8)
