"""Robots' maps as witnesses for each other: what no pair of maps can tell, merged maps may.

Robots that are linked already have one map together. A robot that shares a little ground with each of them, too little
to be placed on any, may share enough with all.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import Any

from mapmerge.config import MergeConfig
from mapmerge.fuse import Layer, fuse
from mapmerge.graph import Forest
from mapmerge.grid import Grid
from mapmerge.match import Match, Matcher
from mapmerge.outcome import Pair
from mapmerge.reasons import Reason

Robots = tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Unions:
    """Matches of merged maps, by the robots of both, for as long as none of their maps changes."""

    matches: Mapping[tuple[Robots, Robots], Match] = field(default_factory=dict)

    def without(self, updated: Sequence[str]) -> Unions:
        """Return the matches that are of none of these robots."""
        kept = {key: match for key, match in self.matches.items() if not {*key[0], *key[1]} & set(updated)}
        return Unions(kept)


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
    unions: Unions,
    matcher: Matcher[Any],
    config: MergeConfig,
) -> tuple[tuple[Pair, Match] | None, Unions]:
    """Return the surest match of merged maps, between the robots in whose frames they are, and all that were tried.

    Only those are tried of which at least one has several robots and some pair of robots was not hopeless.

    Parameters
    ----------
    forest
        Placements so far.
    grids
        All maps.
    matches
        What is said of each pair of maps.
    unions
        What was tried before.
    matcher, config
        The method and its settings.
    """
    tried = dict(unions.matches)
    groups = components(forest)
    best: tuple[Pair, Match] | None = None
    for one, two in combinations(groups, 2):
        key = groups[one], groups[two]
        if max(map(len, key)) < 2 or not _is_hopeful(key, matches, config):
            continue
        if key not in tried:
            target, source = (_merged(robots, forest, grids, config) for robots in key)
            tried[key] = _matched(target, source, matcher, config)
        match = tried[key]
        if match.accepted and (best is None or _surety(match) > _surety(best[1])):
            best = (one, two), _named(match, key)
    return best, Unions(tried)


def _is_hopeful(key: tuple[Robots, Robots], matches: Mapping[Pair, Match], config: MergeConfig) -> bool:
    """Tell whether of any pair of robots of the two groups there is a placement that may be right."""
    pairs = (match for (a, b), match in matches.items() if {a, b} & set(key[0]) and {a, b} & set(key[1]))
    return any((match.confidence or 0.0) >= config.verify.hopeful_confidence for match in pairs)


def _merged(robots: Robots, forest: Forest, grids: Mapping[str, Grid], config: MergeConfig) -> Grid:
    """Return the merged map of linked robots, in the map frame of the first."""
    if len(robots) == 1:
        return grids[robots[0]]
    layers = [Layer(grids[robot], forest.placements[robot].component_from_map) for robot in robots]
    return fuse(layers, grids[robots[0]], config.cells).grid


def _matched(target: Grid, source: Grid, matcher: Matcher[Any], config: MergeConfig) -> Match:
    resolution_m = max(config.search.working_cell_m, target.resolution_m, source.resolution_m)
    prepared = [matcher.prepare(grid, resolution_m, config) for grid in (target, source)]
    return matcher.match(prepared[0], prepared[1], config)


def _surety(match: Match) -> tuple[float, float]:
    return match.confidence or 0.0, match.scores.score_m if match.scores else 0.0


def _named(match: Match, key: tuple[Robots, Robots]) -> Match:
    """Return the match with a reason that says which maps were merged for it."""
    several = " and ".join(f"those of {', '.join(robots)} merged" for robots in key if len(robots) > 1)
    return replace(match, reason=Reason(match.reason.code, f"{match.reason.message} ({several})"))
