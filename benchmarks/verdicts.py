"""Whether a placement is right: tolerances, and what becomes of a pair."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from replay.placement_error import PlacementError

MAX_ERROR_DEG = 1.0
MAX_ERROR_CELLS, MAX_ERROR_CELLS_BENT = 2.0, 3.0
_BENT_CELLS = 0.5


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

    def admits(self, error: PlacementError) -> bool:
        """Tell whether an error is within it."""
        return error.within(self.distance_m, self.angle_deg)


def tolerance(cell_m: float, bend_m: float) -> Tolerance:
    """Return how far off a placement may be: 2 cells of the coarser map, 3 where the maps are bent.

    Where they are bent by more than 3 cells, the truth itself is no better than the bend.
    """
    if bend_m < _BENT_CELLS * cell_m:
        return Tolerance(MAX_ERROR_CELLS * cell_m)
    return Tolerance(max(MAX_ERROR_CELLS_BENT * cell_m, bend_m))


def verdict(error: PlacementError | None, allowed: Tolerance, *, accepted: bool, belongs: bool) -> Verdict:
    """Return what became of a pair; ``error`` is None without a placement or a truth."""
    if not belongs:
        return Verdict.FALSE_MERGE if accepted else Verdict.REFUSED
    if not accepted or error is None:
        return Verdict.MISSED
    if allowed.admits(error):
        return Verdict.PLACED
    return Verdict.WRONG if error.is_elsewhere else Verdict.INEXACT
