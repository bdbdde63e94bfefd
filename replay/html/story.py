"""All that a report tells, folded from the events of a run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mapmerge.config import CellConfig
from mapmerge.grid import Grid
from mapmerge.outcome import ChangeKind
from mapmerge.raster import shrunk
from mapmerge.result import MergeResult
from mapmerge.sim2 import Sim2
from mapmerge.warp import Layer
from replay.decisions import decisions
from replay.events import Event, Finished, Merged, Report, RobotInput, Started
from replay.html.roster import Member, roster
from replay.html.series import Series

MAX_SIDE_PX = 1600
"""Longest side of a picture, and of the maps that pictures are made of."""
MOST_DECISIONS = 2000
"""So many are kept of the first, and as many of the last."""


@dataclass(frozen=True, slots=True)
class Decision:
    """A robot's map jumped, or was placed, moved or withdrawn: when, which, and in words."""

    stamp_ns: int
    robot: str
    kind: str
    words: str


@dataclass(frozen=True, slots=True, eq=False)
class Story:
    """A run that has ended.

    Parameters
    ----------
    robots
        Where the maps are from, the reference first.
    roster
        The robots by name.
    report
        The final report.
    result
        What the merger knew in the end; None if there was no tick.
    series
        Values over time.
    decisions, decisions_left_out
        What was decided, in order, and of how much more in the middle nothing is kept.
    first_ns, last_ns
        Times of the first and the last tick; 0 without one.
    ways
        Where robots drove, in order of time, in their map frames as these are in the end: shape (N, 2), at least one
        point, in metres. Of those of whom that is known.
    are_ways_whole
        Whether all that was recorded of it could be read.
    """

    robots: tuple[RobotInput, ...]
    roster: Mapping[str, Member]
    report: Report
    result: MergeResult | None
    series: Series
    decisions: tuple[Decision, ...]
    decisions_left_out: int
    first_ns: int
    last_ns: int
    ways: Mapping[str, NDArray[np.float64]]
    are_ways_whole: bool
    _shown: dict[str, Grid] = field(default_factory=dict, init=False, repr=False)

    @property
    def settings(self) -> Mapping[str, Any]:
        """Settings of the run."""
        found: Mapping[str, Any] = self.report["settings"]
        return found

    def layer(self, robot: str, merged_from_map: Sim2) -> Layer | None:
        """Return a robot's map somewhere, no finer than it can be shown; None if it has none that knows anything."""
        if self.result is None or robot not in self.result.grids:
            return None
        if robot not in self._shown:
            self._shown[robot] = shrunk(self.result.grids[robot], MAX_SIDE_PX, self.cells)
        grid = self._shown[robot]
        return Layer(grid, merged_from_map) if grid.cells.size else None

    @property
    def cells(self) -> CellConfig:
        """When a cell counts as occupied or free."""
        return CellConfig(**self.settings["merge"]["cells"])

    @property
    def tolerance_m(self) -> float:
        """How far walls that agree may be apart."""
        return float(self.settings["merge"]["verify"]["tolerance_m"])

    def member(self, robot: str) -> Member:
        """Return a robot of the run."""
        return self.roster[robot]


class StoryTeller:
    """Folds events; what it keeps of a tick are numbers, words and where robots drove, but for the last one."""

    def __init__(self) -> None:
        self._robots: tuple[RobotInput, ...] = ()
        self._series = Series(())
        self._first: list[Decision] = []
        self._last: list[Decision] = []
        self._left_out = 0
        self._result: MergeResult | None = None
        self._span_ns: tuple[int, int] | None = None
        self._ways: dict[str, list[NDArray[np.float64]]] = {}
        self._are_ways_whole = True

    def take(self, event: Event) -> Story | None:
        """Take in an event; the last one makes the story whole."""
        if isinstance(event, Started):
            self._robots = event.robots
            self._series = Series([item.robot for item in event.robots])
        elif isinstance(event, Merged):
            self._tick(event)
        elif isinstance(event, Finished):
            return self._told(event.report)
        return None

    def _tick(self, event: Merged) -> None:
        stamp_ns = event.stamp_ns
        self._result = event.result
        self._span_ns = self._span_ns[0] if self._span_ns else stamp_ns, stamp_ns
        self._series.take(stamp_ns, event.report["robots"])
        for change, (_, words) in zip(event.result.changes, decisions(event.result), strict=True):
            self._keep(Decision(stamp_ns, change.robot, str(change.kind), words))
        self._drive(event)

    def _drive(self, event: Merged) -> None:
        """Keep where robots drove; of one whose map jumped, what follows: what was before is of another frame."""
        jumped = {change.robot for change in event.result.changes if change.kind is ChangeKind.JUMPED}
        for robot in jumped:
            self._ways.pop(robot, None)
        for item in event.moved:
            if item.robot not in jumped:
                self._ways.setdefault(item.robot, []).append(item.poses[:, :2])
        self._are_ways_whole = self._are_ways_whole and not event.remarks

    def _keep(self, decision: Decision) -> None:
        if len(self._first) < MOST_DECISIONS:
            self._first.append(decision)
            return
        self._last.append(decision)
        if len(self._last) > MOST_DECISIONS:
            del self._last[0]
            self._left_out += 1

    def _told(self, report: Report) -> Story:
        first_ns, last_ns = self._span_ns or (0, 0)
        return Story(
            self._robots,
            roster([item.robot for item in self._robots]),
            report,
            self._result,
            self._series,
            (*self._first, *self._last),
            self._left_out,
            first_ns,
            last_ns,
            {robot: np.concatenate(parts) for robot, parts in self._ways.items()},
            self._are_ways_whole,
        )
