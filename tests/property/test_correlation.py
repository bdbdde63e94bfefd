"""Laws of the default method: what a placement may not depend on."""

import math

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from mapmerge.grid import Grid
from mapmerge.match.correlation import CorrelationMatcher
from mapmerge.sim2 import Sim2
from tests.floors import FLAT_M, errors, flat, in_frame, match_grids

MATCHER = CorrelationMatcher()
FEWER = settings().max_examples // 2

coordinates = st.floats(-200.0, 200.0)
angles = st.floats(-math.pi, math.pi)
frames = st.builds(Sim2, coordinates, coordinates, angles)
resolutions_m = st.sampled_from([0.04, 0.05, 0.06, 0.08, 0.1])
margins = st.tuples(*[st.integers(0, 40)] * 4)
seeds = st.integers(0, 5)


def seen_from(yaw_rad, resolution_m, seed, frame):
    """Return a map of the flat whose cells lie at a turn to its walls, and where its map frame lies on the floor."""
    floor_from_grid = Sim2(FLAT_M[0] / 2, FLAT_M[1] / 2, yaw_rad) @ Sim2(-6.5, -6.5)
    grid = flat(floor_from_grid, resolution_m=resolution_m, ragged=seed, size_m=13.0)
    return in_frame(grid, frame), floor_from_grid @ frame.inverse()


def padded(grid, margin):
    """Return the same map with more unknown cells around it."""
    below, above, left, right = margin
    cells = np.pad(grid.cells, ((below, above), (left, right)), constant_values=-1)
    corner = Sim2(-left * grid.resolution_m, -below * grid.resolution_m)
    return Grid(cells, grid.resolution_m, grid.map_from_grid @ corner)


def middle_m(floor_from_map):
    return floor_from_map.inverse().apply_point(FLAT_M[0] / 2, FLAT_M[1] / 2)


@settings(max_examples=FEWER)
@given(angles, resolutions_m, resolutions_m, frames, frames, seeds)
def test_swapping_two_maps_gives_the_inverse(yaw_rad, one_m, other_m, one_frame, other_frame, seed):
    # of a map and its copy in the same frame nothing tells which is which
    assume(abs(yaw_rad) > 1e-3 or one_frame != other_frame)
    target, floor_from_target = seen_from(0.0, one_m, seed, one_frame)
    source, floor_from_source = seen_from(yaw_rad, other_m, seed + 7, other_frame)
    there, back = match_grids(MATCHER, target, source), match_grids(MATCHER, source, target)
    at_m = middle_m(floor_from_source)
    inverse = back.target_from_source.inverse()
    position_m, angle_deg = errors(inverse, there.target_from_source, at_m)
    assert position_m < 1e-6
    assert angle_deg < 1e-6
    assert (there.accepted, there.reason, there.scores) == (back.accepted, back.reason, back.scores)
    assert (there.confidence, there.cues) == (back.confidence, back.cues)
    assert len(there.rivals) == len(back.rivals)
    for rival, its_inverse in zip(there.rivals, back.rivals, strict=True):
        assert rival.score_m == its_inverse.score_m
        found = its_inverse.target_from_source.inverse()
        assert errors(found, rival.target_from_source, at_m)[0] < 1e-6
    # and both are right
    true = floor_from_target.inverse() @ floor_from_source
    position_m, angle_deg = errors(there.target_from_source, true, at_m)
    assert position_m < 0.05
    assert angle_deg < 0.5


@settings(max_examples=FEWER)
@given(angles, frames, frames, margins, margins)
def test_frames_and_margins_change_nothing_else(yaw_rad, one_frame, other_frame, one_margin, other_margin):
    # at a turn to the walls, so that the maps are no copies of each other, of which the frames decide which is moved
    target, _ = seen_from(0.1, 0.05, 1, Sim2())
    source, floor_from_source = seen_from(yaw_rad, 0.05, 2, Sim2())
    still = match_grids(MATCHER, target, source)
    moved = match_grids(
        MATCHER, in_frame(padded(target, one_margin), one_frame), in_frame(padded(source, other_margin), other_frame)
    )
    assert (moved.scores, moved.cues, moved.confidence, moved.reason) == (
        still.scores,
        still.cues,
        still.confidence,
        still.reason,
    )
    expected = one_frame @ still.target_from_source @ other_frame.inverse()
    at_m = other_frame.apply_point(*middle_m(floor_from_source))
    assert errors(moved.target_from_source, expected, at_m)[0] < 1e-6
