"""SIFT features and the pairs of them that RANSAC draws from."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmerge.paper.interest import Cells
from mapmerge.paper.pixels import Image
from mapmerge.sim2 import Points

_MARGIN_PX = 16


@dataclass(frozen=True, slots=True, eq=False)
class Features:
    """SIFT features of one picture.

    Parameters
    ----------
    pixels
        Shape (N, 2): column and row, whole numbers at the centres of pixels.
    descriptors
        Shape (N, 128).
    """

    pixels: Points
    descriptors: NDArray[np.float32]


def sift(picture: Image, background: int, most: int) -> Features:
    """Return the strongest SIFT features of a picture; at one place there may be several, of different orientations.

    SIFT leaves out what is near a picture's border and mirrors what lies beyond it; so the picture is framed by its
    background.
    """
    if picture.size == 0:
        return Features(np.empty((0, 2)), np.empty((0, 128), np.float32))
    framed = np.pad(picture, _MARGIN_PX, constant_values=background)
    keypoints, descriptors = cv2.SIFT.create().detectAndCompute(framed, None)
    if descriptors is None or not keypoints:
        return Features(np.empty((0, 2)), np.empty((0, 128), np.float32))
    places = np.array([point.pt for point in keypoints], np.float64) - _MARGIN_PX
    response = np.array([point.response for point in keypoints])
    # by strength, ties by place and direction: the order must not depend on how OpenCV found them
    direction = np.array([point.angle for point in keypoints])
    kept = np.lexsort((direction, places[:, 0], places[:, 1], -response))[:most]
    return Features(places[kept], np.asarray(descriptors, np.float32)[kept])


def one_a_place(features: Features) -> Features:
    """Return one feature of each pixel, the first: where only places are matched, several would be counted twice."""
    _, first = np.unique(np.rint(features.pixels), axis=0, return_index=True)
    kept = np.sort(first)
    return Features(features.pixels[kept], features.descriptors[kept])


def nearest_pairs(ones: Features, others: Features) -> Cells:
    """Return for each feature of the one the other whose descriptor is nearest (section 4.1), shape (N, 2)."""
    if len(ones.pixels) == 0 or len(others.pixels) == 0:
        return np.empty((0, 2), np.intp)
    squared = (
        np.square(ones.descriptors).sum(axis=1)[:, None]
        + np.square(others.descriptors).sum(axis=1)[None, :]
        - 2.0 * ones.descriptors @ others.descriptors.T
    )
    return np.stack([np.arange(len(ones.pixels)), np.argmin(squared, axis=1)], axis=1).astype(np.intp)
