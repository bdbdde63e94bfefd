"""Recordings that are there already: samples of this project and, where they are, recordings of real logs.

What is in them is read by the libraries that are the formats' reference, and where maps lie is said by a file beside.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Literal

from benchmarks.faults.pieces import alike, shifts
from mapmerge.grid import Grid
from mapmerge.sim2 import Sim2
from replay.codec import decode
from replay.evaluation.truth import load_truth
from replay.events import Merged
from replay.placement_error import error_of
from replay.sources.base import GRID_TYPE, RawMessage

ROOT = Path(__file__).resolve().parents[2]
MOST_M, MOST_DEG = 0.5, 3.0
"""Three cells of the coarsest of them, as sure as their truth is."""
# Most of a large map is free space, which is alike where it is shifted as well.
_LEAST_ALIKE = 0.99


def data_folder() -> Path:
    """Return where recordings of real logs are, if they are."""
    return Path(os.environ.get("REPLAY_DATA") or ROOT.parent / "shared" / "data") / "real"


def raw_messages(path: Path) -> Iterator[RawMessage]:
    """Yield all messages of a whole recording."""
    if path.suffix == ".mcap":
        from mcap.reader import make_reader

        with path.open("rb") as file:
            for schema, channel, message in make_reader(file).iter_messages():
                name = "" if schema is None else schema.name
                yield RawMessage(channel.topic, name, "cdr", message.log_time, message.data)
        return
    from rosbags.rosbag1 import Reader as Reader1
    from rosbags.rosbag2 import Reader as Reader2

    with Reader1(path) if path.suffix == ".bag" else Reader2(path) as reader:
        encoding: Literal["cdr", "ros1"] = "ros1" if path.suffix == ".bag" else "cdr"
        for connection, time_ns, data in reader.messages():
            yield RawMessage(connection.topic, connection.msgtype, encoding, time_ns, bytes(data))


_Lies = tuple[Sim2, tuple[float, float]]
"""Where a robot's map lies in the frame of the first one's, and a place within it that is known best."""

_Found = tuple[str, Grid, tuple[int, int]]


@dataclass(frozen=True, slots=True)
class _Shown:
    """Whose map a grid shows, and what takes the frame that it has into the frame that this map had."""

    robot: str
    was_from_is: Sim2


@dataclass(frozen=True)
class Real:
    """A recording and the truth about it.

    Parameters
    ----------
    path
        A file or a folder.
    truth
        The file that says where maps lie.
    """

    path: Path
    truth: Path
    _seen: dict[object, list[_Found]] = field(default_factory=dict, repr=False)

    def misplaced(self, event: Merged, latest: Mapping[str, Grid]) -> list[str]:
        """Return which maps are placed where their cells do not lie, in words."""
        reference = next(iter(event.result.robots))
        if reference not in latest:
            return []
        found = []
        for robot, outcome in event.result.robots.items():
            if robot != reference and outcome.merged_from_map is not None and robot in latest:
                error = self.error_of((reference, latest[reference]), (robot, latest[robot]), outcome.merged_from_map)
                if error:
                    found.append(f"{robot} is placed {error}")
        return found

    def error_of(self, target: tuple[str, Grid], source: tuple[str, Grid], target_from_source: Sim2) -> str:
        """Return what is wrong with a placement of one robot's grid on another's; "" if nothing."""
        found = [
            self._error(true_target, true_source, target_from_source)
            for true_target in self._shown(*target)
            for true_source in self._shown(*source)
        ]
        return "" if "" in found else found[0]

    def _error(self, target: _Shown, source: _Shown, target_from_source: Sim2) -> str:
        lies = self._lies()
        if not {target.robot, source.robot} <= set(lies):
            return "though nobody knows what it shows"
        (first_from_target, _), (first_from_source, at_m) = lies[target.robot], lies[source.robot]
        found = target.was_from_is @ target_from_source @ source.was_from_is.inverse()
        off = error_of(found, first_from_target.inverse() @ first_from_source, at_m)
        if off.within(MOST_M, MOST_DEG):
            return ""
        return f"{off.distance_m:.2f} m and {off.angle_deg:.1f}° from where it lies"

    def _shown(self, name: str, grid: Grid) -> list[_Shown]:
        """Return what a grid shows: told by its cells or, where they are like nobody's, by its name.

        Damage can give a map another name, corner or resolution, and shift some of its cells.
        """
        key = (grid.cells.shape, hashlib.sha256(grid.cells.tobytes()).digest())
        if key not in self._seen:
            self._seen[key] = self._found(grid)
        found = [_Shown(robot, _was_from_is(grid, was, shift)) for robot, was, shift in self._seen[key]]
        return found or [_Shown(name, Sim2())]

    def _found(self, grid: Grid) -> list[_Found]:
        """Return whose map a grid shows, that map, and by how many columns and rows it is shifted."""
        maps = [(robot, each) for robot, maps in self._maps().items() for each in maps]
        robot, was = max(maps, key=lambda item: alike(grid.cells, item[1].cells))
        if alike(grid.cells, was.cells) >= _LEAST_ALIKE:
            return [(robot, was, (0, 0))]
        return [(robot, each, shift) for robot, each in maps for shift in shifts(grid.cells, each.cells)]

    def _lies(self) -> Mapping[str, _Lies]:
        return _lies(self.truth)

    def _maps(self) -> Mapping[str, list[Grid]]:
        return _maps(self.path)


@cache
def _lies(truth: Path) -> Mapping[str, _Lies]:
    return {
        robot: (item.reference_from_map, item.at_m)
        for robot, item in load_truth(truth).everybody().items()
        if item.reference_from_map is not None
    }


@cache
def _maps(path: Path) -> Mapping[str, list[Grid]]:
    found: dict[str, list[Grid]] = {}
    for raw in raw_messages(path):
        if raw.msgtype == GRID_TYPE:
            found.setdefault(raw.topic.split("/")[1], []).append(decode(raw).grid)  # type: ignore[union-attr]
    return found


def _was_from_is(grid: Grid, was: Grid, shift: tuple[int, int]) -> Sim2:
    """Return what takes the frame that a grid has into the frame that it had."""
    columns, rows = shift
    moved = Sim2(-columns * was.resolution_m, -rows * was.resolution_m)
    scaled = Sim2(scale=was.resolution_m / grid.resolution_m)
    return was.map_from_grid @ moved @ scaled @ grid.map_from_grid.inverse()
