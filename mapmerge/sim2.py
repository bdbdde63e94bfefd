"""Rigid and similarity transforms of the plane, Sim(2).

Names read right to left: ``merged_from_map = merged_from_other @ other_from_map``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapmerge.checks import is_number, shown
from mapmerge.errors import MapMergeError
from mapmerge.rounding import fixed

Points = NDArray[np.float64]


def wrap_angle(angle_rad: float) -> float:
    """Return the angle in (−π, π] that points the same way."""
    wrapped = math.remainder(angle_rad, math.tau)
    return math.pi if wrapped == -math.pi else wrapped


@dataclass(frozen=True, slots=True)
class Sim2:
    """``target_from_source``: scale, turn, then shift (paper, equation 2).

    With ``scale`` 1, the default, this is a rigid transform, SE(2).

    Parameters
    ----------
    x_m, y_m
        Where the source frame's origin lies in the target frame.
    yaw_rad
        Direction of the source frame's x axis in the target frame; kept in (−π, π].
    scale
        Target metres per source metre; positive.

    Raises
    ------
    MapMergeError
        If one is no number, the turn is not finite, or the scale not positive.
    """

    x_m: float = 0.0
    y_m: float = 0.0
    yaw_rad: float = 0.0
    scale: float = 1.0

    def __post_init__(self) -> None:
        for name in ("x_m", "y_m", "yaw_rad", "scale"):
            value = getattr(self, name)
            if type(value) is not float and not is_number(value):
                raise MapMergeError(f"{name} is {shown(value)}; expected a number")
        if not 0.0 < self.scale < math.inf:
            raise MapMergeError(f"scale is {shown(self.scale)}; expected a positive number")
        try:
            yaw_rad = wrap_angle(self.yaw_rad)
        except (ValueError, OverflowError) as error:
            raise MapMergeError(f"yaw_rad is {shown(self.yaw_rad)}; expected a finite number") from error
        object.__setattr__(self, "yaw_rad", yaw_rad)

    def __str__(self) -> str:
        """Return it to read: ``x 4.50 m, y -1.20 m, yaw 90.0°``, and its scale if that is not 1."""
        scale = "" if math.isclose(self.scale, 1.0) else f", scale {fixed(self.scale, 3)}"
        return f"{self.in_words()}{scale}"

    def in_words(self, digits: int = 2) -> str:
        """Return where it lies and how it is turned; metres with so many digits after the point, degrees with one less.

        All texts that people read have it from here, so that one place is not said in two ways.
        """
        x, y = fixed(self.x_m, digits), fixed(self.y_m, digits)
        return f"x {x} m, y {y} m, yaw {fixed(math.degrees(self.yaw_rad), digits - 1)}°"

    def __matmul__(self, other: Sim2) -> Sim2:
        """Return the transform that applies ``other`` first, then this one."""
        x_m, y_m = self.apply_point(other.x_m, other.y_m)
        return Sim2(x_m, y_m, self.yaw_rad + other.yaw_rad, self.scale * other.scale)

    def inverse(self) -> Sim2:
        """Return ``source_from_target``."""
        cos, sin = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        return Sim2(
            -(cos * self.x_m + sin * self.y_m) / self.scale,
            (sin * self.x_m - cos * self.y_m) / self.scale,
            -self.yaw_rad,
            1.0 / self.scale,
        )

    def apply_point(self, x_m: float, y_m: float) -> tuple[float, float]:
        """Return where one point of the source frame lies in the target frame."""
        cos, sin = self.scale * math.cos(self.yaw_rad), self.scale * math.sin(self.yaw_rad)
        return cos * x_m - sin * y_m + self.x_m, sin * x_m + cos * y_m + self.y_m

    def apply(self, points_m: Points) -> Points:
        """Return points, shape (N, 2), of the source frame in the target frame."""
        return points_m @ self.linear.T + (self.x_m, self.y_m)

    @property
    def linear(self) -> Points:
        """The scaled rotation, shape (2, 2)."""
        cos, sin = self.scale * math.cos(self.yaw_rad), self.scale * math.sin(self.yaw_rad)
        return np.array([[cos, -sin], [sin, cos]])

    @property
    def matrix(self) -> Points:
        """The homogeneous matrix of equation 2, shape (3, 3)."""
        matrix = np.eye(3)
        matrix[:2, :2] = self.linear
        matrix[:2, 2] = self.x_m, self.y_m
        return matrix

    def is_close(self, other: Sim2, *, distance_m: float, angle_rad: float, at_m: tuple[float, float]) -> bool:
        """Tell whether both transforms take the source point ``at_m`` to about the same pose.

        Scales may differ by as much as angles: what either does to a point is alike.
        """
        x_m, y_m = self.apply_point(*at_m)
        other_x_m, other_y_m = other.apply_point(*at_m)
        near = math.hypot(x_m - other_x_m, y_m - other_y_m) <= distance_m
        alike = abs(math.log(self.scale / other.scale)) <= angle_rad
        return near and alike and abs(wrap_angle(self.yaw_rad - other.yaw_rad)) <= angle_rad


IDENTITY = Sim2()
