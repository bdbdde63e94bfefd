"""Maps as nav2's ``map_saver`` writes and ``map_server`` loads them: a ``.yaml`` and an image.

Two things are done otherwise than by ``map_saver``, so that what is loaded is what was written:

- ``free_thresh`` is 0.196, as ROS 1 has it, and not 0.25: unknown cells are of grey 205, a darkness of 0.1961, and
  would be loaded as free. In the mode ``scale`` the thresholds are 0 and 1, so that percentages stay what they are.
- The origin is exact to a nanometre; ``map_saver`` rounds it to three digits, which are metres of a large site.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from mapmerge.grid import MAX_PERCENT, Cells, Grid
from replay.errors import OutputError
from replay.export.image import png
from replay.figures import exact
from replay.sources.map_server.map_image import Pixels

OCCUPIED_THRESH, FREE_THRESH = 0.65, 0.196
FROM_PERCENT, UP_TO_PERCENT = 65, 25
"""Cells from the first on are written as occupied, and up to the second as free, as ``map_saver`` has it."""
OCCUPIED, FREE, UNKNOWN = 0, 254, 205
_RAW_UNKNOWN = 255
_DIGITS = 9
_PLAIN_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]*")


def files(grid: Grid, stem: Path, mode: str) -> Mapping[Path, bytes]:
    """Return the image and the description of a map.

    Parameters
    ----------
    mode
        ``trinary``: occupied, free or unknown. ``scale``: percentages as shades of a PNG, unknown cells transparent.
        ``raw``: percentages as they are.
    """
    image = stem.with_name(f"{stem.name}.{'png' if mode == 'scale' else 'pgm'}")
    pixels = _PIXELS[mode](grid.cells[::-1])
    content = png(pixels) if mode == "scale" else _pgm(pixels, grid.resolution_m)
    return {image: content, stem.with_name(f"{stem.name}.yaml"): _description(grid, image.name, mode)}


def _trinary(cells: Cells) -> Pixels:
    pixels = np.full(cells.shape, UNKNOWN, np.uint8)
    pixels[(cells >= 0) & (cells <= UP_TO_PERCENT)] = FREE
    pixels[cells >= FROM_PERCENT] = OCCUPIED
    return pixels


def _scale(cells: Cells) -> Pixels:
    """Return shades and opacity, four channels: the server takes the mean of three."""
    known = cells >= 0
    shade = np.rint((MAX_PERCENT - np.maximum(cells, 0).astype(np.float64)) / MAX_PERCENT * 255.0).astype(np.uint8)
    shade = np.where(known, shade, np.uint8(128))
    return np.stack([shade, shade, shade, np.where(known, 255, 0).astype(np.uint8)], axis=-1)


def _raw(cells: Cells) -> Pixels:
    return np.where(cells >= 0, cells, _RAW_UNKNOWN).astype(np.uint8)


_PIXELS = {"trinary": _trinary, "scale": _scale, "raw": _raw}


def _pgm(pixels: Pixels, resolution_m: float) -> bytes:
    rows, cols = pixels.shape
    head = f"P5\n# CREATOR: replay {resolution_m:.3f} m/pix\n{cols} {rows}\n255\n"
    return head.encode() + pixels.tobytes()


def _description(grid: Grid, image: str, mode: str) -> bytes:
    pose = grid.map_from_grid
    occupied, free = (1.0, 0.0) if mode == "scale" else (OCCUPIED_THRESH, FREE_THRESH)
    try:
        return (
            f"image: {image if _PLAIN_NAME.fullmatch(image) else json.dumps(image, ensure_ascii=False)}\n"
            f"mode: {mode}\n"
            f"resolution: {exact(grid.resolution_m)}\n"
            f"origin: [{_number(pose.x_m)}, {_number(pose.y_m)}, {_number(pose.yaw_rad)}]\n"
            "negate: 0\n"
            f"occupied_thresh: {occupied}\n"
            f"free_thresh: {free}\n"
        ).encode()
    except UnicodeEncodeError as error:
        raise OutputError(f"{image}: a name that is not UTF-8 cannot stand in a .yaml; give another name") from error


def _number(value: float) -> str:
    """Return a number without the noise behind its digits, and without a negative zero."""
    return exact(round(value, _DIGITS) + 0.0)
