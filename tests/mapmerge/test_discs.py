"""Discs of cells, by which walls are spread."""

import cv2
import numpy as np
import pytest

from mapmerge.discs import Disc


@pytest.mark.parametrize("resolution_m", [0.03, 0.05, 0.08, 0.2])
@pytest.mark.parametrize("distance_m", [0.0, 0.15, 0.2, 0.5, 1.23, 2.5])
@pytest.mark.parametrize("share", [0.0005, 0.01])
def test_what_walls_spread_to_is_what_a_distance_transform_finds_near(resolution_m, distance_m, share):
    walls = np.random.default_rng(0).random((150, 211)) < share
    walls[40, 50] = True
    away = cv2.distanceTransform(np.where(walls, 0, 255).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_5)
    near = away * np.float32(resolution_m) <= distance_m
    spread = Disc.of(distance_m, resolution_m).spread(walls.view(np.uint8) * np.uint8(4))
    np.testing.assert_array_equal(spread, near * np.uint8(4))


def test_it_reaches_as_far_as_it_says():
    disc = Disc.of(0.5, 0.05)
    one = np.zeros((41, 41), np.uint8)
    one[20, 20] = 1
    rows, cols = np.nonzero(disc.spread(one))
    assert disc.radius == 10
    assert (rows.min(), rows.max(), cols.min(), cols.max()) == (10, 30, 10, 30)
