"""What speaks for and against a placement: the figures that its confidence is computed from."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapmerge.align import Poses, placed, poses_of
from mapmerge.config import MergeConfig, VerifyConfig
from mapmerge.match.pair import PairOfMaps
from mapmerge.match.slack import slack
from mapmerge.prepared import PreparedMap
from mapmerge.score import far_share
from mapmerge.sim2 import Sim2
from mapmerge.verify import verified

_HOLDS = 0.25


@dataclass(frozen=True, slots=True)
class Fit:
    """How well the maps fit at one placement, whatever other placements there are.

    What speaks against it is a share or a ratio, what speaks for it a size as well: more of the same is never worse.

    Parameters
    ----------
    score_m
        What candidates are ranked by at first, see `VerifyConfig.violation_weight`.
    contradicted_m
        Length of the walls that contradict the placement even if the maps may bend, mean of both directions.
    wall_agreement
        Share of the walls that agree, in the worse direction. This and the two above are no cues by themselves.
    matched_wall_m
        Length of the walls that agree, mean of both directions.
    slack_agreement
        Share of the walls that agree, in the worse direction, if the maps may bend a little.
    far_share
        Share of the walls that stand amid the other map's free space, far from its walls.
    slack_far_share
        The same if the maps may bend: where they are bent, walls lie beside each other; one that is missing does not.
    solidity
        Logarithm of the score over the wall that contradicts the placement, 1 m added to each.
    acceptance
        Acceptance index ω.
    overlap_m2, overlap_fraction
        Area that both maps know, and its share of the smaller map.
    aligned
        How well the directions of the walls that agree do so: 1 is parallel, −1 at right angles.
    held_m
        Length of the agreeing walls that keep the placement from sliding, in the direction in which it is least held.
    """

    score_m: float
    contradicted_m: float
    wall_agreement: float
    matched_wall_m: float
    slack_agreement: float
    far_share: float
    slack_far_share: float
    solidity: float
    acceptance: float
    overlap_m2: float
    overlap_fraction: float
    aligned: float
    held_m: float


@dataclass(frozen=True, slots=True)
class Contest:
    """How a placement stands among all that were weighed.

    Parameters
    ----------
    log_odds
        Logarithm of how many times likelier it is, by itself, than that none is right.
    lead_log_odds
        Logarithm of how many times likelier it is than the best of the others.
    share
        Its share of the likelihood of all of them and of that none is right, 0 to 1.
    likeness
        Largest score of the others over its own, 0 to 1.
    lead_m
        Its score less the largest of the others.
    crowd
        Among how many placements that are about as likely the choice is; 1 if it is clear.
    clearance
        Logarithm of the lead over the wall that contradicts it even if the maps may bend, 1 m added to each.
    """

    log_odds: float
    lead_log_odds: float
    share: float
    likeness: float
    lead_m: float
    crowd: float
    clearance: float


@dataclass(frozen=True, slots=True)
class Cues:
    """What speaks for and against a placement of one pair, by itself and among others."""

    fit: Fit
    contest: Contest


def fit_of(pair: PairOfMaps, target_from_source: Sim2, config: MergeConfig) -> Fit:
    """Return how well the maps fit at a placement between the grid frames."""
    target, source = pair.target.map, pair.source.map
    scores, found = verified(target, source, target_from_source, config.verify)
    aligned, held_m = _direction(target, source, poses_of([target_from_source]), config.verify)
    bent = slack(target, source, target_from_source, config.slack)
    return Fit(
        score_m=scores.score_m,
        contradicted_m=bent.contradicted_m,
        wall_agreement=scores.wall_agreement,
        matched_wall_m=scores.matched_wall_m,
        slack_agreement=bent.share,
        far_share=far_share(found.ahead, found.back),
        slack_far_share=bent.far_share,
        solidity=_log_ratio(scores.score_m, bent.contradicted_m),
        acceptance=scores.acceptance,
        overlap_m2=scores.overlap_m2,
        overlap_fraction=scores.overlap_fraction,
        aligned=aligned,
        held_m=held_m,
    )


def clearance(lead_m: float, contradicted_m: float) -> float:
    """Return `Contest.clearance`."""
    return _log_ratio(lead_m, contradicted_m)


def _log_ratio(for_m: float, against_m: float) -> float:
    return math.log((1.0 + max(0.0, for_m)) / (1.0 + against_m))


def _direction(target: PreparedMap, source: PreparedMap, pose: Poses, config: VerifyConfig) -> tuple[float, float]:
    """Return how parallel the agreeing walls are, and how firmly they hold the placement."""
    tolerance_m = max(config.tolerance_m, target.resolution_m)
    x, y = (values[0] for values in placed(pose, source.walls_m))
    wall = target.nearest.wall_at(x, y)
    met = np.flatnonzero(target.nearest.distance_m(wall, x, y) <= tolerance_m)
    if len(met) == 0:
        return 0.0, 0.0
    there = target.nearest.directions.take(wall.take(met), axis=0)
    cos, sin = math.cos(2.0 * float(pose[0, 2])), math.sin(2.0 * float(pose[0, 2]))
    here = source.directions.take(met, axis=0) @ np.array([[cos, sin], [-sin, cos]])
    length = _lengths(there)
    strength = length * _lengths(here)
    total = float(strength.sum())
    # directions are of twice the angle: along the weakest axis only walls hold that run well across most of them
    main = (there * strength[:, None]).sum(axis=0)
    main /= max(float(np.hypot(*main)), 1e-9)
    across = 0.5 * (1.0 - there @ main / np.maximum(length, 1e-9))
    held_m = float((strength * across)[across > _HOLDS].sum()) * source.wall_spacing_m * float(pose[0, 3])
    return float((there * here).sum() / max(total, 1e-9)), held_m


def _lengths(vectors: NDArray[np.floating]) -> NDArray[np.float64]:
    """Return the lengths of vectors, shape (N, 2)."""
    return np.asarray(np.sqrt(np.einsum("na,na->n", vectors, vectors, dtype=np.float64)), np.float64)
