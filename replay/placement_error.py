"""How far a placement is from the true one, and when that is another place."""

from __future__ import annotations

import math
from dataclasses import dataclass

from mapmerge.sim2 import Sim2, wrap_angle

ELSEWHERE_M, ELSEWHERE_DEG = 1.0, 5.0
"""A placement that is farther off is at another place: no merger would mend it."""


@dataclass(frozen=True, slots=True)
class PlacementError:
    """How far off a placement is.

    Parameters
    ----------
    distance_m
        At a point of the map's frame, amid what the map shares with others.
    angle_deg
        By how much it is turned wrongly; never negative.
    """

    distance_m: float
    angle_deg: float

    def within(self, distance_m: float, angle_deg: float) -> bool:
        """Tell whether both errors are at most these."""
        return self.distance_m <= distance_m and self.angle_deg <= angle_deg

    @property
    def is_elsewhere(self) -> bool:
        """Whether this is another place."""
        return not self.within(ELSEWHERE_M, ELSEWHERE_DEG)


def error_of(found: Sim2, true: Sim2, at_m: tuple[float, float]) -> PlacementError:
    """Return how far off a placement is at a point of the map's frame."""
    (x_m, y_m), (true_x_m, true_y_m) = found.apply_point(*at_m), true.apply_point(*at_m)
    turn_rad = wrap_angle(found.yaw_rad - true.yaw_rad)
    return PlacementError(math.hypot(x_m - true_x_m, y_m - true_y_m), abs(math.degrees(turn_rad)))
