"""A placement that was accepted, followed while the maps grow: aligned from where it was, and verified on a sample.

That costs a small part of a search, and is as good as long as the evidence holds. It is not where it does not: in a
periodic corridor a wrong placement goes on to fit. `mapmerge.watch` says when a search comes back.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mapmerge.align import Poses, align, evenly, placed, placement_of, poses_of
from mapmerge.config import MergeConfig
from mapmerge.match.base import Match
from mapmerge.match.pair import PairOfMaps
from mapmerge.match.verdict import held
from mapmerge.polish import polish
from mapmerge.prepared import CELL_UNKNOWN
from mapmerge.reasons import ReasonCode
from mapmerge.score import agreement, probe
from mapmerge.sim2 import Points, Sim2
from mapmerge.verify import Scores

_AREA_POINTS = 8000


def followed(pair: PairOfMaps, known: Match, config: MergeConfig) -> Match:
    """Return how an accepted placement fits the maps as they are now.

    Its scores are estimates from a sample of both maps; its confidence and its rivals are those of the last search, but
    for their scores, which tell whether one of them gains.

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
    if known.target_from_source is None or known.scores is None:
        raise ValueError("there is no placement to follow")
    start = pair.between_grids(known.target_from_source)
    best = _aligned(pair, start, config)
    others = [pair.between_grids(rival.target_from_source) for rival in known.rivals]
    scores, scores_m = _estimated(pair, poses_of([best, *others]), known.scores, config)
    reason = held(scores, config.verify)
    is_allowed = bool(pair.allowed(poses_of([best])).all())
    return replace(
        known,
        target_from_source=known.target_from_source if best == start else pair.between_maps(best),
        scores=scores,
        accepted=is_allowed and reason.code is ReasonCode.ACCEPTED,
        reason=reason,
        rivals=tuple(replace(rival, score_m=score_m) for rival, score_m in zip(known.rivals, scores_m, strict=True)),
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


def _estimated(pair: PairOfMaps, poses: Poses, before: Scores, config: MergeConfig) -> tuple[Scores, tuple[float, ...]]:
    """Return the scores of the first placement, and what the others are ranked by."""
    target, source, most = pair.target.map, pair.source.map, config.refine.probes
    found = agreement(target, source, poses, probe(source, most, most // 2), probe(target, most, most // 2))
    free_m = evenly(source.free_m, _AREA_POINTS)
    met = target.classes.ravel()[target.flat_index(placement_of(poses[0]).apply(free_m))] != CELL_UNKNOWN
    overlap_m2 = float(np.mean(met)) * source.known_area_m2 * float(poses[0, 3]) ** 2 if len(met) else 0.0
    smaller_m2 = min(target.known_area_m2, source.known_area_m2 * float(poses[0, 3]) ** 2)
    scores_m = found.score_m(config.verify).tolist()
    scores = replace(
        before,
        score_m=scores_m[0],
        overlap_m2=overlap_m2,
        overlap_fraction=min(1.0, overlap_m2 / smaller_m2) if smaller_m2 > 0 else 0.0,
        wall_agreement=float(min(found.ahead.share[0], found.back.share[0])),
        matched_wall_m=float(found.ahead.matched_m[0] + found.back.matched_m[0]) / 2,
        violated_wall_m=float(found.ahead.violated_m[0] + found.back.violated_m[0]) / 2,
    )
    return scores, tuple(scores_m[1:])
