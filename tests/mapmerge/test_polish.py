"""Alignment to a fraction of a cell."""

import math

import numpy as np
import pytest

from mapmerge.config import RefineConfig
from mapmerge.polish import polish
from mapmerge.sim2 import IDENTITY, Sim2
from tests.floors import FEW_POINTS, FLAT_M, errors, filled, flat, prepared_map, walls_of_the_flat

LIMITS = RefineConfig()
CENTRE_M = (FLAT_M[0] / 2 + 1.0, FLAT_M[1] / 2 + 1.0)


def polished(target, points_m, start=IDENTITY):
    return polish(target, points_m, start, LIMITS)


@pytest.mark.parametrize("off", [Sim2(0.05, -0.03), Sim2(-0.04, 0.05, 0.004), Sim2(0.0, 0.0, -0.008)])
def test_a_map_is_drawn_back_on_itself(off):
    prepared = prepared_map(flat())
    start = Sim2(*CENTRE_M) @ off @ Sim2(*CENTRE_M).inverse()
    position_m, angle_deg = errors(polished(prepared, prepared.wall_cells_m, start), IDENTITY, CENTRE_M)
    assert position_m < 0.005
    assert angle_deg < 0.08


def test_a_map_on_itself_stays_where_it_is():
    prepared = prepared_map(flat())
    found = polished(prepared, prepared.wall_cells_m)
    assert errors(found, IDENTITY, CENTRE_M) == pytest.approx((0.0, 0.0), abs=1e-3)


def test_errors_of_many_placements_cancel_out():
    """No direction of the target's grid may be preferred: not by the order in which cells are looked at either."""
    off_m = []
    for number, turn in enumerate(np.linspace(0.1, 6.1, 16)):
        corner, place = Sim2(-1.52 + 0.013 * number, -1.5, 0.02 * number), Sim2(*CENTRE_M, turn) @ Sim2(-8.5, -7.0)
        target = prepared_map(flat(corner, ragged=2 * number, size_m=14.0))
        source = prepared_map(flat(place, ragged=2 * number + 1, size_m=17.0))
        from_floor = target.grid.map_from_grid.inverse() @ corner.inverse()
        truth = from_floor @ place @ source.grid.map_from_grid
        found = polished(target, source.wall_cells_m, truth)
        middle_m = (place @ source.grid.map_from_grid).inverse().apply_point(*CENTRE_M)
        off_m.append(np.subtract(found.apply_point(*middle_m), truth.apply_point(*middle_m)))
    assert np.hypot(*np.transpose(off_m)).max() < 0.02
    assert np.abs(np.mean(off_m, axis=0)).max() < 0.003


def test_the_scale_is_kept():
    prepared = prepared_map(flat())
    found = polished(prepared, prepared.wall_cells_m / 1.7, Sim2(0.03, -0.02, scale=1.7))
    assert found.scale == pytest.approx(1.7, abs=1e-12)
    assert errors(found, Sim2(scale=1.7), (CENTRE_M[0] / 1.7, CENTRE_M[1] / 1.7))[0] < 0.003


def test_far_from_every_wall_the_start_is_returned():
    prepared = prepared_map(flat())
    far = Sim2(500.0, 0.0, 0.4)
    assert polished(prepared, prepared.wall_cells_m, far) == far


@pytest.mark.parametrize("name", FEW_POINTS)
def test_few_points_have_an_outcome(name):
    found = polished(prepared_map(flat()), FEW_POINTS[name], Sim2(0.01, 0.0, 0.1))
    assert all(map(math.isfinite, (found.x_m, found.y_m, found.yaw_rad)))


@pytest.mark.parametrize("grid", [filled(-1, 4, 4), filled(0, 9, 9), filled(100, 1, 1), filled(100, 1, 90)])
def test_few_walls_have_an_outcome(grid):
    found = polished(prepared_map(grid), walls_of_the_flat(1))
    assert all(map(math.isfinite, (found.x_m, found.y_m, found.yaw_rad)))
