"""The matches of all pairs of robots, followed from update to update and searched anew where that is due."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import combinations
from typing import Any

from mapmerge.config import MergeConfig
from mapmerge.evidence import Evidence
from mapmerge.grid import Grid
from mapmerge.match import Match, Matcher
from mapmerge.outcome import Pair
from mapmerge.prior import Prior
from mapmerge.watch import Trigger, Watch

_MOVED_SIGMAS = 1.0

Mapped = Callable[[Callable[[Any], Any], Iterable[Any]], Iterable[Any]]
"""Applies a function to values and returns the outcomes in their order: `map`, or that of a pool of threads."""


@dataclass(frozen=True, slots=True)
class News:
    """What changed since the last update.

    Parameters
    ----------
    updated
        Robots whose map changed.
    jumped
        Those of them whose map jumped.
    reference
        The robot in whose frame all is merged: if its map jumped, all pairs are searched.
    is_last
        Whether these are the last maps.
    """

    updated: frozenset[str]
    jumped: frozenset[str]
    reference: str
    is_last: bool

    def jumps(self, pair: Pair) -> bool:
        """Tell whether a pair must be searched because a map jumped."""
        return self.reference in self.jumped or bool(self.jumped & set(pair))


class PreparedMaps:
    """What the matcher computed for single maps, brought up to date when it is asked for.

    Parameters
    ----------
    matcher, config
        The method and its settings.
    """

    def __init__(self, matcher: Matcher[Any], config: MergeConfig) -> None:
        self._matcher, self._config = matcher, config
        self._known: dict[tuple[str, float], tuple[Grid, Any]] = {}

    def get(self, robot: str, grid: Grid, resolution_m: float) -> Any:  # noqa: ANN401 - the matcher's own
        """Return a robot's map, prepared."""
        key = robot, resolution_m
        if key not in self._known:
            self._known[key] = grid, self._matcher.prepare(grid, resolution_m, self._config)
        elif self._known[key][0] is not grid:
            updated = self._matcher.update(self._known[key][1], grid, resolution_m, self._config)
            self._known[key] = grid, updated
        return self._known[key][1]

    def renew(self, robot: str, grid: Grid, resolution_m: float) -> None:
        """Have a robot's map as if it were prepared now for the first time."""
        prepared = self.get(robot, grid, resolution_m)
        self._known[robot, resolution_m] = grid, self._matcher.renewed(prepared)

    def keep(self, needed: Collection[tuple[str, float]]) -> None:
        """Forget all maps but these, each a robot and a resolution."""
        self._known = {key: known for key, known in self._known.items() if key in needed}


class Pairs:
    """All pairs of robots that have maps.

    Parameters
    ----------
    matcher, config
        The method and its settings.
    mapped
        How searches of several pairs are run.
    """

    def __init__(self, matcher: Matcher[Any], config: MergeConfig, mapped: Mapped = map) -> None:
        self._matcher, self._config, self._mapped = matcher, config, mapped
        self._prepared = PreparedMaps(matcher, config)
        self._watches: dict[Pair, Watch] = {}
        self._believed: dict[Pair, Prior | None] = {}
        self.matches: dict[Pair, Match] = {}

    def update(
        self, maps: Mapping[str, Grid], areas_m2: Mapping[str, float], priors: Mapping[Pair, Prior], news: News
    ) -> dict[Pair, Trigger]:
        """Bring `matches` up to date; return which pairs were searched, and why.

        Parameters
        ----------
        maps
            All maps that show anything.
        areas_m2
            What each of them knows.
        priors
            What is believed of the pairs.
        news
            What changed.
        """
        pairs = list(combinations(maps, 2))
        for gone in set(self.matches) - set(pairs):
            del self.matches[gone], self._watches[gone]
        due = {pair: trigger for pair in pairs if (trigger := self._due(pair, maps, areas_m2, priors.get(pair), news))}
        searches = [self._search(pair, maps, priors.get(pair)) for pair in due]
        for pair, match in zip(due, self._mapped(_called, searches), strict=True):
            areas = areas_m2[pair[0]], areas_m2[pair[1]]
            before = None if due[pair] is Trigger.MAP_JUMPED else self._watches.get(pair)
            self._watches[pair] = Watch.of(match, areas, before, self._config.watch)
            self._believed[pair] = priors.get(pair)
            self.matches[pair] = match
        self.matches = {pair: self.matches[pair] for pair in pairs}
        self._prepared.keep({(robot, self._resolution_m(pair, maps)) for pair in pairs for robot in pair})
        return due

    def explain(self, pair: Pair, maps: Mapping[str, Grid]) -> tuple[Evidence, ...]:
        """Return what the matcher saw of a pair."""
        target, source = self._maps_of(pair, maps)
        return self._matcher.explain(target, source, self.matches[pair], self._config)

    def _due(
        self,
        pair: Pair,
        maps: Mapping[str, Grid],
        areas_m2: Mapping[str, float],
        prior: Prior | None,
        news: News,
    ) -> Trigger | None:
        """Follow a pair's placement if a map changed; return why the pair is to be searched, if it is."""
        watch = self._watches.get(pair)
        if watch is None:
            return Trigger.FIRST
        if self._is_believed_elsewhere(pair, prior):
            return Trigger.PRIOR_CHANGED
        if news.jumps(pair):
            return Trigger.MAP_JUMPED
        if news.updated & set(pair):
            watch = self._watches[pair] = watch.updated()
        if news.is_last and watch.searched.updates:
            return Trigger.END
        if not news.updated & set(pair):
            return None
        areas = areas_m2[pair[0]], areas_m2[pair[1]]
        if self.matches[pair].accepted:
            return self._doubt(pair, maps, watch, areas, prior)
        return self._retry(pair, maps, watch, areas)

    def _retry(
        self, pair: Pair, maps: Mapping[str, Grid], watch: Watch, areas_m2: tuple[float, float]
    ) -> Trigger | None:
        """Tell whether a pair without a placement is searched again: if a glance is hopeful, or in any case."""
        config = self._config.watch
        if watch.is_search_due(areas_m2, config):
            return Trigger.RETRY
        if not watch.is_glance_due(areas_m2, config):
            return None
        is_near = (self.matches[pair].confidence or 0.0) >= self._config.verify.hopeful_confidence
        if is_near or self._believed[pair] is not None:
            # a glance knows no priors
            return Trigger.RETRY
        target, source = self._maps_of(pair, maps)
        if self._matcher.is_hopeful(target, source, self._config):
            return Trigger.RETRY
        self._watches[pair] = watch.after_glance(areas_m2, config)
        return None

    def _is_believed_elsewhere(self, pair: Pair, prior: Prior | None) -> bool:
        """Tell whether what is believed of a pair differs from what was when it was searched, by more than jitter."""
        before, found = self._believed[pair], self.matches[pair]
        if prior is None or before is None:
            return prior is not before
        if found.accepted and found.target_from_source is not None and prior.allows(found.target_from_source):
            return not prior.is_about(before, _MOVED_SIGMAS)
        return not prior.is_about(before)

    def _doubt(
        self,
        pair: Pair,
        maps: Mapping[str, Grid],
        watch: Watch,
        areas_m2: tuple[float, float],
        prior: Prior | None,
    ) -> Trigger | None:
        """Follow an accepted placement; return why that does not suffice."""
        target, source = self._maps_of(pair, maps)
        found = self._matcher.follow(target, source, self.matches[pair], self._config, prior)
        if found is None:
            return Trigger.CHANGED
        doubt = watch.doubts(found, areas_m2, self._config.watch)
        if doubt is None:
            self.matches[pair] = found
        return doubt

    def _search(self, pair: Pair, maps: Mapping[str, Grid], prior: Prior | None) -> Callable[[], Match]:
        resolution_m = self._resolution_m(pair, maps)
        for robot in pair:
            self._prepared.renew(robot, maps[robot], resolution_m)

        def search() -> Match:
            target, source = self._maps_of(pair, maps)
            return self._matcher.match(target, source, self._config, prior)

        return search

    def _maps_of(self, pair: Pair, maps: Mapping[str, Grid]) -> Iterator[Any]:
        resolution_m = self._resolution_m(pair, maps)
        return iter([self._prepared.get(robot, maps[robot], resolution_m) for robot in pair])

    def _resolution_m(self, pair: Pair, maps: Mapping[str, Grid]) -> float:
        return max(self._config.search.working_cell_m, *(maps[robot].resolution_m for robot in pair))


def _called(search: Callable[[], Match]) -> Match:
    return search()
