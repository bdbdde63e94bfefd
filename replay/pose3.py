"""Poses in space, as ROS records them, and what is left of them in the plane."""

from __future__ import annotations

import math
from dataclasses import dataclass

from mapmerge.sim2 import Sim2

MAX_TILT_RAD = math.radians(5.0)
"""What is tilted by more is no pose in the plane."""
MAX_PLACE_M = 1e8
"""Twice around the earth: nothing is farther away, and up to there a place is known to less than a micrometre."""


@dataclass(frozen=True, slots=True)
class Pose3:
    """``target_from_source`` in space: turn by a quaternion of length 1, then shift.

    Names read right to left, as those of `mapmerge.sim2.Sim2`.
    """

    x_m: float = 0.0
    y_m: float = 0.0
    z_m: float = 0.0
    qx: float = 0.0
    qy: float = 0.0
    qz: float = 0.0
    qw: float = 1.0

    @staticmethod
    def of(position_m: tuple[float, float, float], quaternion: tuple[float, float, float, float]) -> Pose3:
        """Return the pose with its quaternion (x, y, z, w) brought to length 1.

        Raises
        ------
        ValueError
            If a number is not finite, or the quaternion is four zeros.
        """
        norm = math.hypot(*quaternion)
        if not all(map(math.isfinite, (*position_m, *quaternion, norm))):
            raise ValueError("finite numbers were expected")
        if norm == 0.0:
            raise ValueError("its quaternion is four zeros; a rotation was expected")
        qx, qy, qz, qw = (part / norm for part in quaternion)
        return Pose3(*position_m, qx, qy, qz, qw)

    def __matmul__(self, other: Pose3) -> Pose3:
        """Return the transform that applies ``other`` first, then this one."""
        x_m, y_m, z_m = self.turned(other.x_m, other.y_m, other.z_m)
        x, y, z, w = self.qx, self.qy, self.qz, self.qw
        return Pose3.of(
            (self.x_m + x_m, self.y_m + y_m, self.z_m + z_m),
            (
                w * other.qx + x * other.qw + y * other.qz - z * other.qy,
                w * other.qy - x * other.qz + y * other.qw + z * other.qx,
                w * other.qz + x * other.qy - y * other.qx + z * other.qw,
                w * other.qw - x * other.qx - y * other.qy - z * other.qz,
            ),
        )

    def inverse(self) -> Pose3:
        """Return ``source_from_target``."""
        back = Pose3(0.0, 0.0, 0.0, -self.qx, -self.qy, -self.qz, self.qw)
        x_m, y_m, z_m = back.turned(-self.x_m, -self.y_m, -self.z_m)
        return Pose3(x_m, y_m, z_m, back.qx, back.qy, back.qz, back.qw)

    def turned(self, x_m: float, y_m: float, z_m: float) -> tuple[float, float, float]:
        """Return a vector of the source frame along the axes of the target."""
        x, y, z, w = self.qx, self.qy, self.qz, self.qw
        cross_x, cross_y, cross_z = (
            y * z_m - z * y_m + w * x_m,
            z * x_m - x * z_m + w * y_m,
            x * y_m - y * x_m + w * z_m,
        )
        return (
            x_m + 2.0 * (y * cross_z - z * cross_y),
            y_m + 2.0 * (z * cross_x - x * cross_z),
            z_m + 2.0 * (x * cross_y - y * cross_x),
        )

    @property
    def tilt_rad(self) -> float:
        """Angle between the z axes of the two frames, 0 to π: what roll and pitch make together."""
        return 2.0 * math.asin(min(1.0, math.hypot(self.qx, self.qy)))

    def flat(self) -> Sim2:
        """Return what is left of this in the plane: shift in x and y, and turn about z."""
        yaw_rad = math.atan2(
            2.0 * (self.qw * self.qz + self.qx * self.qy), 1.0 - 2.0 * (self.qy * self.qy + self.qz * self.qz)
        )
        return Sim2(self.x_m, self.y_m, yaw_rad)
