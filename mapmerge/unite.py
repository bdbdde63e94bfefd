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
from typing import Any

from mapmerge.config import HIGHEST_CONFIDENCE, MergeConfig, VerifyConfig
from mapmerge.evidence import Evidence
from mapmerge.fuse import fuse
from mapmerge.graph import Forest
from mapmerge.grid import Grid
from mapmerge.match import Match, Matcher
from mapmerge.outcome import Pair
from mapmerge.pairs import News
from mapmerge.reasons import Reason, ReasonCode
from mapmerge.sim2 import Sim2
from mapmerge.warp import Layer
from mapmerge.watch import Trigger, Watch

Robots = tuple[str, ...]
Placed = tuple[tuple[str, Sim2], ...]

_UNCONTESTED = {ReasonCode.LOW_CONFIDENCE, ReasonCode.WALLS_DISAGREE}


@dataclass(frozen=True, slots=True, eq=False)
class _Union:
    """What the matcher said of two merged maps, and where their maps lay then."""

    match: Match
    places: tuple[Placed, Placed]
    watch: Watch


class Unions:
    """Matches of merged maps, kept until their maps have grown, moved, or changed often enough.

    Parameters
    ----------
    matcher, config
        The method and its settings.

    Attributes
    ----------
    searched
        Which of them were searched since the last update, and why.
    """

    def __init__(self, matcher: Matcher[Any], config: MergeConfig) -> None:
        self._matcher, self._config = matcher, config
        self._known: dict[tuple[Robots, Robots], _Union] = {}
        self._fresh: set[tuple[Robots, Robots]] = set()
        self._is_last = False
        self.searched: dict[tuple[Robots, Robots], Trigger] = {}

    @property
    def matches(self) -> dict[tuple[Robots, Robots], Match]:
        """The matches, by the robots of both merged maps."""
        return {key: union.match for key, union in self._known.items()}

    def update(self, maps: Collection[str], news: News) -> None:
        """Take in what changed, before matches are asked for."""
        asked, self._fresh, self.searched = self._fresh, set(), {}
        for key, union in list(self._known.items()):
            robots = set(sum(key, ()))
            is_gone = key not in asked or not robots <= set(maps)
            if is_gone or robots & news.jumped or news.reference in news.jumped:
                del self._known[key]
            elif robots & news.updated:
                self._known[key] = replace(union, watch=union.watch.updated())
        self._is_last = news.is_last

    def match(self, key: tuple[Robots, Robots], forest: Forest, grids: Mapping[str, Grid]) -> Match:
        """Return what the matcher says of two merged maps; it is asked only if it may say something else now."""
        places = _places(key[0], forest), _places(key[1], forest)
        areas_m2 = sum(grids[name].known_area_m2 for name in key[0]), sum(grids[name].known_area_m2 for name in key[1])
        union = self._known.get(key)
        trigger = None if key in self._fresh else self._due(union, places, areas_m2, grids)
        self._fresh.add(key)
        if union is not None and trigger is None:
            return union.match
        target, source = self._prepared(places, grids)
        match = self._matcher.match(target, source, self._config)
        watch = Watch.of(match, areas_m2, union.watch if union else None, self._config.watch)
        self._known[key] = _Union(match, places, watch)
        self.searched[key] = trigger or Trigger.FIRST
        return match

    def explain(self, key: tuple[Robots, Robots], grids: Mapping[str, Grid]) -> tuple[Evidence, ...]:
        """Return what the matcher saw of two merged maps that it was asked for."""
        union = self._known[key]
        target, source = self._prepared(union.places, grids)
        return self._matcher.explain(target, source, union.match, self._config)

    def _prepared(self, places: tuple[Placed, Placed], grids: Mapping[str, Grid]) -> list[Any]:
        merged = [_merged(placed, grids, self._config) for placed in places]
        resolution_m = max(self._config.search.working_cell_m, *(grid.resolution_m for grid in merged))
        return [self._matcher.prepare(grid, resolution_m, self._config) for grid in merged]

    def _due(
        self,
        union: _Union | None,
        places: tuple[Placed, Placed],
        areas_m2: tuple[float, float],
        grids: Mapping[str, Grid],
    ) -> Trigger | None:
        """Return why merged maps are to be searched; a placement that they gave stands until then."""
        if union is None:
            return Trigger.FIRST
        if self._is_last and union.watch.searched.updates:
            return Trigger.END
        if any(self._moved(was, now, grids) for was, now in zip(union.places, places, strict=True)):
            return Trigger.CHANGED
        limits = self._config.watch
        if not union.match.accepted:
            return Trigger.RETRY if union.watch.is_glance_due(areas_m2, limits) else None
        grew = union.watch.searched.is_due(areas_m2, limits.glance_growth, limits.longest_search_wait)
        return Trigger.MAPS_GREW if grew else None

    def _moved(self, was: Placed, now: Placed, grids: Mapping[str, Grid]) -> bool:
        """Tell whether a robot's place in its component is another one."""
        limits = self._config
        return any(
            not pose.is_close(before, distance_m=limits.moved_m, angle_rad=limits.moved_rad, at_m=grids[robot].middle_m)
            for (robot, pose), (_, before) in zip(now, was, strict=True)
        )


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


def _places(robots: Robots, forest: Forest) -> Placed:
    return tuple((robot, forest.placements[robot].component_from_map) for robot in robots)


def _merged(placed: Placed, grids: Mapping[str, Grid], config: MergeConfig) -> Grid:
    """Return the merged map of linked robots, in the map frame of the first, on the cells of the one that knows most.

    So the cells, and what is found with them, do not depend on the order of the robots.
    """
    if len(placed) == 1:
        return grids[placed[0][0]]
    component_from = dict(placed)
    base = max(component_from, key=lambda robot: (grids[robot].known_area_m2, robot))
    component_from_base = component_from[base]
    base_from_component = component_from_base.inverse()
    layers = [Layer(grids[robot], base_from_component @ component_from[robot]) for robot in sorted(component_from)]
    merged = fuse(layers, grids[base], config.cells).grid
    return Grid(merged.cells, merged.resolution_m, component_from_base @ merged.map_from_grid)


def _surety(match: Match) -> tuple[float, float]:
    return match.confidence or 0.0, match.scores.score_m if match.scores else 0.0


def _named(match: Match, key: tuple[Robots, Robots]) -> Match:
    """Return the match with a reason that says which maps were merged for it."""
    several = " and ".join(f"those of {', '.join(robots)} merged" for robots in key if len(robots) > 1)
    return replace(match, reason=Reason(match.reason.code, f"{match.reason.message} ({several})"))
