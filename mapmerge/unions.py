"""Merged maps of linked robots, matched with those of others, and kept until the maps have grown or moved.

What a robot shares with each of several others may be too little, and with all together enough.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import Any

from mapmerge.config import MergeConfig
from mapmerge.evidence import Evidence
from mapmerge.fuse import fuse
from mapmerge.graph import Forest
from mapmerge.grid import Grid
from mapmerge.match import Match, Matcher
from mapmerge.pairs import News
from mapmerge.sim2 import Sim2
from mapmerge.warp import Layer
from mapmerge.watch import Trigger, Watch

Robots = tuple[str, ...]
Placed = tuple[tuple[str, Sim2], ...]


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
    return Grid(merged.cells, merged.resolution_m, component_from_base @ merged.map_from_grid, is_own=True)
