"""The robots' latest maps, and what is new about them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mapmerge.config import MergeConfig
from mapmerge.grid import UNKNOWN, Grid
from mapmerge.jump import jump
from mapmerge.lattice import changed_box, offset_cells
from mapmerge.plane import Box, read
from mapmerge.reasons import Reason


@dataclass(frozen=True, slots=True, eq=False)
class Arrivals:
    """What came with new maps.

    Parameters
    ----------
    updated
        Robots whose map says something new, in the order of the robots.
    changed
        Of those whose map was there before, on the same lattice, the box of `mapmerge.lattice.changed_box` since then.
    jumped
        Those whose map contradicts the one before it, and how.
    """

    updated: tuple[str, ...]
    changed: Mapping[str, Box]
    jumped: Mapping[str, Reason]


class HeldMaps:
    """The latest map of each robot, its known part, and how much that is.

    Parameters
    ----------
    robots
        The robots, the reference first.
    config
        Settings.
    """

    def __init__(self, robots: Sequence[str], config: MergeConfig) -> None:
        self._robots = tuple(robots)
        self._config = config
        self._latest: dict[str, Grid] = {}
        self._cropped: dict[str, Grid] = {}
        self._known: dict[str, _Known] = {}

    @property
    def latest(self) -> dict[str, Grid]:
        """The latest map of each robot that sent one, as it came, in the order of the robots."""
        return {robot: self._latest[robot] for robot in self._robots if robot in self._latest}

    @property
    def cropped(self) -> dict[str, Grid]:
        """Of each robot that knows something, what it knows, in the order of the robots, whenever their maps came."""
        return self._cropped

    @property
    def areas_m2(self) -> dict[str, float]:
        """How much each of these knows."""
        return {robot: known.area_m2 for robot, known in self._known.items()}

    @property
    def centres_m(self) -> dict[str, tuple[float, float]]:
        """The middle of the rectangle around what each of these knows, in its map frame, in the order of the robots."""
        return {robot: self._known[robot].centre_m for robot in self._cropped}

    def take(self, updates: Mapping[str, Grid]) -> Arrivals:
        """Take in maps of some of the robots."""
        arrivals = {robot: self._arrival(robot, updates[robot]) for robot in self._robots if robot in updates}
        new = {robot: arrival for robot, arrival in arrivals.items() if arrival is not None}
        jumps = {robot: self._hold(robot, arrival) for robot, arrival in new.items()}
        self._cropped = {robot: self._cropped[robot] for robot in self._robots if robot in self._cropped}
        return Arrivals(
            tuple(new),
            {robot: arrival.changed for robot, arrival in new.items() if arrival.changed is not None},
            {robot: reason for robot, reason in jumps.items() if reason is not None},
        )

    def _arrival(self, robot: str, grid: Grid) -> _Arrival | None:
        """Return a map that came, or None if it says what was known already."""
        cropped, before, last = grid.cropped_to_known(), self._cropped.get(robot), self._latest.get(robot)
        if before is None:
            return _Arrival(grid, cropped, None) if last is None or cropped.cells.size else None
        changed = changed_box(before, cropped)
        says_the_same = changed is not None and changed.is_empty
        return None if says_the_same and last is not None and grid.covers_as(last) else _Arrival(grid, cropped, changed)

    def _hold(self, robot: str, arrival: _Arrival) -> Reason | None:
        """Put a map in the place of the one before it; return how it contradicts that one, if it does."""
        self._latest[robot] = arrival.grid
        before, known = self._cropped.pop(robot, None), self._known.pop(robot, None)
        after, changed = arrival.cropped, arrival.changed
        if after.cells.size == 0:
            return None
        self._cropped[robot] = after
        cells = _known_cells(before, after, changed, known)
        self._known[robot] = _Known(cells, cells * after.resolution_m**2, after.middle_m)
        if before is None or known is None:
            return None
        return jump(before, after, changed, known.area_m2, self._config)


@dataclass(frozen=True, slots=True, eq=False)
class _Arrival:
    """A map that came: all of it, what it knows, and the box of `mapmerge.lattice.changed_box` since the one before."""

    grid: Grid
    cropped: Grid
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
