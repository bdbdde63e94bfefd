"""The evidence for a placement: the acceptance index (paper, equation 3) and the tests that it lacks.

Free cells outnumber walls, so that ω alone is high for many wrong placements; walls that agree in both directions,
walls that stand in the other map's free space, and the lead over rival placements tell them apart.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mapmerge.config import VerifyConfig
from mapmerge.grid import cell_centres_m
from mapmerge.prepare import CELL_FREE, CELL_UNKNOWN, PreparedMap
from mapmerge.sim2 import Points, Sim2


@dataclass(frozen=True, slots=True)
class WallAgreement:
    """What one map's walls meet in the other map, in metres of wall.

    Parameters
    ----------
    matched_m
        On a wall of the other map.
    violated_m
        In the other map's free space, off its walls.
    """

    matched_m: float
    violated_m: float

    @property
    def share(self) -> float:
        """Matched share of the walls that the other map can judge; 0 if there are none."""
        judged = self.matched_m + self.violated_m
        return self.matched_m / judged if judged > 0 else 0.0


@dataclass(frozen=True, slots=True)
class Scores:
    """How well two maps agree at one placement.

    Parameters
    ----------
    score_m
        What placements of one pair are ranked by, see `VerifyConfig.violation_weight`.
    acceptance
        Acceptance index ω, equation 3, cell by cell at the working resolution.
    overlap_m2
        Area that both maps know.
    overlap_fraction
        The same over the smaller known area.
    wall_agreement
        Share of walls that agree, in the worse of both directions.
    matched_wall_m
        Length of the walls that agree, mean of both directions.
    violated_wall_m
        Length of the walls in the other's free space, mean of both directions.
    """

    score_m: float
    acceptance: float
    overlap_m2: float
    overlap_fraction: float
    wall_agreement: float
    matched_wall_m: float
    violated_wall_m: float


def wall_agreement(target: PreparedMap, walls_m: Points, spacing_m: float, tolerance_m: float) -> WallAgreement:
    """Return what walls, one point a ``spacing_m``, given in the target's grid frame, meet in the target."""
    tolerance_m = max(tolerance_m, target.resolution_m)
    index = target.flat_index(walls_m)
    matched = target.wall_distance_m.ravel()[index] <= tolerance_m
    violated = ~matched & (target.classes.ravel()[index] == CELL_FREE)
    return WallAgreement(float(np.count_nonzero(matched)) * spacing_m, float(np.count_nonzero(violated)) * spacing_m)


def free_agreement_m2(target: PreparedMap, free_m: Points, spacing_m: float) -> float:
    """Return the area of free space, given in the target's grid frame, that is free in the target as well."""
    free = target.classes.ravel()[target.flat_index(free_m)] == CELL_FREE
    return float(np.count_nonzero(free)) * spacing_m**2


def rank_score_m(target: PreparedMap, source: PreparedMap, target_from_source: Sim2, config: VerifyConfig) -> float:
    """Return what candidates are ranked by: cheap, both directions, in metres of wall."""
    ahead, back = _both_ways(target, source, target_from_source, config.tolerance_m)
    free_m2 = free_agreement_m2(target, target_from_source.apply(source.free_m), source.free_spacing_m)
    return _score(ahead, back, free_m2, config)


def verify(target: PreparedMap, source: PreparedMap, target_from_source: Sim2, config: VerifyConfig) -> Scores:
    """Return all that is known of a placement."""
    ahead, back = _both_ways(target, source, target_from_source, config.tolerance_m)
    free_m2 = free_agreement_m2(target, target_from_source.apply(source.free_m), source.free_spacing_m)
    agree, disagree, both = cell_agreement(target, source, target_from_source)
    cell_m2 = source.resolution_m**2
    smaller_m2 = min(target.grid.known_area_m2, source.grid.known_area_m2)
    return Scores(
        score_m=_score(ahead, back, free_m2, config),
        acceptance=agree / (agree + disagree) if agree else 0.0,
        overlap_m2=both * cell_m2,
        overlap_fraction=min(1.0, both * cell_m2 / smaller_m2) if smaller_m2 > 0 else 0.0,
        wall_agreement=min(ahead.share, back.share),
        matched_wall_m=(ahead.matched_m + back.matched_m) / 2,
        violated_wall_m=(ahead.violated_m + back.violated_m) / 2,
    )


def cell_agreement(target: PreparedMap, source: PreparedMap, target_from_source: Sim2) -> tuple[int, int, int]:
    """Count the cells that agree (both occupied or both free), that disagree, and that both maps know."""
    rows, cols = np.nonzero(source.grid.cells >= 0)
    centres_m = cell_centres_m(rows, cols, source.resolution_m)
    index = target.flat_index(target_from_source.apply(centres_m))
    target_cells = np.pad(target.grid.cells, target.margin, constant_values=-1).ravel()[index]
    there = target.classes.ravel()[index]
    here = source.classes[rows + source.margin, cols + source.margin]
    classed = (here != CELL_UNKNOWN) & (there != CELL_UNKNOWN)
    agree = classed & (here == there)
    return (
        int(np.count_nonzero(agree)),
        int(np.count_nonzero(classed & ~agree)),
        int(np.count_nonzero(target_cells >= 0)),
    )


def _both_ways(
    target: PreparedMap, source: PreparedMap, target_from_source: Sim2, tolerance_m: float
) -> tuple[WallAgreement, WallAgreement]:
    source_from_target = target_from_source.inverse()
    return (
        wall_agreement(target, target_from_source.apply(source.walls_m), source.wall_spacing_m, tolerance_m),
        wall_agreement(source, source_from_target.apply(target.walls_m), target.wall_spacing_m, tolerance_m),
    )


def _score(ahead: WallAgreement, back: WallAgreement, free_m2: float, config: VerifyConfig) -> float:
    matched_m = (ahead.matched_m + back.matched_m) / 2
    violated_m = (ahead.violated_m + back.violated_m) / 2
    return matched_m - config.violation_weight * violated_m + config.free_weight * free_m2
