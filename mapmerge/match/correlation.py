"""The default matcher: orientation spectra, correlation of coarse maps, ICP, and a calibrated judgement of the outcome.

1. Rotations from the orientation spectra, each also turned by 180°.
2. Translations for each rotation from the correlation of coarse maps: walls on walls, less walls in free space.
3. Every candidate aligned by ICP against the nearest walls of the target, and ranked by walls and free space that
   agree, in both directions; the best ones once more.
4. Unless the best one is clear, a second look, at all rotations.
5. The best of them that are distinct weighed against each other: the likeliest one is taken.
6. That one aligned to a fraction of a cell, and its confidence computed from what speaks for and against it, and from
   how it stands among the others.

The smaller map is always the one that is moved, so that swapping the maps gives the inverse.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mapmerge.align import Poses, placement_of, poses_of
from mapmerge.config import MergeConfig
from mapmerge.evidence import Evidence
from mapmerge.grid import Grid
from mapmerge.match.base import Match, Matcher, Rival
from mapmerge.match.candidates import all_scales, by_half_turn, by_prior, by_spectra, by_sweep, likely_rotations
from mapmerge.match.confidence import confidence, log_odds_of, times_as_likely
from mapmerge.match.cues import Cues, Fit, fit_of
from mapmerge.match.explain import explained
from mapmerge.match.follow import followed
from mapmerge.match.look import Look, look, look_around, rivals
from mapmerge.match.pair import DescribedMap, PairOfMaps, ordered
from mapmerge.match.verdict import contradicted, is_far_likelier, judge, too_little_structure, within
from mapmerge.match.weigh import Weighed, shares_too_little, weighed
from mapmerge.polish import polish
from mapmerge.prepare import LiveMap
from mapmerge.prior import Prior
from mapmerge.reasons import Reason, ReasonCode
from mapmerge.sim2 import Sim2
from mapmerge.verify import verify

_ROUNDS = 4
_GLANCED_AT = 3


class CorrelationMatcher(Matcher[DescribedMap]):
    """Finds a placement; the resolutions are taken from the maps' metadata unless the scale is free."""

    def prepare(self, grid: Grid, resolution_m: float, config: MergeConfig) -> DescribedMap:
        """Return the walls, distances and orientation spectra of one map."""
        live = LiveMap(resolution_m, config)
        return DescribedMap(live, live.update(grid), config.search.angle_step_rad)

    def update(self, prepared: DescribedMap, grid: Grid, resolution_m: float, config: MergeConfig) -> DescribedMap:
        """Return the map as it is now; only what changed is computed anew."""
        del resolution_m, config
        return replace(prepared, map=prepared.live.update(grid))

    def renewed(self, prepared: DescribedMap) -> DescribedMap:
        """Return the map with its walls thinned as if it were new."""
        anew = prepared.live.renewed()
        return prepared if anew is None else replace(prepared, map=anew)

    def match(
        self, target: DescribedMap, source: DescribedMap, config: MergeConfig, prior: Prior | None = None
    ) -> Match:
        """Return the best placement of the source on the target, accepted or refused."""
        poor = too_little_structure(target, source, config.verify)
        if poor is not None:
            return Match(None, None, accepted=False, reason=poor)
        pair = ordered(target, source, prior)
        match = _matched(pair, config)
        if prior is not None:
            elsewhere = replace(pair, prior=None)
            match = _held_against(match, _matched(elsewhere, config), pair, config)
        return match.inverse() if pair.swapped else match

    def is_hopeful(self, target: DescribedMap, source: DescribedMap, config: MergeConfig) -> bool:
        """Tell whether the first look of a search finds a placement that may be right by itself."""
        if too_little_structure(target, source, config.verify) is not None:
            return False
        pair = ordered(target, source)
        scales, steps = _scales(pair, config)
        seen = look(pair, by_spectra(pair, likely_rotations(pair, config.search), steps, config.search), scales, config)
        best = _apart(pair, seen, config).rows(slice(0, _GLANCED_AT))
        poses = best.poses[best.matched_m >= config.verify.min_matched_wall_m]
        fits = (fit_of(pair, placement_of(pose), config) for pose in poses)
        return any(
            times_as_likely(log_odds_of(fit)) >= config.watch.hopeful_odds and not shares_too_little(fit, config.verify)
            for fit in fits
        )

    def follow(
        self, target: DescribedMap, source: DescribedMap, known: Match, config: MergeConfig, prior: Prior | None = None
    ) -> Match:
        """Return how a placement that was accepted fits the maps as they are now: aligned from there, and verified."""
        pair = ordered(target, source, prior)
        if not pair.swapped:
            return followed(pair, known, config)
        turned = known.inverse()
        found = followed(pair, turned, config)
        is_kept = found.target_from_source == turned.target_from_source
        # to the bit, which inverting twice is not
        return replace(found.inverse(), target_from_source=known.target_from_source) if is_kept else found.inverse()

    def explain(
        self, target: DescribedMap, source: DescribedMap, match: Match, config: MergeConfig
    ) -> tuple[Evidence, ...]:
        """Return the orientation spectra, the correlation of the coarse maps, and both maps laid on each other."""
        if too_little_structure(target, source, config.verify) is not None:
            return ()
        pair = ordered(target, source)
        return explained(pair, match.inverse() if pair.swapped else match, config)


def _held_against(match: Match, elsewhere: Match, pair: PairOfMaps, config: MergeConfig) -> Match:
    """Return the match within a prior, refused if the maps fit elsewhere and not there, or are far likelier there."""
    if pair.prior is None or elsewhere.target_from_source is None:
        return match
    found = poses_of([pair.between_grids(elsewhere.target_from_source)])
    if not pair.allowed(found).all():
        is_likelier = match.accepted and is_far_likelier(elsewhere, match, config.verify)
        if is_likelier or (elsewhere.accepted and not match.accepted):
            return contradicted(match, elsewhere, pair.prior, pair, config.verify)
    return match if match.accepted else within(match, pair.prior)


def _matched(pair: PairOfMaps, config: MergeConfig) -> Match:
    """Return where the source of the pair lies on its target."""
    rotations = likely_rotations(pair, config.search)
    ranked = _search(pair, rotations, config)
    if len(ranked.poses) == 0:
        reason = Reason(ReasonCode.NO_CANDIDATE, "no placement lets walls of the two maps coincide")
        return Match(None, None, accepted=False, reason=reason)
    found = _weighed(pair, ranked, config)
    best = _polished(pair, placement_of(found.look.poses[0]), config)
    scores = verify(pair.target.map, pair.source.map, best, config.verify)
    cues = Cues(found.fits[0], found.contest)
    sure = confidence(cues.contest, config.tries)
    reason = judge(scores, cues, sure, config.verify, found.other_half(config.verify))
    return Match(
        target_from_source=pair.between_maps(best),
        scores=scores,
        accepted=reason.code is ReasonCode.ACCEPTED,
        reason=reason,
        confidence=sure,
        cues=cues,
        rivals=_rivals(pair, found),
    )


def _rivals(pair: PairOfMaps, found: Weighed) -> tuple[Rival, ...]:
    """Return the placements that compete with the first one."""
    best, *others = found.log_odds
    return tuple(
        Rival(pair.between_maps(placement_of(pose)), fit.score_m, times_as_likely(log_odds - best), fit)
        for pose, log_odds, fit in zip(found.look.poses[1:], others, found.fits[1:], strict=True)
    )


def _search(pair: PairOfMaps, rotations: tuple[float, ...], config: MergeConfig) -> Look:
    """Return the best placement and its rivals, after a second look if the first one is not clear."""
    scales, steps = _scales(pair, config)
    if pair.prior is not None:
        starts = by_prior(pair, config.search)
        if steps != (1.0,):
            starts = np.vstack([starts, by_spectra(pair, rotations, steps, config.search)])
        seen = look(pair, starts, scales, config)
        return _apart(pair, seen.joined(_around_best(pair, seen, scales, config)), config)
    seen = look(pair, by_spectra(pair, rotations, steps, config.search), scales, config)
    around = _around_best(pair, seen, scales, config)
    ranked = _apart(pair, seen.joined(around), config)
    if not _is_clear(ranked, config) and scales[0] <= 1.0 <= scales[1]:
        both = seen.joined(look(pair, by_sweep(pair, config.search), scales, config))
        if not np.array_equal(both.poses[:1], seen.poses[:1]):
            around = _around_best(pair, both, scales, config)
        ranked = _apart(pair, both.joined(around), config)
    return ranked


def _scales(pair: PairOfMaps, config: MergeConfig) -> tuple[tuple[float, float], tuple[float, ...]]:
    """Return the least and the largest scale of the pair's placement, and those that are tried."""
    if config.scale == "metadata":
        return (1.0, 1.0), (1.0,)
    least, largest = config.scale_range
    limits = (1 / largest, 1 / least) if pair.swapped else (least, largest)
    return limits, all_scales(*limits, config.search.scale_step)


def _around_best(pair: PairOfMaps, seen: Look, scales: tuple[float, float], config: MergeConfig) -> Look:
    """Return what competes with the best of some placements; nothing if there is none."""
    return _around(pair, seen.poses[:1], scales, config) if len(seen.poses) else seen


def _around(pair: PairOfMaps, pose: Poses, scales: tuple[float, float], config: MergeConfig) -> Look:
    """Return what competes with a placement, shape (1, 4), and is easily overlooked: beside it, and turned by 180°."""
    return look_around(pair, pose, by_half_turn(pair, placement_of(pose[0]), config.search), scales, config)


def _apart(pair: PairOfMaps, seen: Look, config: MergeConfig) -> Look:
    """Return the best placement, then its rivals, which differ from it and from all better ones."""
    if len(seen.poses) == 0:
        return seen
    best, others = seen.rows(slice(0, 1)), seen.rows(slice(1, None))
    return best.followed_by(rivals(best, others, pair, config.verify))


def _weighed(pair: PairOfMaps, ranked: Look, config: MergeConfig) -> Weighed:
    """Return the ranked placements, likeliest first, once what competes with the likeliest was looked for as well."""
    known: dict[bytes, Fit] = {}
    looked_at = [ranked.poses[:1]]
    found = weighed(pair, ranked, config, known)
    while len(looked_at) < _ROUNDS and not any(np.array_equal(found.look.poses[:1], pose) for pose in looked_at):
        likeliest = found.look.poses[:1]
        looked_at.append(likeliest)
        around = _around(pair, likeliest, _scales(pair, config)[0], config)
        ranked = _apart(pair, ranked.joined(around), config)
        found = weighed(pair, ranked, config, known)
    return found


def _polished(pair: PairOfMaps, rough: Sim2, config: MergeConfig) -> Sim2:
    """Return a placement aligned to a fraction of a cell, unless that leads out of what is allowed."""
    best = polish(pair.target.map, pair.source.map.wall_cells_m, rough, config.refine)
    return best if pair.allowed(poses_of([best])).all() else rough


def _is_clear(ranked: Look, config: MergeConfig) -> bool:
    """Tell whether the best placement fits so well, and all others so much worse, that there is no need to look on."""
    limits = config.search
    if len(ranked.poses) == 0 or ranked.scores_m[0] <= 0.0:
        return False
    return bool(
        ranked.shares[0] >= limits.clear_agreement
        and ranked.matched_m[0] >= limits.clear_wall_m
        and ranked.scores_m[1:].max(initial=0.0) <= limits.clear_likeness * ranked.scores_m[0]
    )
