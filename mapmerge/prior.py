"""What is believed of a placement before the maps are looked at."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapmerge.checks import is_number, shown
from mapmerge.errors import ConfigError
from mapmerge.sim2 import Sim2, wrap_angle

WITHIN_SIGMAS = 3.0
"""A placement within so many standard deviations of a prior is within the prior."""

_UNCHANGED_SIGMAS = 0.01


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

    Raises
    ------
    ConfigError
        If one is of another kind, or a standard deviation is negative.
    """

    target_from_source: Sim2
    sigma_x_m: float
    sigma_y_m: float
    sigma_yaw_rad: float
    origin: str = "given"

    def __post_init__(self) -> None:
        if not isinstance(self.target_from_source, Sim2):
            raise ConfigError(
                f"target_from_source is {shown(self.target_from_source)}; expected Sim2(x_m, y_m, yaw_rad)"
            )
        for name in ("sigma_x_m", "sigma_y_m", "sigma_yaw_rad"):
            sigma = getattr(self, name)
            if not is_number(sigma) or not sigma >= 0.0:
                raise ConfigError(f"{name} is {shown(sigma)}; expected a number that is not negative")
        if not isinstance(self.origin, str):
            raise ConfigError(f"origin is {shown(self.origin)}; expected a text")

    def allows(self, target_from_source: Sim2) -> bool:
        """Tell whether a placement lies within the prior, in all three of its directions."""
        pose = target_from_source.x_m, target_from_source.y_m, target_from_source.yaw_rad
        return bool(self.allows_each(np.array([pose]))[0])

    def allows_each(
        self, poses: NDArray[np.float64], slack_m: float = 0.0, slack_rad: float = 0.0
    ) -> NDArray[np.bool_]:
        """Tell which placements lie within the prior, or so near to it.

        Parameters
        ----------
        poses
            ``target_from_source``: x_m, y_m and yaw_rad, shape (C, 3).
        slack_m, slack_rad
            How far beyond it they may lie.
        """
        believed = self.target_from_source
        off = np.abs(poses - (believed.x_m, believed.y_m, believed.yaw_rad))
        off[:, 2] = np.abs(np.remainder(off[:, 2] + np.pi, 2 * np.pi) - np.pi)
        limits = WITHIN_SIGMAS * np.array([self.sigma_x_m, self.sigma_y_m, self.sigma_yaw_rad])
        slack = np.array([slack_m, slack_m, slack_rad])
        return np.asarray((off <= limits + slack).all(axis=1), np.bool_)

    def is_about(self, other: Prior, sigmas: float = _UNCHANGED_SIGMAS) -> bool:
        """Tell whether another belief is this one but for jitter: no part differs by more than that of its spread."""
        one, two = self.target_from_source, other.target_from_source
        differences = (
            (self.sigma_x_m, one.x_m - two.x_m, self.sigma_x_m - other.sigma_x_m),
            (self.sigma_y_m, one.y_m - two.y_m, self.sigma_y_m - other.sigma_y_m),
            (self.sigma_yaw_rad, wrap_angle(one.yaw_rad - two.yaw_rad), self.sigma_yaw_rad - other.sigma_yaw_rad),
        )
        return self.origin == other.origin and all(
            max(abs(moved), abs(wider)) <= sigmas * sigma for sigma, moved, wider in differences
        )

    def inverse(self) -> Prior:
        """Return the same belief with the maps swapped."""
        back = self.target_from_source.inverse()
        reach_m = math.hypot(back.x_m, back.y_m) * self.sigma_yaw_rad
        sigma_x_m, sigma_y_m = self.turned_sigmas_m(back)
        return Prior(
            back,
            math.hypot(sigma_x_m, reach_m),
            math.hypot(sigma_y_m, reach_m),
            self.sigma_yaw_rad,
            self.origin,
        )

    def compose(self, other: Prior) -> Prior:
        """Return the belief of ``self @ other``: the target of ``self`` from the source of ``other``."""
        pose = self.target_from_source @ other.target_from_source
        # an error of the turn moves what is far from the origin
        scale = self.target_from_source.scale
        reach_m = math.hypot(other.target_from_source.x_m, other.target_from_source.y_m) * scale * self.sigma_yaw_rad
        sigma_x_m, sigma_y_m = other.turned_sigmas_m(self.target_from_source)
        origin = self.origin if self.origin == other.origin else f"{self.origin} and {other.origin}"
        return Prior(
            pose,
            math.hypot(self.sigma_x_m, sigma_x_m, reach_m),
            math.hypot(self.sigma_y_m, sigma_y_m, reach_m),
            math.hypot(self.sigma_yaw_rad, other.sigma_yaw_rad),
            origin,
        )

    def turned_sigmas_m(self, frame: Sim2) -> tuple[float, float]:
        """Return the position's spread along the axes of another frame, at least what it is.

        Its parts add up as they are, not as squares: what was turned before has errors that go together, and what is
        within the prior must not fall out of it because the maps are swapped.
        """
        cos, sin = abs(math.cos(frame.yaw_rad)) * frame.scale, abs(math.sin(frame.yaw_rad)) * frame.scale
        return cos * self.sigma_x_m + sin * self.sigma_y_m, sin * self.sigma_x_m + cos * self.sigma_y_m
