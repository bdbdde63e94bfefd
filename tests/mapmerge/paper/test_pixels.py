"""Binarisation, closing and dilation (equations 15 and 17)."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from mapmerge.config import CellConfig
from mapmerge.grid import Grid
from mapmerge.paper.pixels import binarised, binarised_again, class_pixels, closed, is_thin, thickened

BINARY = arrays(np.uint8, array_shapes(min_dims=2, max_dims=2, max_side=24), elements=st.sampled_from([0, 255]))


def test_classes_become_three_values():
    grid = Grid(np.array([[-1, 0, 25, 26, 64, 65, 100]], np.int8), 0.05)
    assert class_pixels(grid, CellConfig()).tolist() == [[128, 255, 255, 128, 128, 0, 0]]


def test_only_what_is_darker_than_the_threshold_is_occupied():
    pixels = np.array([[0, 99, 100, 128, 255]], np.uint8)
    assert binarised(pixels, 100).tolist() == [[255, 255, 0, 0, 0]]
    assert binarised(pixels, 129).tolist() == [[255, 255, 255, 255, 0]]


def test_what_was_interpolated_is_binarised_at_one_half():
    assert binarised_again(np.array([[0, 127, 128, 255]], np.uint8)).tolist() == [[0, 0, 255, 255]]


def test_closing_fills_a_gap_in_a_wall_and_keeps_its_width():
    wall = np.zeros((9, 20), np.uint8)
    wall[4, 2:18] = 255
    with_gap = wall.copy()
    with_gap[4, 9:11] = 0
    assert np.array_equal(closed(with_gap, 3), wall)


def test_closing_leaves_a_doorway_open():
    wall = np.zeros((9, 40), np.uint8)
    wall[4, 2:14] = wall[4, 22:38] = 255
    assert np.array_equal(closed(wall, 3), wall)


def test_closing_at_the_border_is_like_anywhere():
    wall = np.zeros((9, 20), np.uint8)
    wall[0, :] = 255
    assert np.array_equal(closed(wall, 5), wall)


@given(BINARY, st.sampled_from([1, 3, 5]))
def test_closing_adds_only_and_twice_is_once(binary, side_px):
    once = closed(binary, side_px)
    assert (once >= binary).all()
    assert np.array_equal(closed(once, side_px), once)


@pytest.mark.parametrize(("width", "thin"), [(1, True), (2, True), (3, False), (6, False)])
def test_thin_walls_are_told_and_dilated(width, thin):
    picture = np.zeros((30, 30), np.uint8)
    picture[10 : 10 + width, 3:27] = 255
    assert is_thin(picture, 3) == thin
    assert np.count_nonzero(thickened(picture, 3)) == ((width + 2) * 26 if thin else width * 24)


def test_a_picture_without_a_wall_stays_as_it_is():
    nothing = np.zeros((5, 5), np.uint8)
    assert not is_thin(nothing, 3)
    assert np.array_equal(thickened(nothing, 3), nothing)
