"""How a run is understood: inputs are opened, robots found, clocks and frames chosen."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import partial

from replay.clocks import Probe, agreed, frames, offsets_ns, probe, refuse_recorded_twice
from replay.errors import UsageError
from replay.events import Clock, RobotInput
from replay.feeds import Feed, Window
from replay.footprint import MemoryLimit
from replay.init_pose import refuse_unfit
from replay.no_map import refuse_mapless
from replay.options import NS_PER_S, RunOptions
from replay.plan import MERGED_FRAME, Plan
from replay.selection import Selected, select
from replay.sources import open_sources
from replay.sources.base import GRID_TYPE, UPDATE_TYPE, Source, SourceInfo
from replay.stamps import LAST_NS
from replay.transform_feeds import feeds_of, transform_feeds


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
        tuple(run.robot for run in options.runs),
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
