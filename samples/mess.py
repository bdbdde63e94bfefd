"""How messy two robots' maps of one site are: drawn at random, so that they come as messy as those of real robots."""

from __future__ import annotations

import math
from dataclasses import dataclass

from samples.drive import Pace
from samples.lidar import Lidar
from samples.mapping import SensorModel
from samples.mission import Robot
from samples.sites import Changes
from samples.slam import Drift, drawn_warp
from samples.world import Rng

RESOLUTIONS_M = (0.025, 0.05, 0.1, 0.2)
_USUAL = (0.2, 0.5, 0.2, 0.1)
MOST_NOISE_M = 0.05
MOST_WARP_M = 0.3


@dataclass(frozen=True, slots=True)
class Mess:
    """What a robot's map suffers from.

    Parameters
    ----------
    noise_m
        Standard deviation of a range.
    dropout
        Share of beams that return nothing.
    warp_m
        By how much its map is bent as a whole.
    drift_m, drift_rad, memory_s
        Errors of its pose that come and go, and how long one lasts.
    people
        How many walk about.
    changes
        What is not where it was when somebody else came by.
    beams, field_rad, reach_m
        Of its lidar: in a full turn, field of view, range.
    is_trinary
        Whether its map says only free, occupied and unknown.
    """

    noise_m: float
    dropout: float
    warp_m: float
    drift_m: float
    drift_rad: float
    memory_s: float
    people: int
    changes: Changes
    beams: int
    field_rad: float
    reach_m: float
    is_trinary: bool


def drawn_mess(rng: Rng) -> Mess:
    """Return how messy one robot's map is; small errors are more frequent than large ones."""
    return Mess(
        noise_m=float(rng.uniform(0.0, MOST_NOISE_M)),
        dropout=float(rng.uniform(0.0, 0.04)),
        warp_m=MOST_WARP_M * float(rng.uniform()) ** 2,
        drift_m=0.003 + 0.03 * float(rng.uniform()) ** 2,
        drift_rad=0.0008 + 0.005 * float(rng.uniform()) ** 2,
        memory_s=float(rng.uniform(10.0, 90.0)),
        people=int(rng.integers(0, 3)),
        changes=Changes(*rng.uniform(0.0, (0.25, 0.05, 0.3)).tolist()),
        beams=int(rng.choice([360, 360, 720])),
        field_rad=math.radians(float(rng.choice([360.0, 360.0, 270.0, 180.0]))),
        reach_m=float(rng.choice([6.0, 8.0, 12.0, 20.0])),
        is_trinary=bool(rng.uniform() < 0.5),
    )


def drawn_resolutions(count: int, rng: Rng) -> list[float]:
    """Return the resolutions of some robots' maps: in two of three sites all alike."""
    first = float(rng.choice(RESOLUTIONS_M, p=_USUAL))
    if rng.uniform() < 2.0 / 3.0:
        return [first] * count
    return [float(rng.choice(RESOLUTIONS_M, p=_USUAL)) for _ in range(count)]


def robot_of(mess: Mess, resolution_m: float, rng: Rng) -> Robot:
    """Return a robot whose maps are this messy."""
    return Robot(
        lidar=Lidar(mess.beams, mess.field_rad, mess.reach_m, mess.noise_m, mess.dropout),
        pace=Pace(speed_m_s=1.0, turn_rad_s=1.8),
        model=SensorModel(resolution_m=resolution_m),
        drift=Drift(mess.drift_m, mess.drift_rad, mess.memory_s),
        warp=drawn_warp(mess.warp_m, rng),
        scan_every_m=0.4,
        people=mess.people,
    )
