"""The incremental merger: one step for each timestamp at which maps changed.

A `Merger` owns all that is kept from one step to the next, and changes it in place; the results that it returns are
values, which stay as they are.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import combinations

from mapmerge.config import MergeConfig
from mapmerge.errors import ConfigError
from mapmerge.evidence import Evidence
from mapmerge.extents import Extent, first_too_large
from mapmerge.fuse import Canvas, Fusion
from mapmerge.graph import Edge, Forest, place
from mapmerge.grid import MAX_SIDE_CELLS, Grid
from mapmerge.held_maps import HeldMaps
from mapmerge.match import Match, load_matcher
from mapmerge.outcome import Change, Looked, Pair, RobotOutcome, changes_of, outcomes_of
from mapmerge.pair_priors import pair_priors
from mapmerge.pairs import Mapped, News, Pairs
from mapmerge.plane import Box
from mapmerge.prior import Prior
from mapmerge.reasons import Reason, ReasonCode
from mapmerge.result import MergeResult, nothing_known
from mapmerge.sim2 import Sim2
from mapmerge.unions import Robots, Unions
from mapmerge.unite import components, united
from mapmerge.warp import Layer
from mapmerge.watch import Trigger


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
        self._held = HeldMaps(robots, self._config)
        self._pairs = Pairs(matcher, self._config, mapped)
        self._unions = Unions(matcher, self._config)
        self._of_merged_maps: dict[Pair, tuple[Robots, Robots]] = {}
        self._canvas = Canvas(self._config.cells)
        self._reported: dict[str, Sim2] = {}
        self.result = nothing_known(robots)

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
        new = self._held.take(updates)
        if not new.updated and not is_last:
            self.result = replace(self.result, updated=(), changes=(), searched={})
            return self.result
        grids, centres_m = self._held.latest, self._held.centres_m
        pairs_of_maps = list(combinations(self._held.cropped, 2))
        believed = pair_priors(robots[0], pairs_of_maps, priors or {}, self.result.priors)
        news = News(frozenset(new.updated), frozenset(new.jumped), robots[0], is_last)
        alone = self._match_pairs(believed, news)
        matches, forest = self._linked(believed)
        searched = self._searched(alone)
        pairs = _without_contradicted(matches, forest)
        layers = _layers(robots[0], self._held.cropped, forest)
        fusion = self._fused(layers, grids.get(robots[0]), new.changed)
        outcomes = outcomes_of(robots, pairs, forest, layers, fusion)
        changes = self._changes(outcomes, searched, new.jumped)
        merged = fusion.grid if fusion else None
        self.result = MergeResult(outcomes, grids, pairs, believed, searched, merged, new.updated, changes, centres_m)
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
            return self._unions.explain(self._of_merged_maps[pair], self._held.cropped)
        return self._pairs.explain(pair, self._held.cropped)

    def _match_pairs(self, believed: Mapping[Pair, Prior], news: News) -> dict[Pair, Trigger]:
        """Bring the matches of pairs up to date; return which were searched, and why."""
        self._unions.update(self._held.cropped, news)
        return self._pairs.update(self._held.cropped, self._held.areas_m2, believed, news)

    def _searched(self, alone: Mapping[Pair, Trigger]) -> dict[Pair, Trigger]:
        """Return why pairs were searched; of those whose match is that of merged maps, why these were."""
        of_unions = {pair: self._unions.searched.get(key) for pair, key in self._of_merged_maps.items()}
        both = {**alone, **of_unions}
        return {pair: trigger for pair, trigger in both.items() if trigger is not None}

    def _linked(self, believed: Mapping[Pair, Prior]) -> tuple[dict[Pair, Match], Forest]:
        """Place robots by the matches of pairs, then those that only merged maps can place, one after the other."""
        alone = dict(self._pairs.matches)
        matches = dict(alone)
        centres_m = self._held.centres_m
        forest = self._placed(centres_m, alone, matches)
        self._of_merged_maps.clear()
        while link := united(forest, self._held.cropped, alone, believed, self._unions, self._config):
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
        forest = _forest(centres_m, matches, self._config)
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
            forest = _forest(centres_m, matches, self._config)
        return forest

    def _too_large(self, forest: Forest) -> tuple[str, Extent] | None:
        """Return a robot that makes the merged map of those linked with it too large; None if there is none."""
        for robots in components(forest).values():
            placed = [(robot, forest.placements[robot].component_from_map) for robot in robots]
            found = first_too_large(self._held.cropped, placed, self._config.max_canvas_cells)
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
        looked = Looked(searched, jumped, shown_before)
        changes, self._reported = changes_of(outcomes, self._reported, self._held.centres_m, looked, self._config)
        return changes


def _forest(centres_m: Mapping[str, tuple[float, float]], pairs: Mapping[Pair, Match], config: MergeConfig) -> Forest:
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
