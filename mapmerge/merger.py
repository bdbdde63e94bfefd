"""The incremental merger: one step for each timestamp at which maps changed.

A `Merger` owns all that is kept from one step to the next, and changes it in place; the results that it returns are
values, which stay as they are.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from mapmerge.config import MergeConfig
from mapmerge.errors import ConfigError
from mapmerge.evidence import Evidence
from mapmerge.extents import Extent, first_too_large
from mapmerge.fuse import Canvas, Fusion
from mapmerge.graph import Edge, Forest, place
from mapmerge.grid import MAX_SIDE_CELLS, UNKNOWN, Grid
from mapmerge.jump import jump
from mapmerge.lattice import changed_box, offset_cells
from mapmerge.match import Match, load_matcher
from mapmerge.outcome import Change, Looked, Pair, RobotOutcome, Status, changes_of, outcomes_of
from mapmerge.pairs import Mapped, News, Pairs
from mapmerge.plane import Box, read
from mapmerge.prior import Prior
from mapmerge.reasons import Reason, ReasonCode
from mapmerge.sim2 import Sim2
from mapmerge.unions import Robots, Unions
from mapmerge.unite import components, united
from mapmerge.warp import Layer
from mapmerge.watch import Trigger


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
    searched
        Which pairs were searched in this step, and why; the placements of the others were followed, or kept.
    merged
        The fused map, in the merged frame, which is the reference's map frame; None until the reference has a map. The
        very same grid as in the last result if none of its cells changed.
    updated
        Robots whose map changed in this step.
    changes
        What jumped, or was placed, moved or withdrawn in this step.
    centres_m
        Of each robot with a map, the middle of the rectangle around what it knows, in its map frame.
    """

    robots: Mapping[str, RobotOutcome]
    grids: Mapping[str, Grid]
    pairs: Mapping[Pair, Match]
    priors: Mapping[Pair, Prior]
    searched: Mapping[Pair, Trigger]
    merged: Grid | None
    updated: tuple[str, ...]
    changes: tuple[Change, ...]
    centres_m: Mapping[str, tuple[float, float]]

    @property
    def poses(self) -> dict[str, Sim2]:
        """Where the map frame of each robot that is placed lies in the merged frame; the reference's is there, too."""
        placed = {robot: outcome.merged_from_map for robot, outcome in self.robots.items()}
        return {robot: pose for robot, pose in placed.items() if pose is not None}

    def __str__(self) -> str:
        """Return a line for each robot: what became of its map, where it lies, and why."""
        return "\n".join(f"{robot}: {outcome}" for robot, outcome in self.robots.items())

    def __repr__(self) -> str:
        """Return the robots and what became of them; the maps would fill the screen."""
        statuses = ", ".join(f"{robot}: {outcome.status}" for robot, outcome in self.robots.items())
        return f"<MergeResult {statuses}>"


class Merger:
    """Takes in robots' maps as they come, and says what is known then.

    Parameters
    ----------
    robots
        The robots; the first is the reference.
    config
        Settings.
    mapped
        How searches of several pairs are run: `map`, one after the other, or that of a pool of threads. The outcome is
        the same.

    Raises
    ------
    ConfigError
        If there is no robot, or one twice, or no such method.
    """

    def __init__(self, robots: Sequence[str], config: MergeConfig | None = None, mapped: Mapped = map) -> None:
        if not robots or len(set(robots)) != len(robots):
            raise ConfigError(f"robots are {list(robots)}; expected at least one, each once")
        self._config = config or MergeConfig()
        matcher = load_matcher(self._config.method)
        self._maps: dict[str, Grid] = {}
        self._known: dict[str, _Known] = {}
        self._pairs = Pairs(matcher, self._config, mapped)
        self._unions = Unions(matcher, self._config)
        self._of_merged_maps: dict[Pair, tuple[Robots, Robots]] = {}
        self._canvas = Canvas(self._config.cells)
        self._reported: dict[str, Sim2] = {}
        waiting = Reason(ReasonCode.NO_MAP, "no map that shows anything yet")
        outcomes = {robot: RobotOutcome(Status.NO_MAP, waiting) for robot in robots}
        self.result = MergeResult(outcomes, {}, {}, {}, {}, None, (), (), {})

    def step(
        self, updates: Mapping[str, Grid], priors: Mapping[str, Prior] | None = None, *, is_last: bool = False
    ) -> MergeResult:
        """Take in new maps and return what is known then.

        Maps that say what was known already cost nothing. Placements are followed as maps grow, and searched anew when
        that may tell more: `mapmerge.watch` says when. A map in which nothing is known is no map.

        Parameters
        ----------
        updates
            New maps.
        priors
            Where robots' map frames are believed to lie in the reference's. Without a new map they change nothing,
            unless these are the last maps.
        is_last
            Whether these are the last maps: whatever was only followed since it was searched is searched once more, so
            that the outcome is that of the last maps alone.

        Raises
        ------
        ConfigError
            If an update is of a robot that is not among those of the merger.
        """
        robots = tuple(self.result.robots)
        strangers = sorted(set(updates) - set(robots))
        if strangers:
            raise ConfigError(f"there are maps of {', '.join(strangers)}; expected only maps of {', '.join(robots)}")
        arrivals = {robot: self._arrival(robot, updates[robot]) for robot in robots if robot in updates}
        new = {robot: arrival for robot, arrival in arrivals.items() if arrival is not None}
        updated = tuple(new)
        if not updated and not is_last:
            self.result = replace(self.result, updated=(), changes=(), searched={})
            return self.result
        jumped = self._take(new)
        changed = {robot: arrival.changed for robot, arrival in new.items() if arrival.changed is not None}
        latest = {**self.result.grids, **{robot: arrival.grid for robot, arrival in new.items()}}
        grids = {robot: latest[robot] for robot in robots if robot in latest}
        believed = _pair_priors(robots[0], list(combinations(self._maps, 2)), priors or {}, self.result.priors)
        news = News(frozenset(updated), frozenset(jumped), robots[0], is_last)
        alone = self._match_pairs(believed, news)
        matches, forest = self._linked(believed)
        searched = self._searched(alone)
        pairs = _without_contradicted(matches, forest)
        layers = _layers(robots[0], self._maps, forest)
        fusion = self._fused(layers, grids.get(robots[0]), changed)
        outcomes = outcomes_of(robots, pairs, forest, layers, fusion)
        changes = self._changes(outcomes, searched, jumped)
        merged = fusion.grid if fusion else None
        centres_m = {robot: self._known[robot].centre_m for robot in self._maps}
        self.result = MergeResult(outcomes, grids, pairs, believed, searched, merged, updated, changes, centres_m)
        return self.result

    @property
    def unions(self) -> Mapping[tuple[Robots, Robots], Match]:
        """What the matcher said of merged maps, by the robots of both."""
        return self._unions.matches

    def explain(self, pair: Pair) -> tuple[Evidence, ...]:
        """Return what the matcher saw of a pair of maps, or of those that were merged for it, as of the last step.

        What it holds of the maps may be changed by the next step.
        """
        if pair in self._of_merged_maps:
            return self._unions.explain(self._of_merged_maps[pair], self._maps)
        return self._pairs.explain(pair, self._maps)

    def _arrival(self, robot: str, grid: Grid) -> _Arrival | None:
        """Return a map that came, or None if it says what was known already."""
        known, before, last = grid.cropped_to_known(), self._maps.get(robot), self.result.grids.get(robot)
        if before is None:
            return _Arrival(grid, known, None) if last is None or known.cells.size else None
        changed = changed_box(before, known)
        says_the_same = changed is not None and changed.is_empty
        return None if says_the_same and last is not None and grid.covers_as(last) else _Arrival(grid, known, changed)

    def _take(self, new: Mapping[str, _Arrival]) -> dict[str, Reason]:
        """Take in maps that are new; return whose map jumped."""
        jumped: dict[str, Reason] = {}
        for robot, arrival in new.items():
            before, known = self._maps.pop(robot, None), self._known.pop(robot, None)
            after, changed = arrival.known, arrival.changed
            if after.cells.size == 0:
                continue
            self._maps[robot] = after
            cells = _known_cells(before, after, changed, known)
            self._known[robot] = _Known(cells, cells * after.resolution_m**2, after.middle_m)
            if before is None or known is None:
                continue
            reason = jump(before, after, changed, known.area_m2, self._config)
            if reason is not None:
                jumped[robot] = reason
        # in the order of the robots, whenever their maps came
        self._maps = {robot: self._maps[robot] for robot in self.result.robots if robot in self._maps}
        return jumped

    def _match_pairs(self, believed: Mapping[Pair, Prior], news: News) -> dict[Pair, Trigger]:
        """Bring the matches of pairs up to date; return which were searched, and why."""
        areas_m2 = {robot: known.area_m2 for robot, known in self._known.items()}
        self._unions.update(self._maps, news)
        return self._pairs.update(self._maps, areas_m2, believed, news)

    def _searched(self, alone: Mapping[Pair, Trigger]) -> dict[Pair, Trigger]:
        """Return why pairs were searched; of those whose match is that of merged maps, why these were."""
        of_unions = {pair: self._unions.searched.get(key) for pair, key in self._of_merged_maps.items()}
        both = {**alone, **of_unions}
        return {pair: trigger for pair, trigger in both.items() if trigger is not None}

    def _linked(self, believed: Mapping[Pair, Prior]) -> tuple[dict[Pair, Match], Forest]:
        """Place robots by the matches of pairs, then those that only merged maps can place, one after the other."""
        alone = dict(self._pairs.matches)
        matches = dict(alone)
        centres_m = {robot: self._known[robot].centre_m for robot in self._maps}
        forest = self._placed(centres_m, alone, matches)
        self._of_merged_maps.clear()
        while link := united(forest, self._maps, alone, believed, self._unions, self._config):
            matches[link.pair] = link.match
            if link.merged is not None:
                self._of_merged_maps[link.pair] = link.merged
            forest = self._placed(centres_m, alone, matches)
            if matches[link.pair].reason.code is ReasonCode.TOO_LARGE:
                break  # it would be found again
        return matches, forest

    def _placed(
        self, centres_m: Mapping[str, tuple[float, float]], alone: dict[Pair, Match], matches: dict[Pair, Match]
    ) -> Forest:
        """Place robots; refuse those matches, also among those of pairs alone, with which a merged map is too large."""
        forest = _placed(centres_m, matches, self._config)
        while too_large := self._too_large(forest):
            robot, extent = too_large
            via = forest.placements[robot].via
            pair = next(pair for pair in matches if set(pair) == {robot, via})
            cols, rows = extent.sides_cells
            message = (
                f"placed there, the merged map would have {cols} × {rows} cells; "
                f"at most {self._config.max_canvas_cells}, and {MAX_SIDE_CELLS} a side, are made"
            )
            refused = replace(matches[pair], accepted=False, reason=Reason(ReasonCode.TOO_LARGE, message))
            matches[pair] = alone[pair] = refused
            forest = _placed(centres_m, matches, self._config)
        return forest

    def _too_large(self, forest: Forest) -> tuple[str, Extent] | None:
        """Return a robot that makes the merged map of those linked with it too large; None if there is none."""
        for robots in components(forest).values():
            placed = [(robot, forest.placements[robot].component_from_map) for robot in robots]
            found = first_too_large(self._maps, placed, self._config.max_canvas_cells)
            if found is not None:
                return found
        return None

    def _fused(self, layers: Mapping[str, Layer], lattice: Grid | None, changed: Mapping[str, Box]) -> Fusion | None:
        if not layers or lattice is None:
            # without the reference's map it is not kept up to date
            self._canvas = Canvas(self._config.cells)
            return None
        return self._canvas.update(layers, lattice, changed)

    def _changes(
        self, outcomes: Mapping[str, RobotOutcome], searched: Mapping[Pair, Trigger], jumped: Mapping[str, Reason]
    ) -> tuple[Change, ...]:
        shown_before = {robot: outcome.shown_pair for robot, outcome in self.result.robots.items()}
        centres_m = {robot: known.centre_m for robot, known in self._known.items()}
        looked = Looked(searched, jumped, shown_before)
        changes, self._reported = changes_of(outcomes, self._reported, centres_m, looked, self._config)
        return changes


@dataclass(frozen=True, slots=True, eq=False)
class _Arrival:
    """A map that came: all of it, what it knows, and the box of `mapmerge.lattice.changed_box` since the one before."""

    grid: Grid
    known: Grid
    changed: Box | None


@dataclass(frozen=True, slots=True)
class _Known:
    """What a map knows: how many cells, their area, and the middle of the rectangle around them in the map frame."""

    cells: int
    area_m2: float
    centre_m: tuple[float, float]


def _known_cells(before: Grid | None, after: Grid, changed: Box | None, known: _Known | None) -> int:
    """Return how many cells a map knows, counted only where it changed."""
    if before is None or known is None or changed is None:
        return int(np.count_nonzero(after.known))
    offset = offset_cells(before, after) or (0, 0)
    return (
        known.cells
        + int(np.count_nonzero(read(after.cells, changed, UNKNOWN) >= 0))
        - int(np.count_nonzero(read(before.cells, changed.shifted(*offset), UNKNOWN) >= 0))
    )


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
