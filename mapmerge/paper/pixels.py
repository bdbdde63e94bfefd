"""Maps as the paper's pictures: classes as pixels, binarisation, closing, dilation.

Pictures have their row 0 at the lowest y, like the grids that they are made of.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmerge.config import CellConfig
from mapmerge.grid import Grid

Image = NDArray[np.uint8]

PIXEL_OCCUPIED, PIXEL_UNKNOWN, PIXEL_FREE = 0, 128, 255
_HALF = 128


def class_pixels(grid: Grid, config: CellConfig) -> Image:
    """Return the map as a picture of three values (equation 1): occupied 0, free 255, unknown 128."""
    pixels = np.full(grid.cells.shape, PIXEL_UNKNOWN, np.uint8)
    pixels[(grid.cells >= 0) & (grid.cells <= config.max_free_percent)] = PIXEL_FREE
    pixels[grid.cells >= config.min_occupied_percent] = PIXEL_OCCUPIED
    return pixels


def binarised(pixels: Image, threshold: float) -> Image:
    """Return what is darker than the threshold ``B_thres`` as 255, all else as 0 (equation 15)."""
    return np.where(pixels < threshold, 255, 0).astype(np.uint8)


def binarised_again(picture: Image) -> Image:
    """Return a turned binary picture, grey where pixels were interpolated, as a binary one."""
    return np.where(picture >= _HALF, 255, 0).astype(np.uint8)


def closed(binary: Image, side_px: int) -> Image:
    """Return the closing ``(M ⊕ S) ⊖ S`` with a square S (equation 17): gaps and dents are filled."""
    reach = side_px // 2
    square = np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)
    # room around the picture, so that walls at its border are eroded like any other
    grown = cv2.dilate(np.pad(binary, reach), square)
    shrunk = cv2.erode(grown, square)
    rows, cols = binary.shape
    return np.asarray(shrunk[reach : reach + rows, reach : reach + cols], np.uint8)


def is_thin(binary: Image, side_px: int) -> bool:
    """Tell whether most of what is occupied is narrower than so many pixels (an opening removes it)."""
    occupied = int(np.count_nonzero(binary))
    if occupied == 0 or side_px <= 1:
        return False
    opened = cv2.morphologyEx(binary, cv2.MORPH_OPEN, np.ones((side_px, side_px), np.uint8))
    return int(np.count_nonzero(opened)) < occupied / 2


def thickened(binary: Image, side_px: int) -> Image:
    """Return the picture dilated where its walls are too thin for SIFT (section 4.2.2), else as it is."""
    if not is_thin(binary, side_px):
        return binary
    reach = side_px // 2
    return np.asarray(cv2.dilate(binary, np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)), np.uint8)
