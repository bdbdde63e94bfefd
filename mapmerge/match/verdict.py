"""Whether a placement is accepted and, in words, why or why not."""

from __future__ import annotations

import math
from dataclasses import replace

from mapmerge.config import VerifyConfig
from mapmerge.match.base import Match, Rival
from mapmerge.match.confidence import UNRIVALLED, times_as_likely
from mapmerge.match.cues import Cues, Fit
from mapmerge.match.pair import DescribedMap, PairOfMaps
from mapmerge.prior import Prior
from mapmerge.reasons import Reason, ReasonCode
from mapmerge.rounding import percent_below, rounded_down
from mapmerge.verify import Scores, verify


def too_little_structure(target: DescribedMap, source: DescribedMap, config: VerifyConfig) -> Reason | None:
    """Return a refusal if one of the maps has fewer walls than a placement must match, or none at all."""
    least_m = min(target.wall_m, source.wall_m)
    if least_m <= 0.0:
        return Reason(ReasonCode.TOO_LITTLE_STRUCTURE, "one of the maps shows no wall at all")
    if least_m >= config.min_matched_wall_m:
        return None
    message = (
        f"one of the maps shows {rounded_down(least_m, 1):.1f} m of wall, less than {config.min_matched_wall_m:g} m"
    )
    return Reason(ReasonCode.TOO_LITTLE_STRUCTURE, message)


def lacking(scores: Scores, config: VerifyConfig) -> Reason | None:
    """Return a refusal if a placement lacks what every accepted one must have, however sure it is otherwise."""
    for what, found, least, unit in (
        ("m² of ground", scores.overlap_m2, config.min_overlap_m2, "m²"),
        ("m of wall", scores.matched_wall_m, config.min_matched_wall_m, "m"),
    ):
        if found < least:
            message = f"the maps share {rounded_down(found, 1):.1f} {what}, less than {least:g} {unit}"
            return Reason(ReasonCode.TOO_LITTLE_OVERLAP, message)
    if scores.wall_agreement < config.least_agreement:
        agree, least_share = percent_below(scores.wall_agreement, config.least_agreement)
        message = f"of the walls in the overlap {agree} agree, less than {least_share}"
        return Reason(ReasonCode.WALLS_DISAGREE, message)
    return None


def held(scores: Scores, config: VerifyConfig) -> Reason:
    """Return whether a placement that was accepted still has what it must have."""
    message = f"about {scores.overlap_m2:.0f} m² overlap, {_agreeing(scores)} there agree, followed since it was found"
    return lacking(scores, config) or Reason(ReasonCode.ACCEPTED, message)


def judge(scores: Scores, cues: Cues, confidence: float, config: VerifyConfig, other_half: Fit | None = None) -> Reason:
    """Return why a placement is accepted or, what speaks most against it first, why not.

    Parameters
    ----------
    scores, cues, confidence
        Of the placement.
    config
        Settings.
    other_half
        How the maps fit where they do as well turned by half, see `mapmerge.match.weigh.Weighed.other_half`.
    """
    poor = lacking(scores, config)
    if poor is not None:
        return poor
    sure, least_sure = percent_below(confidence, config.min_confidence)
    doubt = f"the confidence is {sure}, less than {least_sure}"
    # of what is as good as refused already, that says nothing: strangers fit a little in many ways
    if other_half is not None and confidence >= config.witness_confidence:
        areas = f"on {other_half.overlap_m2:.0f} m² instead of {scores.overlap_m2:.0f} m²"
        message = (
            f"turned by half, walls agree as well, {areas}: either half of a symmetric building may have been seen"
        )
        return Reason(ReasonCode.AMBIGUOUS, message)
    rival = times_as_likely(-cues.contest.lead_log_odds)
    is_alone = cues.contest.lead_log_odds >= UNRIVALLED
    if confidence >= config.min_confidence:
        message = f"{scores.overlap_m2:.0f} m² overlap, {_agreeing(scores)} there agree, " + (
            "nothing else comes near" if is_alone else f"next best placement {_times(rival)} times as likely"
        )
        return Reason(ReasonCode.ACCEPTED, message)
    if scores.score_m <= 0.0 or scores.wall_agreement < config.poor_agreement:
        return Reason(ReasonCode.WALLS_DISAGREE, f"{_disagreeing(scores, config)}; {doubt}")
    if rival > config.rival_likelihood and cues.contest.log_odds >= 0.0:
        message = f"another placement is {_times(rival)} times as likely as this one; {doubt}"
        return Reason(ReasonCode.AMBIGUOUS, message)
    message = (
        f"on {scores.overlap_m2:.0f} m² {scores.matched_wall_m:.0f} m of wall agree, "
        f"{rounded_down(scores.wall_agreement, 2):.0%} of what can be compared; {doubt}"
    )
    return Reason(ReasonCode.LOW_CONFIDENCE, message)


def _disagreeing(scores: Scores, config: VerifyConfig) -> str:
    agree, least = percent_below(scores.wall_agreement, config.poor_agreement)
    if scores.wall_agreement < config.poor_agreement:
        return f"of the walls in the overlap only {agree} agree, less than {least}"
    return f"of the walls in the overlap {agree} agree, but more speaks against the placement than for it"


def is_far_likelier(one: Match, other: Match, config: VerifyConfig) -> bool:
    """Tell whether a placement that shares and agrees enough leaves another one no chance, see `rival_likelihood`."""
    if one.cues is None or other.cues is None or one.scores is None:
        return False
    is_enough = (
        one.scores.overlap_m2 >= config.min_overlap_m2
        and one.scores.matched_wall_m >= config.min_matched_wall_m
        and one.scores.wall_agreement >= config.least_agreement
    )
    difference = other.cues.contest.log_odds - one.cues.contest.log_odds
    return is_enough and times_as_likely(difference) < config.rival_likelihood


def within(match: Match, prior: Prior) -> Match:
    """Return a refusal that says that only placements within a prior were looked at."""
    message = f"within the spread of the placement {prior.origin}, {match.reason.message}"
    return replace(match, reason=Reason(match.reason.code, message))


def contradicted(match: Match, elsewhere: Match, prior: Prior, pair: PairOfMaps, config: VerifyConfig) -> Match:
    """Return the refusal of a prior that the maps contradict: both placements are shown."""
    believed = pair.believed
    if match.target_from_source is None and believed is not None:
        scores = verify(pair.target.map, pair.source.map, believed, config)
        match = replace(match, target_from_source=pair.between_maps(believed), scores=scores)
    if elsewhere.target_from_source is None or elsewhere.scores is None:
        return match
    true = elsewhere.target_from_source.inverse() if pair.swapped else elsewhere.target_from_source
    message = (
        f"within the spread of the placement {prior.origin} the maps do not fit: {match.reason.message}; they fit at "
        f"{true.x_m:.2f},{true.y_m:.2f},{math.degrees(true.yaw_rad):.1f}deg"
    )
    return replace(
        match,
        reason=Reason(ReasonCode.PRIOR_CONTRADICTED, message),
        rivals=(_as_rival(elsewhere, match), *match.rivals),
    )


def _as_rival(elsewhere: Match, match: Match) -> Rival:
    """Return a placement that was found elsewhere as a rival of a match; both must have a placement."""
    pose, scores = elsewhere.target_from_source, elsewhere.scores
    if pose is None or scores is None:
        raise ValueError("a match without a placement is no rival")
    if elsewhere.cues is None or match.cues is None:
        return Rival(pose, scores.score_m)
    difference = elsewhere.cues.contest.log_odds - match.cues.contest.log_odds
    return Rival(pose, scores.score_m, times_as_likely(difference), elsewhere.cues.fit)


def _agreeing(scores: Scores) -> str:
    return f"{rounded_down(scores.wall_agreement, 2):.0%} of the walls"


def _times(likelihood: float) -> str:
    """Return how many times as likely something is, with as many digits as tell it from 0."""
    if likelihood < 0.001:
        return "less than 0.001"
    if likelihood >= 1000.0:
        return "more than 1000"
    return f"{likelihood:.{3 if likelihood < 0.1 else 2 if likelihood < 10.0 else 0}f}"
