"""What a run will read: inputs opened, robots found, clocks and frames chosen. `info` shows it, `merge` runs it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from replay.clocks import Probe, clock_of, frames, offsets_ns, probe
from replay.errors import UsageError
from replay.events import RobotInput
from replay.options import RunOptions
from replay.selection import Selected, select
from replay.sources import open_source
from replay.sources.base import GRID_TYPE, UPDATE_TYPE, Source, SourceInfo
from replay.timeline import Feed, Tally, Window

MERGED_FRAME = "merged"
_MAP_TYPES = (GRID_TYPE, UPDATE_TYPE)


@dataclass(frozen=True, slots=True)
class Plan:
    """A run that was understood and can begin.

    Parameters
    ----------
    infos
        What each input holds.
    robots
        The robots, the reference first.
    feeds
        What is read from each input.
    window
        Which times are used.
    """

    infos: tuple[SourceInfo, ...]
    robots: tuple[RobotInput, ...]
    feeds: tuple[Feed, ...]
    window: Window

    def describe_inputs(self, tallies: tuple[Tally, ...] | None = None) -> tuple[Mapping[str, Any], ...]:
        """Return what is said of the inputs in reports; counts and digests only once all was read."""
        return tuple(
            {
                "name": feed.source.path.name,
                "format": info.format,
                "size_bytes": _size_bytes(feed.source.path),
                "robots": sorted(set(feed.robot_of.values())),
                "clocks": {robot: feed.clocks[robot] for robot in sorted(set(feed.robot_of.values()))},
                "offsets_ns": dict(sorted(feed.offsets_ns.items())),
                "messages": tally.messages if tally else None,
                "late": tally.late if tally else None,
                "sha256": tally.digest.hexdigest() if tally else None,
            }
            for feed, info, tally in zip(self.feeds, self.infos, tallies or (None,) * len(self.feeds), strict=True)
        )


@contextmanager
def open_plan(options: RunOptions) -> Iterator[Plan]:
    """Open a run's inputs and find out what is to be merged.

    Raises
    ------
    ReplayError
        If an input cannot be read, or the robots that were asked for are not there.
    """
    with ExitStack() as stack:
        if not options.runs:
            raise UsageError("no recording was given; expected one or more of PATH or ROBOT=PATH")
        sources = [stack.enter_context(open_source(run.path)) for run in options.runs]
        yield _plan(sources, options)


def _plan(sources: list[Source], options: RunOptions) -> Plan:
    infos = tuple(source.info for source in sources)
    selected = select(options.runs, infos, robots=options.robots, topics=options.topics)
    probes = [
        found
        for item in selected
        for index in item.inputs
        if (found := probe(sources[index], index, item, options.clock)) is not None
    ]
    clocks = {item.robot: clock_of([p for p in probes if p.robot == item.robot]) for item in selected}
    probes = [_on_clock(p, clocks[p.robot], infos[p.input]) for p in probes]
    offsets = offsets_ns(selected[0].robot, probes, align_starts=options.align_starts)
    start_ns = _first_ns(probes, offsets)
    window = Window(
        options.start.absolute_ns(start_ns) if options.start else None,
        options.stop.absolute_ns(start_ns) if options.stop else None,
        options.reorder_window_ns,
    )
    if window.start_ns is not None and window.stop_ns is not None and window.start_ns >= window.stop_ns:
        raise UsageError("--stop is not after --start, so that no map would be used; give a later --stop")
    return Plan(
        infos,
        _robots(selected, probes, clocks, infos),
        _feeds(sources, selected, clocks, offsets, window, start_ns),
        window,
    )


def _on_clock(item: Probe, clock: str, info: SourceInfo) -> Probe:
    """Return the probe by the robot's clock where another of its inputs lacks header stamps."""
    if item.clock != "header" or clock == "header" or info.start_ns is None:
        return item
    return Probe(item.robot, item.input, "log", info.start_ns, info.stop_ns, item.frame_id)


def _first_ns(probes: list[Probe], offsets: Mapping[tuple[int, str], int]) -> int:
    times = [item.first_ns + offsets[item.input, item.robot] for item in probes if item.first_ns is not None]
    return min(times, default=0)


def _robots(
    selected: tuple[Selected, ...], probes: list[Probe], clocks: Mapping[str, Any], infos: tuple[SourceInfo, ...]
) -> tuple[RobotInput, ...]:
    frame_ids: dict[str, str] = {}
    for item in probes:
        frame_ids.setdefault(item.robot, item.frame_id)
    named = frames([item.robot for item in selected], frame_ids, MERGED_FRAME)
    return tuple(
        RobotInput(
            robot=item.robot,
            topic=item.topic,
            frame=named[item.robot],
            clock=clocks[item.robot],
            inputs=item.inputs,
            message_count=sum(
                topic.message_count
                for index in item.inputs
                for topic in infos[index].topics
                if topic.name in item.topics and topic.msgtype in _MAP_TYPES
            ),
        )
        for item in selected
    )


def _feeds(
    sources: list[Source],
    selected: tuple[Selected, ...],
    clocks: Mapping[str, Any],
    offsets: Mapping[tuple[int, str], int],
    window: Window,
    start_ns: int,
) -> tuple[Feed, ...]:
    untimed_ns = start_ns if window.start_ns is None else max(start_ns, window.start_ns)
    feeds = []
    for index, source in enumerate(sources):
        own = [item for item in selected if index in item.inputs]
        names = {topic.name for topic in source.info.topics if topic.msgtype in _MAP_TYPES}
        feeds.append(
            Feed(
                source=source,
                robot_of={topic: item.robot for item in own for topic in item.topics if topic in names},
                clocks={item.robot: "none" if source.info.start_ns is None else clocks[item.robot] for item in own},
                offsets_ns={item.robot: offsets.get((index, item.robot), 0) for item in own},
                untimed_ns=untimed_ns,
            )
        )
    return tuple(feeds)


def _size_bytes(path: Path) -> int:
    if path.is_dir():
        return sum(file.stat().st_size for file in path.iterdir() if file.is_file())
    return path.stat().st_size
