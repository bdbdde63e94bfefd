"""A placement that was accepted, followed while the maps grow: aligned from where it was, and verified.

That costs a small part of a search, and is as good as long as the evidence holds. It is not where it does not: in a
periodic corridor a wrong placement goes on to fit. `mapmerge.watch` says when a search comes back.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mapmerge.align import align, evenly, placed, placement_of, poses_of
from mapmerge.config import MergeConfig
from mapmerge.match.base import Match, Rival
from mapmerge.match.confidence import confidence, contest, log_odds_of, times_as_likely
from mapmerge.match.cues import Cues, Fit, fit_and_scores
from mapmerge.match.look import scored
from mapmerge.match.pair import PairOfMaps
from mapmerge.match.verdict import judge
from mapmerge.polish import polish
from mapmerge.reasons import ReasonCode
from mapmerge.sim2 import Points, Sim2


def followed(pair: PairOfMaps, known: Match, config: MergeConfig) -> Match:
    """Return how an accepted placement fits the maps as they are now.

    Its rivals are those of the last search. How they fit is not computed anew, but how much they have gained is.

    Parameters
    ----------
    pair
        The maps in the order in which they are matched.
    known
        The placement, in that order.
    config
        Settings.

    Returns
    -------
    Match
        The placement, kept to the bit unless the maps say that it has moved; it may be refused.
    """
    if known.target_from_source is None:
        raise ValueError("there is no placement to follow")
    start = pair.between_grids(known.target_from_source)
    best = _aligned(pair, start, config)
    rivals = _gained(pair, known.rivals, config)
    fit, scores = fit_and_scores(pair, best, config)
    others = [rival.fit for rival in rivals if rival.fit is not None]
    fits = [fit, *others]
    odds = [log_odds_of(each) for each in fits]
    cues = Cues(fit, contest(fits, odds))
    sure = confidence(cues.contest, config.tries)
    reason = judge(scores, cues, sure, config.verify)
    return replace(
        known,
        target_from_source=known.target_from_source if best == start else pair.between_maps(best),
        scores=scores,
        accepted=reason.code is ReasonCode.ACCEPTED and bool(pair.allowed(poses_of([best])).all()),
        reason=reason,
        confidence=sure,
        cues=cues,
        rivals=tuple(
            replace(rival, likelihood=times_as_likely(value - odds[0]))
            for rival, value in zip(rivals, odds[1:], strict=True)
        ),
    )


def _aligned(pair: PairOfMaps, start: Sim2, config: MergeConfig) -> Sim2:
    """Return the placement as aligned anew; the very one from before if that moves it by less than can be told."""
    target, source, limits = pair.target.map, pair.source.map, config.refine
    walls_m = evenly(source.walls_m, limits.points)
    rough = placement_of(align(target, walls_m, poses_of([start]), limits.reject_m)[0])
    most_m = config.watch.hold_cells * target.resolution_m
    if _moved_m(start, rough, walls_m) <= most_m:
        return start
    best = polish(target, source.wall_cells_m, rough, limits)
    return start if _moved_m(start, best, walls_m) <= most_m else best


def _moved_m(one: Sim2, other: Sim2, points_m: Points) -> float:
    """Return how far points lie apart at two placements, root mean square."""
    x, y = placed(poses_of([one, other]), points_m)
    return float(np.sqrt(np.mean(np.square(x[0] - x[1]) + np.square(y[0] - y[1])))) if len(points_m) else 0.0


def _gained(pair: PairOfMaps, rivals: tuple[Rival, ...], config: MergeConfig) -> list[Rival]:
    """Return the rivals with their scores as they are now."""
    known = [rival for rival in rivals if rival.fit is not None]
    if not known:
        return []
    poses = poses_of([pair.between_grids(rival.target_from_source) for rival in known])
    found = scored(pair, poses, config)
    scores = {pose.tobytes(): float(score_m) for pose, score_m in zip(found.poses, found.scores_m, strict=True)}
    return [_with_score(rival, scores[pose.tobytes()]) for rival, pose in zip(known, poses, strict=True)]


def _with_score(rival: Rival, score_m: float) -> Rival:
    fit: Fit | None = None if rival.fit is None else replace(rival.fit, score_m=score_m)
    return replace(rival, score_m=score_m, fit=fit)
