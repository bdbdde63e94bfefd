"""Plain OpenCV recipes for merging maps: features, ratio test, RANSAC. There is no test whether the result is right.

SIFT with a ratio test is the paper's reference 12; ORB is what most programs use today.
"""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.methods import Placed
from mapmerge.config import CellConfig
from mapmerge.grid import Grid
from mapmerge.resample import at_resolution
from mapmerge.sim2 import Sim2

Image = NDArray[np.uint8]

_RATIO = 0.8
_REPROJECTION_PX = 3.0
_CELLS = CellConfig()


def orb(target: Grid, source: Grid) -> Placed:
    """Place a map by ORB features."""
    return _by_features(target, source, cv2.ORB.create(nfeatures=2000), cv2.NORM_HAMMING)


def sift(target: Grid, source: Grid) -> Placed:
    """Place a map by SIFT features."""
    return _by_features(target, source, cv2.SIFT.create(), cv2.NORM_L2)


def raw_image(grid: Grid) -> Image:
    """Return a map as a picture: walls black, free space white, row 0 at the top as it is in the grid."""
    cells = grid.cells.astype(np.int16)
    return np.where(cells < 0, 128, 255 - cells * 255 // 100).astype(np.uint8)


def _by_features(target: Grid, source: Grid, features: cv2.Feature2D, norm: int) -> Placed:
    resolution_m = max(target.resolution_m, source.resolution_m)
    grids = [at_resolution(grid.cropped_to_known(), resolution_m, _CELLS) for grid in (target, source)]
    found = [features.detectAndCompute(raw_image(grid), None) for grid in grids]
    (target_keys, target_words), (source_keys, source_words) = found
    if target_words is None or source_words is None or len(target_keys) < 2 or len(source_keys) < 2:
        return Placed(None, False, "too few features")
    nearest = cv2.BFMatcher(norm).knnMatch(source_words, target_words, k=2)
    kept = [pair[0] for pair in nearest if len(pair) == 2 and pair[0].distance < _RATIO * pair[1].distance]
    if len(kept) < 3:
        return Placed(None, False, "too few matches")
    source_px = np.array([source_keys[match.queryIdx].pt for match in kept], np.float64)
    target_px = np.array([target_keys[match.trainIdx].pt for match in kept], np.float64)
    cv2.setRNGSeed(0)
    matrix, _ = cv2.estimateAffinePartial2D(
        source_px, target_px, method=cv2.RANSAC, ransacReprojThreshold=_REPROJECTION_PX
    )
    if matrix is None or not math.hypot(matrix[0, 0], matrix[1, 0]) > 0.0:
        return Placed(None, False, "no transform")
    return Placed(_between_maps(matrix, grids[0], grids[1]), True, "accepted")


def _between_maps(matrix: NDArray[Any], target: Grid, source: Grid) -> Sim2:
    """Return a transform of pixels, whose centres are at whole numbers, as one between map frames."""
    scale, yaw_rad = math.hypot(matrix[0, 0], matrix[1, 0]), math.atan2(matrix[1, 0], matrix[0, 0])
    cell_m, half_m = target.resolution_m, 0.5 * target.resolution_m
    in_pixels = Sim2(float(matrix[0, 2]) * cell_m, float(matrix[1, 2]) * cell_m, yaw_rad, scale)
    grid_from_grid = Sim2(half_m, half_m) @ in_pixels @ Sim2(-half_m, -half_m)
    return target.map_from_grid @ grid_from_grid @ source.map_from_grid.inverse()
