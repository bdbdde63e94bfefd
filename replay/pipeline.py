"""The one pipeline: recordings → ticks → the merger's step → events → sinks."""

from __future__ import annotations

from collections.abc import Generator, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import replace
from time import perf_counter

from mapmerge.config import MergeConfig
from mapmerge.errors import MapMergeError
from mapmerge.merger import Merger
from mapmerge.prior import Prior
from replay import __version__
from replay.background import Courier, ReadAhead
from replay.beliefs import Beliefs
from replay.errors import InputError
from replay.events import Event, Finished, Merged, Noted, Skipped, Started, Timing
from replay.feeds import Tally
from replay.footprint import enough_memory
from replay.gallery import Gallery
from replay.no_map import losses_of, none_used
from replay.open_plan import memory_limit, open_plan
from replay.options import OutputOptions, RunOptions
from replay.plan import Plan
from replay.report import ReportBuilder
from replay.sinks.base import Sink
from replay.timeline import Transforms, ticks
from replay.trajectories import Trajectories


def events(plan: Plan, options: RunOptions, written: OutputOptions | None = None) -> Iterator[Event]:
    """Replay what was planned and yield what happens.

    Parameters
    ----------
    plan, options
        What is read, and what was said of that.
    written
        What is written of it, to be told in the report.

    Raises
    ------
    InputError
        If a recording cannot be read, no map could be used, or there is not enough memory.
    """
    settings = {**options.settings(), "outputs": written.settings(options.images) if written else None}
    report = ReportBuilder(plan.robots, settings, __version__)
    beliefs = Beliefs(plan.map_frames, options.init_poses, plan.recordings_with_transforms())
    feeds = (*plan.feeds, *(plan.transform_feeds or ()))
    tallies = tuple(Tally() for _ in feeds)
    inputs = plan.describe_inputs()
    done, total, stamp_ns = 0, sum(item.message_count for item in plan.robots), None
    priors: dict[str, Prior] = {}

    yield Started(plan.robots, settings, inputs)
    yield from _noted(report, beliefs.foreseen())
    with ExitStack() as stack:
        read = ticks(feeds, tallies, plan.window, strict=options.strict)
        items = stack.enter_context(ReadAhead(read)) if options.jobs > 1 else read
        mapped = stack.enter_context(ThreadPoolExecutor(options.jobs)).map if options.jobs > 1 else map
        merger = Merger([item.robot for item in plan.robots], merge_config(options), mapped)
        gallery = Gallery(options.images, merger.explain)
        trajectories = stack.enter_context(Trajectories(plan, options))
        for tick in items:
            if isinstance(tick, Transforms):
                beliefs.take(tick)
                continue
            if isinstance(tick, Noted):
                yield from _noted(report, [tick])
                continue
            if isinstance(tick, Skipped):
                report.skip(tick)
                yield tick
                continue
            if tick.grids:
                # one without maps ends the run; what was recorded after the last maps is too late for them
                priors, notes = beliefs.now()
                yield from _noted(report, notes)
            begin = perf_counter()
            with enough_memory(tick.grids, tick.stamp_ns):
                try:
                    result = merger.step(tick.grids, priors, is_last=tick.is_last)
                except MapMergeError as error:
                    raise InputError(f"the maps of {', '.join(tick.grids)} at {tick.stamp_ns} ns: {error}") from error
                merged = perf_counter()
                pictures = gallery.due(result)
            timing = Timing(merged - begin, perf_counter() - merged)
            report.take(tick.stamp_ns, result, priors)
            done, stamp_ns = done + tick.messages, tick.stamp_ns
            moved = trajectories.until(stamp_ns)
            now = report.build(stamp_ns, result, inputs)
            yield Merged(stamp_ns, result, now, pictures, timing, done, total, moved, trajectories.remarks())
    yield from _noted(report, beliefs.missed())
    final = report.build(stamp_ns, merger.result, plan.describe_inputs(tallies), is_last=True)
    if stamp_ns is None:
        raise none_used([str(run.path) for run in options.runs], {item.topic for item in plan.robots}, losses_of(final))
    yield Finished(final)


def merge_config(options: RunOptions) -> MergeConfig:
    """Return the settings of the merger, for the memory that there may be."""
    limit = memory_limit(options)
    if limit is None:
        return options.merge
    return replace(options.merge, max_canvas_cells=min(limit.canvas_cells, options.merge.max_canvas_cells))


def _noted(report: ReportBuilder, notes: Iterable[Noted]) -> Iterator[Noted]:
    for note in notes:
        report.note(note)
        yield note


def merge(options: RunOptions) -> Generator[Event, None, None]:
    """Open a run's inputs, merge them, and yield what happens.

    Raises
    ------
    ReplayError
        If an input cannot be read, or the robots that were asked for are not there.
    """
    with open_plan(options) as plan:
        yield from events(plan, options)


def drain(stream: Iterable[Event], sinks: Iterable[Sink], jobs: int = 1) -> Finished:
    """Give each event to each sink, in a thread of its own if there are several jobs, and return the last event."""
    targets = tuple(sinks)

    def give(event: Event) -> None:
        for sink in targets:
            sink.take(event)

    last: Event | None = None
    with ExitStack() as stack:
        # whatever happens, the reading ends before the recordings are closed
        stack.callback(getattr(stream, "close", lambda: None))
        take = stack.enter_context(Courier(give)).send if jobs > 1 else give
        for event in stream:
            last = event
            take(event)
    if not isinstance(last, Finished):
        raise AssertionError("a run ends with Finished")
    return last
