"""The incremental merger: one step for each timestamp at which maps changed.

`MergeState` is the only state there is. It is a value: `step` returns the next one and leaves the old one as it was.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import Any

from mapmerge.config import MergeConfig
from mapmerge.errors import ConfigError
from mapmerge.fuse import fuse
from mapmerge.graph import Edge, Forest, place
from mapmerge.grid import Grid
from mapmerge.match import Match, load_matcher
from mapmerge.outcome import Change, Pair, RobotOutcome, Status, changes_of, outcomes_of
from mapmerge.prior import Prior
from mapmerge.reasons import Reason, ReasonCode
from mapmerge.sim2 import Sim2
from mapmerge.unite import Unions, united
from mapmerge.warp import Layer


@dataclass(frozen=True, slots=True, eq=False)
class MergeResult:
    """All that is known after a step.

    Parameters
    ----------
    robots
        Outcome of each robot, in the order given, the reference first.
    grids
        Latest map of each robot that sent one.
    pairs
        Latest match of each pair of robots with maps, target first.
    priors
        What was believed of each of these pairs when it was matched; pairs of which nothing was are left out.
    merged
        The fused map, in the merged frame, which is the reference's map frame; None until the reference has a map.
    updated
        Robots whose map changed in this step.
    changes
        What was placed, moved or withdrawn in this step.
    """

    robots: Mapping[str, RobotOutcome]
    grids: Mapping[str, Grid]
    pairs: Mapping[Pair, Match]
    priors: Mapping[Pair, Prior]
    merged: Grid | None
    updated: tuple[str, ...]
    changes: tuple[Change, ...]


@dataclass(frozen=True, slots=True, eq=False)
class MergeState:
    """What the merger carries from one step to the next.

    Parameters
    ----------
    result
        The last result.
    matches
        What the matcher said of each pair, before placements that contradict each other are refused.
    prepared
        What the matcher computed for one map, the latest, at one resolution.
    centres_m
        Middle of what each map knows, in its map frame: where placements are compared.
    reported
        Placements as they were last reported in a change.
    unions
        What the matcher said of merged maps.
    """

    result: MergeResult
    matches: Mapping[Pair, Match] = field(default_factory=dict)
    prepared: Mapping[tuple[str, float], Any] = field(default_factory=dict)
    centres_m: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    reported: Mapping[str, Sim2] = field(default_factory=dict)
    unions: Unions = field(default_factory=Unions)

    @staticmethod
    def initial(robots: Sequence[str]) -> MergeState:
        """Return the state before any map, for these robots; the first is the reference.

        Raises
        ------
        ConfigError
            If there is no robot, or one twice.
        """
        if not robots or len(set(robots)) != len(robots):
            raise ConfigError(f"robots are {list(robots)}; expected at least one, each once")
        waiting = Reason(ReasonCode.NO_MAP, "no map that shows anything yet")
        outcomes = {robot: RobotOutcome(Status.NO_MAP, waiting) for robot in robots}
        return MergeState(MergeResult(outcomes, {}, {}, {}, None, (), ()))


def step(
    state: MergeState,
    updates: Mapping[str, Grid],
    config: MergeConfig,
    priors: Mapping[str, Prior] | None = None,
) -> tuple[MergeState, MergeResult]:
    """Take in new maps and return what is known then.

    Maps that say what was known already cost nothing: pairs of unchanged maps are not matched again, unless what is
    believed of them changed. A map in which nothing is known is no map.

    Parameters
    ----------
    state
        What the last step returned.
    updates
        New maps.
    config
        Settings.
    priors
        Where robots' map frames are believed to lie in the reference's. Without a new map they change nothing.

    Raises
    ------
    ConfigError
        If an update is of a robot that is not among those of the state.
    """
    robots = tuple(state.result.robots)
    strangers = sorted(set(updates) - set(robots))
    if strangers:
        raise ConfigError(f"there are maps of {', '.join(strangers)}; expected only maps of {', '.join(robots)}")
    updated = tuple(robot for robot in robots if _is_new(updates.get(robot), state.result.grids.get(robot)))
    if not updated:
        result = replace(state.result, updated=(), changes=())
        return replace(state, result=result), result
    grids = {
        robot: updates[robot] if robot in updated else state.result.grids[robot]
        for robot in robots
        if robot in updated or robot in state.result.grids
    }
    maps = {robot: grid for robot, grid in grids.items() if grid.known.any()}
    believed = _pair_priors(robots[0], list(combinations(maps, 2)), priors or {}, state.result.priors)
    alone, prepared = _matched(state, maps, updated, config, believed)
    centres_m = {robot: maps[robot].middle_m if robot in updated else state.centres_m[robot] for robot in maps}
    matches, forest, unions = _linked(state.unions.without(updated), maps, centres_m, alone, believed, config)
    pairs = _without_contradicted(matches, forest)
    layers = _layers(robots[0], maps, forest)
    fusion = fuse(list(layers.values()), grids[robots[0]], config.cells) if layers else None
    outcomes = outcomes_of(robots, pairs, forest, layers, fusion)
    changes, reported = changes_of(robots[0], outcomes, state.reported, centres_m, config)
    merged = fusion.grid if fusion else None
    result = MergeResult(outcomes, grids, pairs, believed, merged, updated, changes)
    return MergeState(result, alone, prepared, centres_m, reported, unions), result


def _is_new(update: Grid | None, known: Grid | None) -> bool:
    return update is not None and (known is None or not update.same_as(known))


def _matched(
    state: MergeState,
    grids: Mapping[str, Grid],
    updated: Sequence[str],
    config: MergeConfig,
    priors: Mapping[Pair, Prior],
) -> tuple[dict[Pair, Match], dict[tuple[str, float], Any]]:
    """Match every pair of which a map, or what is believed of it, changed; keep the matches of the others."""
    matcher = load_matcher(config.method)
    prepared = {key: value for key, value in state.prepared.items() if key[0] not in updated}
    pairs: dict[Pair, Match] = {}
    for pair in combinations(grids, 2):
        believed_as_before = priors.get(pair) is state.result.priors.get(pair)
        if pair in state.matches and believed_as_before and not set(pair) & set(updated):
            pairs[pair] = state.matches[pair]
            continue
        resolution_m = max(config.search.working_cell_m, *(grids[robot].resolution_m for robot in pair))
        for robot in pair:
            if (robot, resolution_m) not in prepared:
                prepared[robot, resolution_m] = matcher.prepare(grids[robot], resolution_m, config)
        target, source = (prepared[robot, resolution_m] for robot in pair)
        pairs[pair] = matcher.match(target, source, config, priors.get(pair))
    return pairs, prepared


def _pair_priors(
    reference: str, pairs: Sequence[Pair], priors: Mapping[str, Prior], before: Mapping[Pair, Prior]
) -> dict[Pair, Prior]:
    """Return what is believed of each pair: the very value of before, where it differs from that by jitter only."""
    believed: dict[Pair, Prior] = {}
    for pair in pairs:
        prior, known = _prior_of(pair, reference, priors), before.get(pair)
        if prior is not None:
            believed[pair] = known if known is not None and known.is_about(prior) else prior
    return believed


def _prior_of(pair: Pair, reference: str, priors: Mapping[str, Prior]) -> Prior | None:
    """Return what is believed of a pair, from what is believed of both robots' places in the reference's frame."""
    target, source = pair
    if source not in priors or (target != reference and target not in priors):
        return None
    return priors[source] if target == reference else priors[target].inverse().compose(priors[source])


def _linked(
    unions: Unions,
    maps: Mapping[str, Grid],
    centres_m: Mapping[str, tuple[float, float]],
    alone: Mapping[Pair, Match],
    believed: Mapping[Pair, Prior],
    config: MergeConfig,
) -> tuple[dict[Pair, Match], Forest, Unions]:
    """Place robots by the matches of pairs, then those that only merged maps can place, one after the other."""
    matcher = load_matcher(config.method)
    matches = dict(alone)
    forest = _placed(centres_m, matches, config)
    while True:
        found, unions = united(forest, maps, alone, believed, unions, matcher, config)
        if found is None:
            return matches, forest, unions
        matches[found[0]] = found[1]
        forest = _placed(centres_m, matches, config)


def _placed(centres_m: Mapping[str, tuple[float, float]], pairs: Mapping[Pair, Match], config: MergeConfig) -> Forest:
    edges = [
        Edge(target, source, match.target_from_source, match.trust, centres_m[source])
        for (target, source), match in pairs.items()
        if match.accepted and match.target_from_source is not None
    ]
    limits = config.verify
    return place(list(centres_m), edges, distance_m=limits.distinct_m, angle_rad=limits.distinct_rad)


def _without_contradicted(pairs: dict[Pair, Match], forest: Forest) -> dict[Pair, Match]:
    """Refuse the matches that the placement of all robots contradicts."""
    message = "the pair fits by itself, but contradicts better placements of the same robots"
    reason = Reason(ReasonCode.INCONSISTENT, message)
    refused = {(edge.target, edge.source) for edge in forest.contradicted}
    return {
        pair: replace(match, accepted=False, reason=reason) if pair in refused else match
        for pair, match in pairs.items()
    }


def _layers(reference: str, grids: Mapping[str, Grid], forest: Forest) -> dict[str, Layer]:
    """Return the maps that are linked to the reference; none until it has a map."""
    if reference not in grids:
        return {}
    return {
        robot: Layer(grids[robot], placement.component_from_map)
        for robot, placement in forest.placements.items()
        if placement.component == reference
    }
