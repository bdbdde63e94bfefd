"""Which map is exported: that of one topic of a recording, as of a time."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mapmerge.grid import Grid
from replay.errors import InputError, UsageError
from replay.events import Noted, Skipped
from replay.feeds import Tally
from replay.open_plan import open_plan
from replay.options import RunOptions, TimeBound
from replay.plain_text import listed, plain
from replay.runs import RunPath, TopicChoice
from replay.sources import open_source
from replay.sources.base import GRID_TYPE
from replay.timeline import Tick, ticks
from replay.topics import MAP_TOPIC
from replay.words import moment

Say = Callable[[Skipped | Noted], None]
"""Is told what of a recording is not used, and what else is to be known of it."""

Check = Callable[[Sequence[Mapping[str, Any]]], None]
"""Is told what reports say of the inputs; raises if these are not what they should be."""

THE_MAP = "map"
"""What stands for the robot where a map is no robot's."""


def told(event: Skipped | Noted) -> str:
    """Return what is not used, or is to be known, as a line."""
    if isinstance(event, Noted):
        return plain(event.message)
    return plain(f"skipped ({event.input}, {event.where}): {event.cause}: {event.detail}")


@dataclass(frozen=True, slots=True, eq=False)
class Maps:
    """Maps as of a time.

    Parameters
    ----------
    grids
        By robot.
    stamp_ns
        When the last of them was recorded.
    files
        What they were read from.
    """

    grids: Mapping[str, Grid]
    stamp_ns: int
    files: tuple[Path, ...]


class NoMapYetError(InputError):
    """The time is before that of any map.

    Parameters
    ----------
    paths
        Where maps were looked for.
    first_ns
        When the first one was recorded.
    """

    def __init__(self, paths: str, first_ns: int) -> None:
        super().__init__(f"{paths}: the first map is of {moment(first_ns)} ({first_ns}ns)")
        self.first_ns = first_ns


def one_map(path: Path, topic: str | None, at: TimeBound | None, say: Say) -> Maps:
    """Return the map of one topic: the last one, or that of a time; the merged one if no topic is named.

    Raises
    ------
    ReplayError
        If there is none.
    """
    chosen = _topic(path, topic)
    options = RunOptions((RunPath(None, path),), (THE_MAP,), (TopicChoice(THE_MAP, chosen),))
    return maps_at(options, at, say)


def maps_at(options: RunOptions, at: TimeBound | None, say: Say, check: Check | None = None) -> Maps:
    """Return all robots' maps as they were at a time; the last ones if none is named.

    Parameters
    ----------
    check
        Is told what reports say of the inputs, before they are read and again when all was; None for nothing, and then
        no more is read than is needed.

    Raises
    ------
    ReplayError
        If there is none.
    """
    grids: dict[str, Grid] = {}
    first_ns = stamp_ns = None
    with open_plan(options) as plan:
        tallies = tuple(Tally() for _ in plan.feeds)
        if check is not None:
            check(plan.describe_inputs())
        items = ticks(plan.feeds, tallies, plan.window, strict=False)
        for item in items:
            if isinstance(item, Skipped | Noted):
                say(item)
            elif isinstance(item, Tick):
                first_ns = item.stamp_ns if first_ns is None else first_ns
                if at is not None and item.stamp_ns > at.absolute_ns(first_ns):
                    break
                grids.update(item.grids)
                stamp_ns = item.stamp_ns
        if check is not None:
            deque(items, maxlen=0)  # a digest is one of all that was used
            check(plan.describe_inputs(tallies))
        files = tuple(plan.files())
    if stamp_ns is None:
        paths = ", ".join(str(run.path) for run in options.runs)
        if first_ns is not None:
            raise NoMapYetError(paths, first_ns)
        raise InputError(f"{paths}: there is no map that can be used")
    return Maps(grids, stamp_ns, files)


def grid_topics(path: Path) -> list[str]:
    """Return the topics of a recording that hold maps, in order of name."""
    with open_source(path) as source:
        return [topic.name for topic in source.info.topics if topic.msgtype == GRID_TYPE and topic.message_count]


def _topic(path: Path, topic: str | None) -> str:
    there = grid_topics(path)
    if topic is not None:
        if topic not in there:
            raise UsageError(f"--topic {topic}: {path} has no map on it; there are: {listed(there) or 'none'}")
        return topic
    if MAP_TOPIC in there:
        return MAP_TOPIC
    if len(there) == 1:
        return there[0]
    if not there:
        raise InputError(f"{path}: there is no map in it; expected a topic of type {GRID_TYPE}, such as {MAP_TOPIC}")
    flags = listed([f"--topic {each}" for each in there], "  ")
    raise UsageError(f"{path} has {len(there)} maps; choose one of: {flags}")
