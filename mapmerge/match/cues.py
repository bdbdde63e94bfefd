"""What speaks for and against a placement: the figures that its confidence is computed from."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapmerge.align import Poses, placed, poses_of
from mapmerge.config import MergeConfig, VerifyConfig
from mapmerge.match.look import Look
from mapmerge.match.pair import PairOfMaps
from mapmerge.match.slack import slack
from mapmerge.prepare import PreparedMap
from mapmerge.score import agreement, probe
from mapmerge.sim2 import Sim2
from mapmerge.verify import Scores

_SUBSTANTIAL, _SUBSTANTIAL_FREE_M2 = 0.25, 3.0
_LEAST_SHARE = 0.05


@dataclass(frozen=True, slots=True)
class Cues:
    """Figures of one placement of one pair.

    Parameters
    ----------
    matched_wall_m
        Length of the walls that agree, mean of both directions.
    wall_agreement, other_wall_agreement
        Share of the walls that agree, in the worse and in the better direction.
    far_share
        Share of the walls that stand amid the other map's free space, far from its walls.
    slack_agreement
        Share of the walls that agree, in the worse direction, if the maps may bend a little.
    bend_m
        By how much they bend for that.
    likeness
        Score of the best distinct rival over that of the placement, 0 to 1.
    lead_m
        Score of the placement less that of its best distinct rival.
    clearance
        Logarithm of the lead over the wall that contradicts the placement even if the maps may bend, 1 m added to each.
    rival_agreement
        Largest wall agreement of rivals that match a good part of the wall that the placement does, with some free
        space in common; 0 if none does.
    acceptance
        Acceptance index ω.
    overlap_m2, overlap_fraction
        Area that both maps know, and its share of the smaller map.
    aligned
        How well the directions of the walls that agree do so: 1 is parallel, −1 at right angles.
    held_m
        Length of the agreeing walls that keep the placement from sliding, in the direction in which it is least held.
    tight_share
        Share of the agreeing walls that do so within half of the tolerance.
    """

    matched_wall_m: float
    wall_agreement: float
    other_wall_agreement: float
    far_share: float
    slack_agreement: float
    bend_m: float
    likeness: float
    lead_m: float
    clearance: float
    rival_agreement: float
    acceptance: float
    overlap_m2: float
    overlap_fraction: float
    aligned: float
    held_m: float
    tight_share: float


def cues_of(pair: PairOfMaps, target_from_source: Sim2, scores: Scores, rivals: Look, config: MergeConfig) -> Cues:
    """Return the cues of a placement between the grid frames."""
    target, source = pair.target.map, pair.source.map
    pose = poses_of([target_from_source])
    most = max(len(target.walls_m), len(source.walls_m), 1)
    found = agreement(target, source, pose, probe(source, most, 1), probe(target, most, 1))
    judged_m = sum(float(tally.matched_m[0] + tally.violated_m[0]) for tally in (found.ahead, found.back))
    far_m = float(found.ahead.far_m[0] + found.back.far_m[0])
    rival_m = max(0.0, float(rivals.scores_m[0])) if len(rivals.scores_m) else 0.0
    least_m = max(config.verify.min_matched_wall_m, _SUBSTANTIAL * scores.matched_wall_m)
    substantial = (rivals.matched_m >= least_m) & (rivals.free_m2 >= _SUBSTANTIAL_FREE_M2)
    aligned, held_m, tight_share = _fit(target, source, pose, config.verify)
    bent = slack(target, source, target_from_source, config.slack)
    lead_m = max(0.0, scores.score_m - rival_m)
    return Cues(
        matched_wall_m=scores.matched_wall_m,
        wall_agreement=scores.wall_agreement,
        other_wall_agreement=float(max(found.ahead.share[0], found.back.share[0])),
        far_share=far_m / judged_m if judged_m > 0 else 0.0,
        slack_agreement=bent.share,
        bend_m=bent.bend_m,
        likeness=min(1.0, rival_m / scores.score_m) if scores.score_m > 0 else 1.0,
        lead_m=lead_m,
        clearance=clearance(lead_m, scores.matched_wall_m, bent.share),
        rival_agreement=float(rivals.shares[substantial].max(initial=0.0)),
        acceptance=scores.acceptance,
        overlap_m2=scores.overlap_m2,
        overlap_fraction=scores.overlap_fraction,
        aligned=aligned,
        held_m=held_m,
        tight_share=tight_share,
    )


def clearance(lead_m: float, matched_wall_m: float, slack_agreement: float) -> float:
    """Return `Cues.clearance`."""
    contradicted_m = matched_wall_m * (1.0 / max(slack_agreement, _LEAST_SHARE) - 1.0)
    return math.log((1.0 + lead_m) / (1.0 + contradicted_m))


def _fit(target: PreparedMap, source: PreparedMap, pose: Poses, config: VerifyConfig) -> tuple[float, float, float]:
    """Return how parallel the agreeing walls are, how firmly they hold the placement, and how closely they lie."""
    tolerance_m = max(config.tolerance_m, target.resolution_m)
    x, y = (values[0] for values in placed(pose, source.walls_m))
    wall = target.nearest.wall_at(x, y)
    away_m = target.nearest.distance_m(target.walls_m, x, y)
    met = away_m <= tolerance_m
    if not met.any():
        return 0.0, 0.0, 0.0
    there = target.directions[wall[met]]
    here = _turned(source.directions[met], float(pose[0, 2]))
    strength = np.hypot(*there.T) * np.hypot(*here.T)
    parallel = float((there * here).sum() / max(float(strength.sum()), 1e-9))
    # walls hold across their length: the smaller eigenvalue of the sum of the normals' outer products
    total, lean = float(strength.sum()), np.hypot(*(there * strength[:, None]).sum(axis=0))
    held_m = max(0.0, (total - float(lean)) / 2) * source.wall_spacing_m * float(pose[0, 3])
    return parallel, held_m, float(np.count_nonzero(away_m[met] <= tolerance_m / 2) / np.count_nonzero(met))


def _turned(directions: NDArray[np.float32], yaw_rad: float) -> NDArray[np.float64]:
    """Return directions, as of `PreparedMap.directions`, after a turn."""
    cos, sin = np.cos(2 * yaw_rad), np.sin(2 * yaw_rad)
    return np.asarray(directions @ np.array([[cos, sin], [-sin, cos]]), np.float64)
