"""Turning a map by its longest wall (equation 16)."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mapmerge.grid import cell_centres_m
from mapmerge.paper.radon import radon, turned
from mapmerge.sim2 import Sim2

STEP_RAD = math.radians(0.5)
CELL_M = 0.05


def room(turn_rad, size_m=(8.0, 5.0)):
    """Return the picture of a rectangle's walls, turned by an angle."""
    side = round((sum(size_m) + 2) / CELL_M)
    row, col = np.indices((side, side)).reshape(2, -1)
    middle = side * CELL_M / 2
    points = Sim2(yaw_rad=-turn_rad).apply(cell_centres_m(row, col, CELL_M) - middle)
    off = np.abs(points) - np.array(size_m) / 2
    on_wall = (off.max(axis=1) > 0) & (off.max(axis=1) <= 0.1)
    return np.where(on_wall, 255, 0).astype(np.uint8).reshape(side, side)


def occupied_m(picture):
    return cell_centres_m(*np.nonzero(picture), CELL_M)


@settings(deadline=None, max_examples=25)
@given(st.floats(-44.0, 44.0))
def test_a_turned_room_is_turned_back(turn_deg):
    found = radon(occupied_m(room(math.radians(turn_deg))), STEP_RAD, 0.1)
    assert math.degrees(found.turn_rad) == pytest.approx(-turn_deg, abs=1.25)  # two steps, and walls are a cell thick


def test_the_largest_value_is_the_longest_wall():
    picture = np.zeros((100, 200), np.uint8)
    picture[30, 10:190] = 255
    picture[10:60, 100] = 255
    found = radon(occupied_m(picture), STEP_RAD, 0.1)
    assert math.degrees(found.wall_normal_rad) == pytest.approx(90.0, abs=0.5)
    assert found.values.max() == pytest.approx(180, abs=3)


def test_a_line_holds_all_cells_at_every_angle():
    found = radon(occupied_m(room(0.3)), STEP_RAD, 0.1)
    cells = np.count_nonzero(room(0.3))
    assert found.values.shape[0] == 360
    # each cell is in two neighbouring sums, but for those of the outermost lines
    assert (found.values.sum(axis=1) <= 2 * cells).all()
    assert (found.values.sum(axis=1) > 1.5 * cells).all()


def test_no_wall_no_turn():
    assert radon(np.empty((0, 2)), STEP_RAD, 0.1).turn_rad == 0.0


@pytest.mark.parametrize("turn_deg", [0.0, 24.5, -40.0, 45.0])
def test_a_turned_picture_says_where_its_cells_come_from(turn_deg):
    picture = np.zeros((60, 90), np.uint8)
    picture[20:30, 50:60] = 255
    result = turned(picture, math.radians(turn_deg), CELL_M)
    middle_m = result.turned_from_grid.inverse().apply(occupied_m(result.binary)).mean(axis=0)
    assert middle_m == pytest.approx([55 * CELL_M, 25 * CELL_M], abs=0.25 * CELL_M)
    assert set(np.unique(result.binary)) <= {0, 255}
    assert np.count_nonzero(result.binary) == pytest.approx(100, abs=12)


def test_without_a_turn_nothing_changes():
    picture = room(0.2)
    assert np.array_equal(turned(picture, 0.0, CELL_M).binary, picture)
