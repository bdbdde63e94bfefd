"""What m-explore's ``map_merge`` node does without known initial poses, of the parts of OpenCV that it is made of.

Features, `AffineBestOf2NearestMatcher`, the largest component of pairs with a confidence of at least 1 (the default of
``estimation_confidence``), `AffineBasedEstimator` and `BundleAdjusterAffinePartial`, on the cells as they are, unknown
being 255, whatever their resolutions (``combine_grids/merging_pipeline.cpp``). Written after it, not copied. Its
default features are AKAZE, which OpenCV 5 has no more: there, only its choice ORB can be measured.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from benchmarks.methods import Placed
from mapmerge.grid import Grid
from mapmerge.sim2 import Sim2

CONFIDENCE = 1.0

_MATCH_CONFIDENCE = 0.3
_LEAST_MATCHES = 6


def orb(target: Grid, source: Grid) -> Placed:
    """Place a map as the node does with ORB features."""
    return _place(target, source, cv2.ORB.create())


def akaze(target: Grid, source: Grid) -> Placed:
    """Place a map as the node does by default; only where OpenCV has AKAZE."""
    finder: cv2.Feature2D = cv2.AKAZE.create()  # type: ignore[attr-defined]
    return _place(target, source, finder)


def _place(target: Grid, source: Grid, finder: cv2.Feature2D) -> Placed:
    cv2.setRNGSeed(0)
    images = [np.ascontiguousarray(grid.cells).view(np.uint8) for grid in (target, source)]
    features = [cv2.detail.computeImageFeatures2(finder, image) for image in images]
    if any(len(each.getKeypoints()) < _LEAST_MATCHES for each in features):
        return Placed(None, False, "too few features")
    try:
        matrix = _target_from_source(features)
    except cv2.error:  # some maps make its adjustment multiply an empty matrix
        return Placed(None, False, "OpenCV fails")
    if isinstance(matrix, str):
        return Placed(None, False, matrix)
    return Placed(_between_maps(matrix, target, source), True, "accepted")


def _target_from_source(features: Sequence[cv2.detail.ImageFeatures]) -> NDArray[np.float64] | str:
    """Return the transform of pixels, shape (3, 3), or why there is none."""
    matcher = cv2.detail.AffineBestOf2NearestMatcher(False, False, _MATCH_CONFIDENCE, _LEAST_MATCHES)
    matches = matcher.apply2(features)
    if max(match.confidence for match in matches) < CONFIDENCE:
        return "low confidence"
    cv2.detail.leaveBiggestComponent(features, matches, CONFIDENCE)
    found, cameras = cv2.detail.AffineBasedEstimator().apply(features, matches, None)  # type: ignore[arg-type]
    if not found:
        return "no transform"
    for camera in cameras:
        camera.R = camera.R.astype(np.float32)
    adjuster = cv2.detail.BundleAdjusterAffinePartial()
    adjuster.setConfThresh(CONFIDENCE)
    found, cameras = adjuster.apply(features, matches, cameras)
    if not found:
        return "the adjustment fails"
    target_from_first, source_from_first = (camera.R.astype(np.float64) for camera in cameras)
    if not math.hypot(source_from_first[0, 0], source_from_first[1, 0]) > 0.0:
        return "no transform"
    return np.asarray(target_from_first @ np.linalg.inv(source_from_first))


def _between_maps(matrix: NDArray[Any], target: Grid, source: Grid) -> Sim2:
    """Return a transform of pixels, whose centres are at whole numbers, as one between map frames in metres."""
    yaw_rad = math.atan2(matrix[1, 0], matrix[0, 0])
    scale = math.hypot(matrix[0, 0], matrix[1, 0]) * target.resolution_m / source.resolution_m
    shift = Sim2(float(matrix[0, 2]) * target.resolution_m, float(matrix[1, 2]) * target.resolution_m, yaw_rad, scale)
    half_target_m, half_source_m = 0.5 * target.resolution_m, 0.5 * source.resolution_m
    grid_from_grid = Sim2(half_target_m, half_target_m) @ shift @ Sim2(-half_source_m, -half_source_m)
    return target.map_from_grid @ grid_from_grid @ source.map_from_grid.inverse()
