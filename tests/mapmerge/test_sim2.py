"""Transforms of the plane, by example; the laws they obey are in tests/property/test_sim2.py."""

import math

import numpy as np
import pytest

from mapmerge.sim2 import IDENTITY, Sim2, wrap_angle


class TestWrapAngle:
    @pytest.mark.parametrize("turns", [-3, -1, 0, 1, 2])
    def test_half_a_turn_is_plus_pi(self, turns):
        assert wrap_angle(math.pi + turns * math.tau) == pytest.approx(math.pi, abs=1e-12)
        assert wrap_angle(math.pi) == math.pi
        assert wrap_angle(-math.pi) == math.pi

    def test_just_beyond_half_a_turn_is_negative(self):
        beyond = math.nextafter(math.pi, 4.0)
        assert wrap_angle(beyond) == pytest.approx(-math.pi, abs=1e-15)
        assert wrap_angle(beyond) > -math.pi
        assert wrap_angle(math.nextafter(math.pi, 0.0)) == math.nextafter(math.pi, 0.0)

    @pytest.mark.parametrize(
        ("angle", "wrapped"), [(0.0, 0.0), (math.tau, 0.0), (-math.tau, 0.0), (1.5, 1.5), (-2, -2)]
    )
    def test_keeps_small_angles_and_drops_whole_turns(self, angle, wrapped):
        assert wrap_angle(angle) == wrapped

    def test_takes_many_turns(self):
        assert wrap_angle(1000 * math.tau + 0.25) == pytest.approx(0.25, abs=1e-9)


class TestSim2:
    def test_quarter_turn_scaled_and_shifted(self):
        pose = Sim2(1.0, 2.0, math.pi / 2, 3.0)
        assert pose.apply_point(1.0, 0.0) == pytest.approx((1.0, 5.0))
        assert pose.apply_point(0.0, 1.0) == pytest.approx((-2.0, 2.0))

    def test_matrix_is_equation_2(self):
        pose = Sim2(0.3, -0.7, 0.5, 1.25)
        cos, sin = 1.25 * math.cos(0.5), 1.25 * math.sin(0.5)
        np.testing.assert_allclose(pose.matrix, [[cos, -sin, 0.3], [sin, cos, -0.7], [0.0, 0.0, 1.0]], rtol=1e-15)

    def test_applies_the_right_one_first(self):
        shift, turn = Sim2(1.0, 0.0), Sim2(yaw_rad=math.pi / 2)
        assert (turn @ shift).apply_point(0.0, 0.0) == pytest.approx((0.0, 1.0))
        assert (shift @ turn).apply_point(0.0, 0.0) == pytest.approx((1.0, 0.0))

    def test_keeps_its_yaw_wrapped(self):
        assert Sim2(yaw_rad=3 * math.pi / 2).yaw_rad == pytest.approx(-math.pi / 2)
        assert (Sim2(yaw_rad=2.0) @ Sim2(yaw_rad=2.0)).yaw_rad == pytest.approx(4.0 - math.tau)

    def test_identity_moves_nothing(self):
        points = np.array([[1.5, -2.0], [0.0, 1e6]])
        assert np.array_equal(IDENTITY.apply(points), points)

    def test_takes_no_points(self):
        assert Sim2(1.0, 2.0, 3.0).apply(np.empty((0, 2))).shape == (0, 2)

    @pytest.mark.parametrize("scale", [0.0, -1.0, math.nan, math.inf])
    def test_a_scale_that_cannot_be_undone_is_refused(self, scale):
        with pytest.raises(ValueError, match="scale"):
            Sim2(scale=scale)


LIMITS = {"distance_m": 0.1, "angle_rad": math.radians(5.0)}


class TestIsClose:
    def test_compares_positions_at_the_point_and_not_at_the_origin(self):
        turned = Sim2(yaw_rad=math.radians(2.0))
        assert IDENTITY.is_close(turned, at_m=(0.0, 0.0), **LIMITS)
        assert not IDENTITY.is_close(turned, at_m=(30.0, 0.0), **LIMITS)

    def test_compares_directions(self):
        assert not IDENTITY.is_close(Sim2(yaw_rad=math.radians(6.0)), at_m=(0.0, 0.0), **LIMITS)

    def test_compares_directions_across_half_a_turn(self):
        one, other = Sim2(yaw_rad=math.radians(179.0)), Sim2(yaw_rad=math.radians(-179.0))
        assert one.is_close(other, at_m=(0.0, 0.0), **LIMITS)
        assert other.is_close(one, at_m=(0.0, 0.0), **LIMITS)

    def test_the_limits_themselves_are_close(self):
        assert IDENTITY.is_close(Sim2(x_m=0.1), at_m=(0.0, 0.0), **LIMITS)
        assert not IDENTITY.is_close(Sim2(x_m=math.nextafter(0.1, 1.0)), at_m=(0.0, 0.0), **LIMITS)

    def test_compares_scales_as_angles(self):
        """Either takes a point 1 m away by as much."""
        assert IDENTITY.is_close(Sim2(scale=1.05), at_m=(0.0, 0.0), **LIMITS)
        assert not IDENTITY.is_close(Sim2(scale=1.1), at_m=(0.0, 0.0), **LIMITS)
        assert not IDENTITY.is_close(Sim2(scale=0.9), at_m=(0.0, 0.0), **LIMITS)
