"""Which cells are within a distance of walls."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]


@dataclass(frozen=True, slots=True)
class Disc:
    """The cells within a distance of a cell, as OpenCV's distance transform with its mask of 5 × 5 measures it.

    To spread walls by a disc takes half the time of a distance transform, and tells the same.

    Parameters
    ----------
    radius
        How many cells it reaches along an axis.
    steps
        By how many cells to go on along the rows, and then along the columns, from its narrowest rows to its widest.
    """

    radius: int
    steps: tuple[tuple[int, int], ...]

    @staticmethod
    def of(distance_m: float, resolution_m: float) -> Disc:
        """Return the disc of a radius in metres."""
        most = int(distance_m / resolution_m) + 2
        corner = np.full((most + 1, most + 1), 255, np.uint8)
        corner[0, 0] = 0
        away_m = cv2.distanceTransform(corner, cv2.DIST_L2, cv2.DIST_MASK_5) * np.float32(resolution_m)
        widths = np.count_nonzero(away_m <= distance_m, axis=1)
        # of rows that are as wide as each other, those furthest from the middle: the disc is the union of these boxes
        rows = np.flatnonzero(widths[:-1] > widths[1:])
        across = -np.diff(widths[rows] - 1, append=0)
        down = np.diff(rows, prepend=0)
        return Disc(int(rows[-1]), tuple(zip(across[::-1].tolist(), down[::-1].tolist(), strict=True)))

    def spread(self, image: Image) -> Image:
        """Return the largest value within the disc around each cell."""
        wide = found = image
        for across, down in self.steps:
            wide = _dilated(wide, 0, across)
            found = _dilated(np.asarray(cv2.max(found, wide), np.uint8), down, 0)
        return found


def _dilated(image: Image, down: int, across: int) -> Image:
    if down == across == 0:
        return image
    return np.asarray(cv2.dilate(image, _box(2 * down + 1, 2 * across + 1)), np.uint8)


@cache
def _box(rows: int, cols: int) -> Image:
    return np.ones((rows, cols), np.uint8)
