"""What recordings hold, and what would be merged."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from replay.codec import decode
from replay.columns import columns
from replay.errors import BadMessage, ReplayError
from replay.messages import GridMessage
from replay.open_plan import open_plan
from replay.options import RunOptions
from replay.plain_text import listed, plain
from replay.sources import open_sources
from replay.sources.base import GRID_TYPE, UPDATE_TYPE, Source, SourceInfo
from replay.sources.losses import Loss
from replay.words import counted, intention, lost, unused


@dataclass(frozen=True, slots=True)
class TopicSummary:
    """One topic with maps, or with updates of maps.

    Parameters
    ----------
    messages, unusable
        All messages, and those that are no valid map.
    sizes
        Columns and rows of the first and of the last map, where they differ.
    resolutions_m
        All resolutions, ascending.
    frames
        Frames as recorded, in order of first use.
    header_times
        Whether the messages carry a time of their own.
    """

    name: str
    msgtype: str
    messages: int
    unusable: int
    sizes: tuple[tuple[int, int], ...]
    resolutions_m: tuple[float, ...]
    frames: tuple[str, ...]
    header_times: bool


@dataclass(frozen=True, slots=True)
class InputSummary:
    """One recording; ``duration_s`` is None where it has no clock."""

    path: Path
    format: str
    duration_s: float | None
    messages: int
    topics: tuple[TopicSummary, ...]
    losses: tuple[Loss, ...]


@dataclass(frozen=True, slots=True)
class RunSummary:
    """All recordings, and what would be merged.

    Parameters
    ----------
    robots
        Robot and topic, the reference first; empty if nothing would be merged.
    mapless
        Those of these robots of which no map can be used, with their topics.
    unused
        Map topics that are no robot's.
    problem
        Why nothing would be merged; None if something would.
    """

    inputs: tuple[InputSummary, ...]
    robots: tuple[tuple[str, str], ...]
    mapless: tuple[tuple[str, str], ...]
    unused: tuple[str, ...]
    problem: str | None

    @property
    def is_whole(self) -> bool:
        """Whether nothing is lost, each message with a map can be used, and something would be merged."""
        unusable = any(topic.unusable for item in self.inputs for topic in item.topics)
        is_lost = any(item.losses for item in self.inputs)
        would_be = [item for item in self.robots if item not in self.mapless]
        return not (self.problem or is_lost or unusable or self.mapless) and len(would_be) > 1


def summarise(options: RunOptions) -> RunSummary:
    """Read what the recordings hold.

    Raises
    ------
    ReplayError
        If a recording cannot be read.
    """
    with open_sources([run.path for run in options.runs], options.max_memory_bytes) as sources:
        inputs = tuple(_input(source) for source in sources)
    try:
        with open_plan(options) as plan:
            robots = tuple((item.robot, item.topic) for item in plan.robots)
            mapless = tuple(item for item in robots if item[0] not in plan.mapped)
            # who names the robots knows that others are left out
            left_out = tuple(plan.unused_topics()) if options.robots is None else ()
            return RunSummary(inputs, robots, mapless, left_out, None)
    except ReplayError as error:
        return RunSummary(inputs, (), (), (), str(error))


def _input(source: Source) -> InputSummary:
    info = source.info
    maps = [topic.name for topic in info.topics if topic.msgtype in (GRID_TYPE, UPDATE_TYPE)]
    return InputSummary(
        path=source.path,
        format=info.format,
        duration_s=_duration_s(info),
        messages=sum(topic.message_count for topic in info.topics),
        topics=tuple(_topic(source, name) for name in maps),
        # after the topics were read
        losses=source.losses.all,
    )


def _duration_s(info: SourceInfo) -> float | None:
    if info.start_ns is None or info.stop_ns is None:
        return None
    return (info.stop_ns - info.start_ns) / 1e9


def _topic(source: Source, name: str) -> TopicSummary:
    topic = next(item for item in source.info.topics if item.name == name)
    sizes: list[tuple[int, int]] = []
    resolutions: set[float] = set()
    frames: dict[str, None] = {}
    unusable, stamped = 0, False
    for raw in source.messages([name]):
        try:
            message = decode(raw)
        except BadMessage:
            unusable += 1
            continue
        frames.setdefault(message.frame_id)
        stamped = stamped or message.stamp_ns > 0
        if isinstance(message, GridMessage):
            sizes.append((message.grid.cols, message.grid.rows))
            resolutions.add(message.grid.resolution_m)
    return TopicSummary(
        name=name,
        msgtype=topic.msgtype,
        messages=topic.message_count,
        unusable=unusable,
        sizes=tuple(dict.fromkeys((sizes[0], sizes[-1]))) if sizes else (),
        resolutions_m=tuple(sorted(resolutions)),
        frames=tuple(frames),
        header_times=stamped,
    )


def lines(summary: RunSummary) -> Iterator[str]:
    """Yield the summary as lines to read."""
    for item in summary.inputs:
        duration = f"{item.duration_s:.1f} s" if item.duration_s is not None else "no clock"
        yield f"{item.path}: {item.format}, {duration}, {counted(item.messages, 'message')}"
        yield from columns([_row(topic) for topic in item.topics])
        yield from (f"  {lost(loss.messages)} ({loss.place}): {loss.cause}: {loss.detail}" for loss in item.losses)
    if summary.problem is not None:
        yield f"nothing would be merged: {summary.problem}"
        return
    yield _intended(summary)
    if summary.unused:
        yield unused(summary.unused)


def _intended(summary: RunSummary) -> str:
    """Return what would be merged, and of which robots there is nothing to merge."""
    mapless = f"no map of {listed(_named(summary.mapless))} can be used" if summary.mapless else ""
    there = [item for item in summary.robots if item not in summary.mapless]
    if summary.mapless and (len(there) == 1 or summary.robots[0] in summary.mapless):
        return f"nothing would be merged: {mapless}"
    said = intention(_named(there), "would be merged: {} into {}")
    return f"{said}; {mapless}" if mapless else said


def _named(robots: Sequence[tuple[str, str]]) -> list[str]:
    return [f"{robot} ({topic})" for robot, topic in robots]


def _row(topic: TopicSummary) -> tuple[str, ...]:
    sizes = " → ".join(f"{cols} × {rows}" for cols, rows in topic.sizes)
    return (
        plain(topic.name),
        plain(topic.msgtype),
        counted(topic.messages, "message") + (f" ({topic.unusable} unusable)" if topic.unusable else ""),
        sizes,
        ", ".join(f"{resolution:g} m" for resolution in topic.resolutions_m),
        plain(f"frame {listed(topic.frames)}") if any(topic.frames) else "no frame",
        "header times" if topic.header_times else "log times only",
    )
