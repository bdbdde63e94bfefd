"""What is believed of a placement before the maps are looked at."""

from __future__ import annotations

import math
from dataclasses import dataclass

from mapmerge.sim2 import Sim2, wrap_angle

WITHIN_SIGMAS = 3.0
"""A placement within so many standard deviations of a prior is within the prior."""


@dataclass(frozen=True, slots=True)
class Prior:
    """A believed placement, with how sure it is.

    Parameters
    ----------
    target_from_source
        Where the source's map frame is believed to lie in the target's.
    sigma_x_m, sigma_y_m, sigma_yaw_rad
        Standard deviations along the target's axes, and of the turn.
    origin
        Who says so, in words that fit "the placement ...": "given for r2", "recorded in /tf".
    """

    target_from_source: Sim2
    sigma_x_m: float
    sigma_y_m: float
    sigma_yaw_rad: float
    origin: str

    def allows(self, target_from_source: Sim2) -> bool:
        """Tell whether a placement lies within the prior, in all three of its directions."""
        believed = self.target_from_source
        return (
            abs(target_from_source.x_m - believed.x_m) <= WITHIN_SIGMAS * self.sigma_x_m
            and abs(target_from_source.y_m - believed.y_m) <= WITHIN_SIGMAS * self.sigma_y_m
            and abs(wrap_angle(target_from_source.yaw_rad - believed.yaw_rad)) <= WITHIN_SIGMAS * self.sigma_yaw_rad
        )

    def inverse(self) -> Prior:
        """Return the same belief with the maps swapped."""
        back = self.target_from_source.inverse()
        # an error of the turn moves what is far from the origin; the position's spread is turned with the frame
        reach_m = math.hypot(back.x_m, back.y_m) * self.sigma_yaw_rad
        c2, s2 = math.cos(back.yaw_rad) ** 2, math.sin(back.yaw_rad) ** 2
        var_x, var_y = (self.sigma_x_m * back.scale) ** 2, (self.sigma_y_m * back.scale) ** 2
        return Prior(
            back,
            math.sqrt(c2 * var_x + s2 * var_y + reach_m**2),
            math.sqrt(s2 * var_x + c2 * var_y + reach_m**2),
            self.sigma_yaw_rad,
            self.origin,
        )

    def compose(self, other: Prior) -> Prior:
        """Return the belief of ``self @ other``: the target of ``self`` from the source of ``other``."""
        pose = self.target_from_source @ other.target_from_source
        reach_m = math.hypot(other.target_from_source.x_m, other.target_from_source.y_m) * self.sigma_yaw_rad
        c2, s2 = math.cos(self.target_from_source.yaw_rad) ** 2, math.sin(self.target_from_source.yaw_rad) ** 2
        scale = self.target_from_source.scale
        var_x, var_y = (other.sigma_x_m * scale) ** 2, (other.sigma_y_m * scale) ** 2
        origin = self.origin if self.origin == other.origin else f"{self.origin} and {other.origin}"
        return Prior(
            pose,
            math.sqrt(self.sigma_x_m**2 + c2 * var_x + s2 * var_y + reach_m**2),
            math.sqrt(self.sigma_y_m**2 + s2 * var_x + c2 * var_y + reach_m**2),
            math.hypot(self.sigma_yaw_rad, other.sigma_yaw_rad),
            origin,
        )
