"""Laws of priors."""

import math

from hypothesis import assume, given
from hypothesis import strategies as st

from mapmerge.prior import WITHIN_SIGMAS, Prior
from mapmerge.sim2 import IDENTITY, Sim2

coordinates = st.floats(-50.0, 50.0)
angles = st.floats(-math.pi, math.pi)
sigmas_m = st.floats(0.01, 5.0)
sigmas_rad = st.floats(0.001, 0.5)
poses = st.builds(Sim2, coordinates, coordinates, angles)
priors = st.builds(Prior, poses, sigmas_m, sigmas_m, sigmas_rad, st.just("given for r2"))
shares = st.floats(-1.0, 1.0)
NEARLY_SURE = 1e-12


def spreads(prior):
    return prior.sigma_x_m, prior.sigma_y_m, prior.sigma_yaw_rad


def off(prior, x, y, yaw):
    """Return a placement that is off by shares of how far the prior reaches."""
    believed = prior.target_from_source
    return Sim2(
        believed.x_m + x * WITHIN_SIGMAS * prior.sigma_x_m,
        believed.y_m + y * WITHIN_SIGMAS * prior.sigma_y_m,
        believed.yaw_rad + yaw * WITHIN_SIGMAS * prior.sigma_yaw_rad,
    )


def close(one, other):
    return one.is_close(other, distance_m=1e-6, angle_rad=1e-9, at_m=(0.0, 0.0))


@given(priors, shares, shares, shares)
def test_a_prior_allows_what_is_within_three_deviations_in_each_direction(prior, x, y, yaw):
    assume(max(abs(x), abs(y), abs(yaw)) < 0.999)
    assert prior.allows(prior.target_from_source)
    assert prior.allows(off(prior, x, y, yaw))
    for beyond in ((1.001, y, yaw), (x, -1.001, yaw), (x, y, 1.001)):
        assert not prior.allows(off(prior, *beyond))


@given(priors)
def test_swapping_the_maps_twice_covers_what_was_believed(prior):
    twice = prior.inverse().inverse()
    assert close(twice.target_from_source, prior.target_from_source)
    assert twice.origin == prior.origin
    assert all(wide >= narrow * (1 - 1e-9) for wide, narrow in zip(spreads(twice), spreads(prior), strict=True))


@given(priors, shares, shares)
def test_a_shift_that_is_allowed_is_allowed_with_the_maps_swapped(prior, x, y):
    assume(max(abs(x), abs(y)) < 0.999)
    assert prior.inverse().allows(off(prior, x, y, 0.0).inverse())


@given(poses, sigmas_m, sigmas_rad, st.floats(-0.99, 0.99))
def test_a_turn_that_is_allowed_is_allowed_with_the_maps_swapped(pose, sigma_m, sigma_rad, yaw):
    prior = Prior(pose, sigma_m, sigma_m, sigma_rad, "x")
    assert prior.inverse().allows(off(prior, 0.0, 0.0, yaw).inverse())


@given(priors)
def test_composing_with_a_sure_identity_changes_nothing(prior):
    sure = Prior(IDENTITY, NEARLY_SURE, NEARLY_SURE, NEARLY_SURE, prior.origin)
    for same in (sure.compose(prior), prior.compose(sure)):
        assert close(same.target_from_source, prior.target_from_source)
        assert all(math.isclose(a, b, abs_tol=1e-9) for a, b in zip(spreads(same), spreads(prior), strict=True))
        assert same.origin == prior.origin


@given(priors, priors)
def test_composing_composes_the_poses_and_is_no_surer_than_either(one, other):
    both = one.compose(other)
    assert close(both.target_from_source, one.target_from_source @ other.target_from_source)
    assert both.sigma_yaw_rad >= max(one.sigma_yaw_rad, other.sigma_yaw_rad)
    assert both.sigma_x_m >= one.sigma_x_m
    assert both.sigma_y_m >= one.sigma_y_m
    assert both.sigma_x_m + both.sigma_y_m >= other.sigma_x_m + other.sigma_y_m - 1e-9


@given(priors, shares, shares, shares)
def test_jitter_is_a_hundredth_of_the_spread(prior, x, y, yaw):
    biggest = max(abs(x), abs(y), abs(yaw))
    moved = Prior(off(prior, x, y, yaw), *spreads(prior), prior.origin)
    assume(abs(biggest * WITHIN_SIGMAS - 0.01) > 1e-6)
    assert prior.is_about(moved) == (biggest * WITHIN_SIGMAS < 0.01)


@given(priors)
def test_another_spread_or_origin_is_another_belief(prior):
    assert prior.is_about(prior)
    assert not prior.is_about(Prior(prior.target_from_source, *spreads(prior), "recorded in /tf"))
    assert not prior.is_about(Prior(prior.target_from_source, 2 * prior.sigma_x_m, *spreads(prior)[1:], prior.origin))
