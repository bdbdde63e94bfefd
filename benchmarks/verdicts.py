"""Whether a placement is right: tolerances, and what becomes of a pair."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

from mapmerge.sim2 import Sim2, wrap_angle

MAX_ERROR_DEG = 1.0
MAX_ERROR_CELLS, MAX_ERROR_CELLS_BENT = 2.0, 3.0
_BENT_CELLS = 0.5
WRONG_M, WRONG_DEG = 1.0, 5.0


class Verdict(StrEnum):
    """What became of a pair."""

    PLACED = "placed"
    """Accepted, within the tolerance."""
    INEXACT = "inexact"
    """Accepted, beyond the tolerance, but within a metre and 5°: the right place, badly aligned."""
    WRONG = "wrong"
    """Accepted at another place."""
    MISSED = "missed"
    """Refused, though the maps belong together."""
    FALSE_MERGE = "false merge"
    """Accepted, though the maps do not belong together."""
    REFUSED = "refused"
    """Refused, and rightly so."""


@dataclass(frozen=True, slots=True)
class Tolerance:
    """How far off a placement may be."""

    distance_m: float
    angle_deg: float = MAX_ERROR_DEG


def tolerance(cell_m: float, bend_m: float) -> Tolerance:
    """Return how far off a placement may be: 2 cells of the coarser map, 3 where the maps are bent.

    Where they are bent by more than 3 cells, the truth itself is no better than the bend.
    """
    if bend_m < _BENT_CELLS * cell_m:
        return Tolerance(MAX_ERROR_CELLS * cell_m)
    return Tolerance(max(MAX_ERROR_CELLS_BENT * cell_m, bend_m))


@dataclass(frozen=True, slots=True)
class Error:
    """How far off a placement is, amid the overlap."""

    distance_m: float
    angle_deg: float

    def within(self, allowed: Tolerance) -> bool:
        """Tell whether this is within the tolerance."""
        return self.distance_m <= allowed.distance_m and self.angle_deg <= allowed.angle_deg

    @property
    def is_elsewhere(self) -> bool:
        """Whether this is another place."""
        return self.distance_m > WRONG_M or self.angle_deg > WRONG_DEG


def error_of(placement: Sim2, truth: Sim2, centre_m: tuple[float, float]) -> Error:
    """Return the error of a placement at a point of the source's map frame."""
    x_m, y_m = placement.apply_point(*centre_m)
    true_x_m, true_y_m = truth.apply_point(*centre_m)
    turn_rad = wrap_angle(placement.yaw_rad - truth.yaw_rad)
    return Error(math.hypot(x_m - true_x_m, y_m - true_y_m), abs(math.degrees(turn_rad)))


def verdict(error: Error | None, allowed: Tolerance, *, accepted: bool, belongs: bool) -> Verdict:
    """Return what became of a pair; ``error`` is None without a placement or a truth."""
    if not belongs:
        return Verdict.FALSE_MERGE if accepted else Verdict.REFUSED
    if not accepted or error is None:
        return Verdict.MISSED
    if error.within(allowed):
        return Verdict.PLACED
    return Verdict.WRONG if error.is_elsewhere else Verdict.INEXACT
