"""Robots' maps as witnesses for each other: what no pair of maps can tell, several may.

Robots that are linked already say together where another one lies. Each of two pairs may be a little less sure than
is asked for; if both put the robot in the same place, they are surer together. And a robot that shares a little ground
with each, too little to be placed on any, may share enough with their merged map.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

from mapmerge.config import HIGHEST_CONFIDENCE, MergeConfig, VerifyConfig
from mapmerge.graph import Forest
from mapmerge.grid import Grid
from mapmerge.match import Match
from mapmerge.outcome import Pair
from mapmerge.reasons import Reason, ReasonCode
from mapmerge.unions import Robots, Unions

_UNCONTESTED = {ReasonCode.LOW_CONFIDENCE, ReasonCode.WALLS_DISAGREE}


@dataclass(frozen=True, slots=True, eq=False)
class Link:
    """A match between two robots that others' maps made possible: merged ones, or those that agree with it.

    Parameters
    ----------
    pair, match
        The robots, and what is said of them.
    merged
        Whose maps were merged for it; None if none were.
    """

    pair: Pair
    match: Match
    merged: tuple[Robots, Robots] | None


def components(forest: Forest) -> dict[str, Robots]:
    """Return the robots that are linked with each other, by the robot in whose map frame they are placed."""
    found: dict[str, list[str]] = {}
    for robot, placement in forest.placements.items():
        found.setdefault(placement.component, []).append(robot)
    return {root: tuple(robots) for root, robots in found.items()}


def united(
    forest: Forest,
    grids: Mapping[str, Grid],
    matches: Mapping[Pair, Match],
    believed: Collection[Pair],
    unions: Unions,
    config: MergeConfig,
) -> Link | None:
    """Return the surest match that several maps agree on, or that merged maps give; None if there is none.

    Merged maps are tried only where one of them has several robots, some pair of robots was not hopeless, and nothing
    is believed beforehand. Their match is between the robots in whose frames they are.

    Parameters
    ----------
    forest
        Placements so far.
    grids
        All maps.
    matches
        What is said of each pair of maps.
    believed
        Pairs of which something is believed beforehand.
    unions
        What merged maps say.
    config
        Settings.
    """
    groups = components(forest)
    best: Link | None = None
    for one, two in combinations(groups, 2):
        key = groups[one], groups[two]
        between = [pair for pair in matches if set(pair) & set(key[0]) and set(pair) & set(key[1])]
        if max(map(len, key)) < 2 or set(between) & set(believed):
            continue
        witnessed = agreed(between, forest, grids, matches, config)
        found = Link(*witnessed, merged=None) if witnessed else None
        if found is None and _is_hopeful(between, matches, config):
            found = Link((one, two), _named(unions.match(key, forest, grids), key), key)
        if found and found.match.accepted and (best is None or _surety(found.match) > _surety(best.match)):
            best = found
    return best


def agreed(
    between: Sequence[Pair],
    forest: Forest,
    grids: Mapping[str, Grid],
    matches: Mapping[Pair, Match],
    config: MergeConfig,
) -> tuple[Pair, Match] | None:
    """Return the surest refused match between two groups with the confidence that those which agree with it give it.

    Only matches count that no rival contests and that are nearly sure by themselves: of look-alike places, all maps
    of one would tell the same lie.

    Returns
    -------
    pair, match
        Accepted, if they are sure enough together; None if fewer than two count.
    """
    limits = config.verify
    counted = [pair for pair in between if _may_witness(matches[pair], limits)]
    if len(counted) < 2:
        return None
    best, *others = sorted(counted, key=lambda pair: _surety(matches[pair]), reverse=True)
    agreeing = [pair for pair in others if _agree(pair, best, forest, grids, matches, config)]
    # more than one witness is no surer: they saw the same place, and may err together
    confidences = [matches[pair].confidence or 0.0 for pair in (best, *agreeing[:1])]
    doubt = math.prod(1.0 - confidence for confidence in confidences)
    match = matches[best]
    if not agreeing or confidences[0] < limits.nearly_sure_confidence or 1.0 - doubt < limits.min_confidence:
        return None
    witnesses = 1 + len(agreeing)
    message = f"{witnesses} pairs of maps agree where {best[1]} lies on {best[0]}; by itself, {match.reason.message}"
    return best, replace(
        match,
        accepted=True,
        confidence=min(1.0 - doubt, HIGHEST_CONFIDENCE),
        reason=Reason(ReasonCode.ACCEPTED, message),
    )


def _may_witness(match: Match, limits: VerifyConfig) -> bool:
    """Tell whether a refused match has no rival, is nearly sure, and lacks nothing that every match must have."""
    rival = max((rival.likelihood or 0.0 for rival in match.rivals), default=0.0)
    return (
        match.reason.code in _UNCONTESTED
        and rival <= limits.rival_likelihood
        and (match.confidence or 0.0) >= limits.witness_confidence
        and match.scores is not None
        and match.scores.wall_agreement >= limits.least_agreement
    )


def _agree(
    one: Pair,
    other: Pair,
    forest: Forest,
    grids: Mapping[str, Grid],
    matches: Mapping[Pair, Match],
    config: MergeConfig,
) -> bool:
    """Tell whether two matches between the same two groups put one group at the same place of the other."""
    if one == other:
        return True
    poses = []
    for target, source in (one, other):
        found = matches[target, source].target_from_source
        if found is None:
            return False
        target_frame, source_frame = (forest.placements[robot] for robot in (target, source))
        pose = target_frame.component_from_map @ found @ source_frame.component_from_map.inverse()
        poses.append(pose if target_frame.component == forest.placements[one[0]].component else pose.inverse())
    at = forest.placements[one[1]].component_from_map.apply_point(*grids[one[1]].middle_m)
    limits = config.verify
    return poses[0].is_close(poses[1], distance_m=limits.distinct_m, angle_rad=limits.distinct_rad, at_m=at)


def _is_hopeful(between: Sequence[Pair], matches: Mapping[Pair, Match], config: MergeConfig) -> bool:
    """Tell whether any of these pairs has a placement that may be right."""
    return any((matches[pair].confidence or 0.0) >= config.verify.hopeful_confidence for pair in between)


def _surety(match: Match) -> tuple[float, float]:
    return match.confidence or 0.0, match.scores.score_m if match.scores else 0.0


def _named(match: Match, key: tuple[Robots, Robots]) -> Match:
    """Return the match with a reason that says which maps were merged for it."""
    several = " and ".join(f"those of {', '.join(robots)} merged" for robots in key if len(robots) > 1)
    return replace(match, reason=Reason(match.reason.code, f"{match.reason.message} ({several})"))
