"""Pixels as files."""

from __future__ import annotations

import cv2
import numpy as np

from replay.errors import OutputError
from replay.sources.map_server.map_image import Pixels


def png(pixels: Pixels) -> bytes:
    """Return a PNG of pixels of shape (rows, columns) or (rows, columns, 3 or 4), in OpenCV's order of channels."""
    try:
        is_done, content = cv2.imencode(".png", pixels)
    except cv2.error as error:
        raise OutputError(f"the picture cannot be made: {' '.join(str(error).split())}") from error
    if not is_done:
        raise OutputError("the picture cannot be made")
    return np.asarray(content, np.uint8).tobytes()
