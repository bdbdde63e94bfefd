"""What a SLAM gets wrong: errors that come and go with time, and a map that is bent as a whole."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from mapmerge.sim2 import Sim2
from samples.world import Rng


@dataclass(frozen=True, slots=True)
class Drift:
    """How far a SLAM's pose estimate wanders from the truth; it never wanders off.

    Parameters
    ----------
    position_m, yaw_rad
        Standard deviation.
    memory_s
        How long an error lasts.
    """

    position_m: float = 0.008
    yaw_rad: float = 0.0015
    memory_s: float = 12.0

    def errors(self, count: int, period_s: float, rng: Rng) -> Iterator[Sim2]:
        """Yield the errors of ``count`` poses, as seen from the robot; the first is zero."""
        keep = math.exp(-period_s / self.memory_s)
        spread = np.array([self.position_m, self.position_m, self.yaw_rad]) * math.sqrt(1.0 - keep**2)
        error = np.zeros(3)
        for _ in range(count):
            yield Sim2(*error.tolist())
            error = keep * error + rng.normal(0.0, spread)


@dataclass(frozen=True, slots=True)
class Wave:
    """One wave of a `Warp`: everything is shifted along the crests by a sine of the place across them.

    Parameters
    ----------
    shift_m
        Amplitude.
    direction_rad
        Across the crests.
    length_m
        From crest to crest.
    phase_rad
        At the world's origin.
    """

    shift_m: float
    direction_rad: float
    length_m: float
    phase_rad: float


@dataclass(frozen=True, slots=True)
class Warp:
    """A map that is bent as a whole: what lies at one place is shifted and turned alike, whenever it is seen.

    Parameters
    ----------
    waves
        Their sum is the shift; none leaves the map straight.
    """

    waves: tuple[Wave, ...] = ()

    def apply(self, world_from_robot: Sim2) -> Sim2:
        """Return where a robot takes itself to be."""
        x_m, y_m, yaw_rad = world_from_robot.x_m, world_from_robot.y_m, world_from_robot.yaw_rad
        for wave in self.waves:
            cos, sin = math.cos(wave.direction_rad), math.sin(wave.direction_rad)
            across_m = cos * world_from_robot.x_m + sin * world_from_robot.y_m
            turn_rad = math.tau * across_m / wave.length_m + wave.phase_rad
            shift_m = wave.shift_m * math.sin(turn_rad)
            x_m, y_m = x_m - sin * shift_m, y_m + cos * shift_m
            yaw_rad += 0.5 * wave.shift_m * math.tau / wave.length_m * math.cos(turn_rad)
        return Sim2(x_m, y_m, yaw_rad)


def drawn_warp(most_m: float, rng: Rng) -> Warp:
    """Return a random warp of two long waves that shifts by about ``most_m`` at most."""
    if most_m <= 0.0:
        return Warp()
    waves = [
        Wave(0.5 * most_m, float(rng.uniform(0.0, math.tau)), float(length_m), float(rng.uniform(0.0, math.tau)))
        for length_m in rng.uniform(18.0, 45.0, 2)
    ]
    return Warp(tuple(waves))
