"""What a run will read: inputs opened, robots found, clocks and frames chosen. `info` shows it, `merge` runs it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from replay.clocks import Probe, agreed, frames, offsets_ns, probe, refuse_recorded_twice
from replay.errors import UsageError
from replay.events import Clock, RobotInput
from replay.feeds import Feed, Tally, Window
from replay.footprint import MemoryLimit
from replay.init_pose import refuse_unfit
from replay.no_map import refuse_mapless
from replay.options import NS_PER_S, RunOptions
from replay.selection import Selected, select
from replay.sources import open_sources
from replay.sources.base import GRID_TYPE, UPDATE_TYPE, Source, SourceInfo
from replay.stamps import LAST_NS
from replay.transform_feeds import feeds_of, transform_feeds

MERGED_FRAME = "merged"


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
    map_frames
        Each robot's map frame as recorded, its leading slash stripped; None without a usable map.
    transform_feeds
        Which transforms are read; None if none are to be used.
    mapped
        The robots of which there is a map that can be used.
    feeds_of_transforms
        Returns what is read of the transforms of one input, opened once more, given its index: for who looks on.
    """

    infos: tuple[SourceInfo, ...]
    robots: tuple[RobotInput, ...]
    feeds: tuple[Feed, ...]
    window: Window
    map_frames: Mapping[str, str | None]
    transform_feeds: tuple[Feed, ...] | None
    mapped: frozenset[str]
    feeds_of_transforms: Callable[[int, Source], tuple[Feed, ...]]

    def input_bytes(self, index: int) -> int:
        """Return how large an input is."""
        return _size_bytes(self.feeds[index].source.path)

    def files(self) -> list[Path]:
        """Return the files that are read."""
        return [path for feed in self.feeds for path in feed.source.files]

    def recordings_with_transforms(self) -> list[Source] | None:
        """Return the recordings whose transforms are read; None if none are to be used."""
        if self.transform_feeds is None:
            return None
        return list(dict.fromkeys(feed.source for feed in self.transform_feeds))

    def unused_topics(self) -> list[str]:
        """Return the map topics with messages that are no robot's in this run, in order of name.

        Updates of parts of maps are named where their map is not there; else its own name tells of them.
        """
        used = {topic for feed in self.feeds for topic in feed.robot_of}
        there = {item.name for info in self.infos for item in info.topics if item.msgtype == GRID_TYPE}
        updates = {item.name for info in self.infos for item in info.topics if item.msgtype == UPDATE_TYPE}
        there |= {name for name in updates if name.removesuffix("_updates") not in there}
        empty = {item.name for info in self.infos for item in info.topics if item.message_count == 0}
        return sorted(there - used - empty)

    def describe_inputs(self, tallies: tuple[Tally, ...] | None = None) -> tuple[Mapping[str, Any], ...]:
        """Return what is said of the inputs in reports; counts and digests only once all was read.

        Parameters
        ----------
        tallies
            Of the feeds and then of the feeds of transforms.
        """
        read = tallies or (None,) * (len(self.feeds) + len(self.transform_feeds or ()))
        transforms = list(zip(self.transform_feeds or (), read[len(self.feeds) :], strict=True))
        return tuple(
            {
                "name": feed.source.path.name,
                "format": info.format,
                "size_bytes": _size_bytes(feed.source.path),
                "robots": sorted(set(feed.robot_of.values())),
                "clocks": dict(sorted(feed.clocks.items())),
                "offsets_ns": dict(sorted(feed.offsets_ns.items())),
                **_read(tally),
                "until_ns": tally.until_ns if tally else None,
                "late": tally.late if tally else None,
                "bad_stamps": tally.bad_stamps if tally else None,
                "transforms": {
                    topic: _read(taken)
                    for each, taken in transforms
                    if each.source is feed.source
                    for topic in each.robot_of
                },
            }
            for feed, info, tally in zip(self.feeds, self.infos, read[: len(self.feeds)], strict=True)
        )


def _read(tally: Tally | None) -> dict[str, Any]:
    return {
        "messages": tally.messages if tally else None,
        "sha256": tally.digest.hexdigest() if tally else None,
    }


def memory_limit(options: RunOptions) -> MemoryLimit | None:
    """Return how much memory one map may need; None for any."""
    return None if options.max_memory_bytes is None else MemoryLimit(options.max_memory_bytes, options.merge)


@contextmanager
def open_plan(options: RunOptions) -> Iterator[Plan]:
    """Open a run's inputs and find out what is to be merged.

    Raises
    ------
    ReplayError
        If an input cannot be read, or the robots that were asked for are not there.
    """
    if not options.runs:
        raise UsageError("no recording was given; expected one or more of PATH or ROBOT=PATH")
    with open_sources([run.path for run in options.runs], options.max_memory_bytes) as sources:
        yield _plan(sources, options)


def _plan(sources: list[Source], options: RunOptions) -> Plan:
    infos = tuple(source.info for source in sources)
    losses = [source.losses.all for source in sources]
    selected = select(options.runs, infos, robots=options.robots, topics=options.topics, losses=losses)
    refuse_unfit([item.robot for item in selected], options.init_poses)
    probes = agreed(_probes(sources, infos, selected, options))
    mapped = _robots_with_maps(selected, probes)
    if not mapped:
        refuse_mapless(sources, {item.topic for item in selected})
    refuse_recorded_twice(probes, [run.path.name for run in options.runs], options.reorder_window_ns)
    offsets = offsets_ns(selected[0].robot, probes, align_starts=options.align_starts)
    start_ns, stop_ns = _span_ns(probes, offsets)
    window = Window(
        options.start.absolute_ns(start_ns) if options.start else None,
        options.stop.absolute_ns(start_ns) if options.stop else None,
        options.reorder_window_ns,
    )
    _refuse_empty(window, start_ns, stop_ns)
    untimed_ns = min(start_ns if window.start_ns is None else max(start_ns, window.start_ns), LAST_NS)
    frame_ids = _frame_ids(probes)
    return Plan(
        infos,
        _robots(selected, probes, infos, frame_ids),
        _feeds(sources, selected, probes, offsets, untimed_ns, memory_limit(options)),
        window,
        {item.robot: _bare(frame_ids.get(item.robot)) for item in selected},
        transform_feeds(sources, probes, offsets, options.clock) if options.use_tf else None,
        mapped,
        partial(feeds_of, probes=probes, offsets_ns=offsets, choice=options.clock),
    )


def _robots_with_maps(selected: tuple[Selected, ...], probes: list[Probe]) -> frozenset[str]:
    """Return the robots of which there is a map that can be used, and not only updates of parts."""
    topics = {(item.robot, item.topic) for item in selected}
    return frozenset(item.robot for item in probes if (item.robot, item.topic) in topics)


def _refuse_empty(window: Window, start_ns: int, stop_ns: int) -> None:
    """Refuse a window in which there is no map."""
    first_ns = start_ns if window.start_ns is None else window.start_ns
    if window.stop_ns is not None and window.stop_ns <= first_ns:
        raise UsageError("--stop is not after --start or the first map, so that no map would be used; give a later one")
    if first_ns > stop_ns:
        span_s = (stop_ns - start_ns) / NS_PER_S
        raise UsageError(
            f"--start is after all maps, which end {span_s:.1f} s after the first one; give an earlier one"
        )


def _probes(
    sources: list[Source], infos: tuple[SourceInfo, ...], selected: tuple[Selected, ...], options: RunOptions
) -> list[Probe]:
    """Read the first message of each topic, the robots in order, each robot's map first."""
    return [
        found
        for item in selected
        for topic in item.topics
        for index in item.inputs
        if _carries_maps(infos[index], topic)
        and (found := probe(sources[index], index, item.robot, topic, options.clock)) is not None
    ]


def _carries_maps(info: SourceInfo, topic: str) -> bool:
    return any(item.name == topic and item.msgtype in (GRID_TYPE, UPDATE_TYPE) for item in info.topics)


def _span_ns(probes: list[Probe], offsets: Mapping[tuple[int, str], int]) -> tuple[int, int]:
    """Return about when the first and the last map of the run are; zeros if none has a time."""
    shifts = [(item, offsets.get((item.input, item.topic), 0)) for item in probes]
    first = [item.first_ns + shift for item, shift in shifts if item.first_ns is not None]
    last = [item.last_ns + shift for item, shift in shifts if item.last_ns is not None]
    return min(first, default=0), max(last, default=0)


def _bare(frame_id: str | None) -> str | None:
    return None if frame_id is None else frame_id.lstrip("/")


def _frame_ids(probes: list[Probe]) -> dict[str, str]:
    frame_ids: dict[str, str] = {}
    for item in probes:
        frame_ids.setdefault(item.robot, item.frame_id)
    return frame_ids


def _robots(
    selected: tuple[Selected, ...],
    probes: list[Probe],
    infos: tuple[SourceInfo, ...],
    frame_ids: Mapping[str, str],
) -> tuple[RobotInput, ...]:
    clocks: dict[str, Clock] = {}
    for item in probes:
        clocks.setdefault(item.robot, item.clock)
    named = frames([item.robot for item in selected], frame_ids, MERGED_FRAME)
    return tuple(
        RobotInput(
            robot=item.robot,
            topic=item.topic,
            frame=named[item.robot],
            clock=clocks.get(item.robot, "header"),
            inputs=item.inputs,
            message_count=sum(
                topic.message_count
                for index in item.inputs
                for topic in infos[index].topics
                if topic.name in item.topics and topic.msgtype in (GRID_TYPE, UPDATE_TYPE)
            ),
            recorded_frame=_bare(frame_ids.get(item.robot)) or None,
        )
        for item in selected
    )


def _feeds(
    sources: list[Source],
    selected: tuple[Selected, ...],
    probes: list[Probe],
    offsets: Mapping[tuple[int, str], int],
    untimed_ns: int,
    memory: MemoryLimit | None,
) -> tuple[Feed, ...]:
    clocks = {(item.input, item.topic): item.clock for item in probes}
    leads_ns = {(item.input, item.topic): item.lead_ns for item in probes}
    feeds = []
    for index, source in enumerate(sources):
        robot_of = {
            topic: item.robot
            for item in selected
            if index in item.inputs
            for topic in item.topics
            if _carries_maps(source.info, topic)
        }
        feeds.append(
            Feed(
                source=source,
                robot_of=robot_of,
                clocks={topic: clocks.get((index, topic), "header") for topic in robot_of},
                offsets_ns={topic: offsets.get((index, topic), 0) for topic in robot_of},
                untimed_ns=untimed_ns,
                leads_ns={
                    topic: lead_ns for topic in robot_of if (lead_ns := leads_ns.get((index, topic))) is not None
                },
                memory=memory,
            )
        )
    return tuple(feeds)


def _size_bytes(path: Path) -> int:
    if path.is_dir():
        return sum(file.stat().st_size for file in path.iterdir() if file.is_file())
    return path.stat().st_size
