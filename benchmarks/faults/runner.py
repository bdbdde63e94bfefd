"""One replay in this process, with all that is to be judged of it: what was used, what was named, where maps lie."""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import traceback
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

from benchmarks.faults.placement import misplaced
from benchmarks.faults.remembered import RememberingMerger
from mapmerge.config import MergeConfig
from mapmerge.grid import Grid
from replay import pipeline
from replay.errors import ReplayError, UsageError
from replay.events import Merged, Skipped
from replay.feeds import Feed
from replay.open_plan import open_plan
from replay.options import RunOptions
from replay.plain_text import plain
from replay.plan import Plan
from replay.runs import RunPath
from replay.sources.base import RawMessage, Source


@dataclass(frozen=True, slots=True, order=True)
class Used:
    """A message, told by its topic, its time and a digest of its bytes."""

    topic: str
    log_time_ns: int
    digest: str

    @staticmethod
    def of(raw: RawMessage) -> Used:
        """Tell a message."""
        return Used(raw.topic, raw.log_time_ns, hashlib.sha256(raw.data).hexdigest()[:16])


@dataclass(frozen=True, slots=True)
class Named:
    """What the program said that it did not use."""

    cause: str
    topic: str
    log_time_ns: int
    place: str
    detail: str
    messages: int | None

    @staticmethod
    def of(event: Skipped) -> Named:
        """Take what matters of an event."""
        return Named(str(event.cause), event.topic, event.log_time_ns, event.place, event.detail, event.messages)


@dataclass(frozen=True, slots=True)
class Ran:
    """What came of a run.

    Parameters
    ----------
    error
        The line of the error that it ended with; "" if none.
    is_usage
        Whether that is about robots and flags, which it names, rather than about a file.
    crash
        What it ended with otherwise: a traceback, or how the process died; "" if it did not.
    hung
        Whether it had to be stopped.
    used
        The messages that were used.
    named
        What was said not to be used.
    unused
        How many messages are on map topics that were said to be no robot's.
    topics
        How many messages are on each topic, by its name and type.
    misplaced
        Maps that were placed where they do not lie, in words.
    merged
        The robots that were merged in the end, and a digest of the merged map.
    program
        What the command line did otherwise than the run in this process; "" if nothing, or if it was not tried.
    """

    error: str = ""
    is_usage: bool = False
    crash: str = ""
    hung: bool = False
    used: tuple[Used, ...] = ()
    named: tuple[Named, ...] = ()
    unused: int = 0
    topics: Mapping[tuple[str, str], int] = field(default_factory=dict)
    misplaced: tuple[str, ...] = ()
    merged: tuple[str, ...] = ()
    program: str = ""


Misplaced = Callable[[Merged, Mapping[str, Grid]], list[str]]


def run(
    path: Path, *, program: bool = False, max_memory_bytes: int | None = None, misplaced: Misplaced = misplaced
) -> Ran:
    """Replay a recording; with ``program`` also by the command line.

    Parameters
    ----------
    misplaced
        Tells of an event which maps are placed where they do not lie.
    """
    options = RunOptions((RunPath(None, path),), images="none", max_memory_bytes=max_memory_bytes)
    try:
        ran = _replayed(options, misplaced)
    except ReplayError as error:
        ran = Ran(error=str(error), is_usage=isinstance(error, UsageError))
    except Exception:  # noqa: BLE001 - whatever else comes is what is looked for
        ran = Ran(crash=traceback.format_exc())
    return replace(ran, program=_by_command_line(options, ran)) if program and not ran.crash else ran


def _replayed(options: RunOptions, misplaced: Misplaced) -> Ran:
    seen: list[RawMessage] = []
    named: list[Named] = []
    wrong: dict[str, None] = {}
    last: Merged | None = None
    with _remembering() as mergers, open_plan(options) as plan:
        unused = _unused(plan)
        topics = {(each.name, each.msgtype): each.message_count for info in plan.infos for each in info.topics}
        for event in pipeline.events(_watched(plan, seen), options):
            if isinstance(event, Skipped):
                named.append(Named.of(event))
            elif isinstance(event, Merged):
                last = event
                wrong.update(dict.fromkeys(misplaced(event, mergers[-1].latest)))
    skipped = {(each.topic, each.log_time_ns) for each in named if not each.place}
    used = tuple(Used.of(raw) for raw in seen if (raw.topic, raw.log_time_ns) not in skipped)
    return Ran(
        used=used,
        named=tuple(named),
        unused=unused,
        topics=topics,
        misplaced=tuple(wrong),
        merged=_merged(last),
    )


def _unused(plan: Plan) -> int:
    """Return how many messages are on map topics that the terminal says are not used."""
    names = plan.unused_topics()
    return sum(topic.message_count for info in plan.infos for topic in info.topics if topic.name in names)


def _merged(last: Merged | None) -> tuple[str, ...]:
    if last is None:
        return ()
    merged = last.result.merged
    cells = b"" if merged is None else merged.cells.tobytes()
    robots = [robot for robot, found in last.result.robots.items() if found.merged_from_map is not None]
    return (*robots, hashlib.sha256(cells).hexdigest()[:16])


class _WatchedSource:
    """A source whose messages are seen on their way."""

    def __init__(self, source: Source, seen: list[RawMessage]) -> None:
        self._source = source
        self._seen = seen

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - whatever the source has
        return getattr(self._source, name)

    def messages(self, topics: Collection[str]) -> Iterator[RawMessage]:
        for raw in self._source.messages(topics):
            self._seen.append(raw)
            yield raw


def _watched(plan: Plan, seen: list[RawMessage]) -> Plan:
    def watched(feed: Feed) -> Feed:
        return replace(feed, source=_WatchedSource(feed.source, seen))

    return replace(plan, feeds=tuple(map(watched, plan.feeds)))


@contextmanager
def _remembering() -> Iterator[list[RememberingMerger]]:
    """Let runs take a merger that remembers; yields those that they took."""
    made: list[RememberingMerger] = []

    def new(robots: list[str], config: MergeConfig, mapped: Any = map) -> RememberingMerger:  # noqa: ANN401
        made.append(RememberingMerger(robots, config, mapped))
        return made[-1]

    with patch.object(pipeline, "Merger", new):
        yield made


def _by_command_line(options: RunOptions, expected: Ran) -> str:
    """Return what the command line does otherwise than a run did; "" if nothing."""
    from replay.cli import main

    path = options.runs[0].path
    output = path.parent / "merged_by_program.mcap"
    said, told = io.StringIO(), io.StringIO()
    arguments = ["merge", str(path), "-o", str(output), "--no-rrd", "--images", "none", "--json"]
    if options.max_memory_bytes is not None:
        arguments += ["--max-memory", str(options.max_memory_bytes)]
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(told), _remembering():
        status = main(arguments)
    lines = told.getvalue().splitlines()
    left = sorted(each.name for each in path.parent.glob("merged_by_program*"))
    if expected.error:
        fine = status in {2, 3} and lines[-1:] == [f"replay: error: {plain(expected.error)}"] and not left
        return "" if fine else f"it ended with {status}, left {left} and said {lines[-3:]}, not {expected.error}"
    if status not in {0, 1} or left != ["merged_by_program.json", "merged_by_program.mcap"]:
        return f"it ended with {status}, left {left} and said {lines[-3:]}"
    skipped = json.loads(said.getvalue())["skipped_at"]
    return "" if bool(skipped) == bool(expected.named) else f"its report names {len(skipped)} things that were skipped"
