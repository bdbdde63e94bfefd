"""Laws of poses in space."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from mapmerge.sim2 import Sim2
from replay.pose3 import Pose3

coordinates = st.floats(-100.0, 100.0)
parts = st.floats(-1.0, 1.0)


@st.composite
def poses(draw):
    quaternion = tuple(draw(parts) for _ in range(4))
    assume(math.hypot(*quaternion) > 1e-3)
    return Pose3.of((draw(coordinates), draw(coordinates), draw(coordinates)), quaternion)


def matrix(pose):
    """Return a pose as a homogeneous matrix, its axes where the pose turns them."""
    axes = [pose.turned(*axis) for axis in np.eye(3).tolist()]
    found = np.eye(4)
    found[:3, :3] = np.array(axes).T
    found[:3, 3] = pose.x_m, pose.y_m, pose.z_m
    return found


def flat(x_m, y_m, yaw_rad):
    return Pose3.of((x_m, y_m, 0.0), (0.0, 0.0, math.sin(yaw_rad / 2), math.cos(yaw_rad / 2)))


@given(poses())
def test_a_turn_is_a_rotation(pose):
    turn = matrix(pose)[:3, :3]
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-9)
    assert np.linalg.det(turn) == pytest.approx(1.0)


@given(poses(), poses())
def test_composing_multiplies_matrices(one, other):
    np.testing.assert_allclose(matrix(one @ other), matrix(one) @ matrix(other), atol=1e-8)


@given(poses())
def test_inverse_undoes(pose):
    np.testing.assert_allclose(matrix(pose.inverse()), np.linalg.inv(matrix(pose)), atol=1e-8)


@given(poses())
def test_tilt_is_the_angle_between_the_z_axes(pose):
    _, _, upright = pose.turned(0.0, 0.0, 1.0)
    assert math.cos(pose.tilt_rad) == pytest.approx(upright, abs=1e-9)


@given(coordinates, coordinates, st.floats(-3.1, 3.1), coordinates, coordinates, st.floats(-3.1, 3.1))
def test_in_the_plane_it_is_a_transform_of_the_plane(x1, y1, yaw1, x2, y2, yaw2):
    found = (flat(x1, y1, yaw1) @ flat(x2, y2, yaw2)).flat()
    expected = Sim2(x1, y1, yaw1) @ Sim2(x2, y2, yaw2)
    assert found.is_close(expected, distance_m=1e-6, angle_rad=1e-9, at_m=(1.0, 1.0))
    assert flat(x1, y1, yaw1).tilt_rad == 0.0


@pytest.mark.parametrize("position", [(math.nan, 0.0, 0.0), (0.0, 0.0, math.inf)])
def test_no_position(position):
    with pytest.raises(ValueError, match="finite"):
        Pose3.of(position, (0.0, 0.0, 0.0, 1.0))


@pytest.mark.parametrize("quaternion", [(0.0, 0.0, 0.0, 0.0), (math.nan, 0.0, 0.0, 1.0), (1e308, 1e308, 1e308, 1e308)])
def test_no_quaternion(quaternion):
    with pytest.raises(ValueError, match=r"finite|zeros"):
        Pose3.of((0.0, 0.0, 0.0), quaternion)
