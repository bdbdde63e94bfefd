"""Laws of transforms of the plane."""

import math

import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st

from mapmerge.sim2 import IDENTITY, Sim2, wrap_angle

coordinates = st.floats(-100.0, 100.0)
angles = st.floats(-50.0, 50.0)
transforms = st.builds(Sim2, coordinates, coordinates, angles, st.floats(0.1, 10.0))
rigid = st.builds(Sim2, coordinates, coordinates, angles)
points = st.tuples(coordinates, coordinates)


def close(one: Sim2, other: Sim2) -> bool:
    return np.allclose(one.matrix, other.matrix, rtol=1e-9, atol=1e-7)


@given(angles)
@example(math.pi)
@example(-math.pi)
@example(3 * math.pi)
@example(-3 * math.pi)
@example(-0.0)
@example(5e-324)
@example(math.nextafter(-math.pi, 0.0))
@example(math.nextafter(-math.pi, -4.0))
@example(1e15)
def test_wrapped_angles_lie_in_range_and_point_the_same_way(angle):
    wrapped = wrap_angle(angle)
    assert -math.pi < wrapped <= math.pi
    assert math.cos(wrapped) == np.float64(math.cos(math.remainder(angle, math.tau)))
    assert math.isclose(math.sin(wrapped), math.sin(math.remainder(angle, math.tau)), abs_tol=1e-15)
    assert wrap_angle(wrapped) == wrapped


@given(st.floats(-math.pi, math.pi), st.integers(-5, 5))
def test_whole_turns_do_not_matter(angle, turns):
    apart = wrap_angle(angle + turns * math.tau) - wrap_angle(angle)
    assert abs(math.remainder(apart, math.tau)) < 1e-13


@given(transforms, points)
def test_matrix_agrees_with_apply(transform, point):
    by_matrix = transform.matrix @ (*point, 1.0)
    np.testing.assert_allclose(by_matrix[:2], transform.apply_point(*point), rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(transform.apply(np.array([point]))[0], by_matrix[:2], rtol=1e-12, atol=1e-9)
    np.testing.assert_array_equal(transform.matrix[:2, :2], transform.linear)
    np.testing.assert_array_equal(transform.matrix[2], [0.0, 0.0, 1.0])


@given(transforms, transforms, points)
def test_composing_is_applying_one_after_the_other(one, other, point):
    np.testing.assert_allclose(
        (one @ other).apply_point(*point), one.apply_point(*other.apply_point(*point)), rtol=1e-9, atol=1e-6
    )
    np.testing.assert_allclose((one @ other).matrix, one.matrix @ other.matrix, rtol=1e-9, atol=1e-6)


@given(rigid, rigid, rigid)
def test_composing_is_associative(one, two, three):
    assert close((one @ two) @ three, one @ (two @ three))


@given(transforms)
def test_inverse_undoes_from_both_sides(transform):
    assert close(transform @ transform.inverse(), IDENTITY)
    assert close(transform.inverse() @ transform, IDENTITY)
    np.testing.assert_allclose(transform.inverse().matrix, np.linalg.inv(transform.matrix), rtol=1e-7, atol=1e-7)


@given(transforms)
def test_inverse_twice_is_the_same(transform):
    assert close(transform.inverse().inverse(), transform)


@given(rigid, rigid)
def test_inverse_of_a_product(one, other):
    assert close((one @ other).inverse(), other.inverse() @ one.inverse())


@given(transforms)
def test_identity_is_neutral(transform):
    assert transform @ IDENTITY == transform
    assert IDENTITY @ transform == transform


@given(transforms, points, points)
def test_distances_are_scaled(transform, one, other):
    before = math.dist(one, other)
    after = math.dist(transform.apply_point(*one), transform.apply_point(*other))
    assert math.isclose(after, transform.scale * before, rel_tol=1e-9, abs_tol=1e-9)


@given(transforms, transforms, points)
def test_closeness_is_symmetric_and_every_transform_is_close_to_itself(one, other, point):
    limits = {"distance_m": 1.0, "angle_rad": 0.2, "at_m": point}
    assert one.is_close(one, **limits)
    assert one.is_close(other, **limits) == other.is_close(one, **limits)
