"""Where robots drove, of the transforms that were recorded beside their maps: to look at, nothing is decided by it.

The recordings are opened once more for it, so that what is read of them for the maps, and what is said of it, does not
depend on whether anybody looks. Messages that are damaged are passed over in silence. Where a recording cannot be read
on, that is a remark, and those of the others go on.
"""

from __future__ import annotations

import heapq
from collections.abc import Generator, Iterable, Iterator
from contextlib import ExitStack, closing
from itertools import chain, islice
from operator import itemgetter
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from replay.arrivals import Arrival, in_order
from replay.background import ReadAhead
from replay.errors import ReplayError
from replay.events import Moved, RobotInput
from replay.feeds import Tally
from replay.messages import TransformMessage
from replay.options import RunOptions
from replay.plan import Plan
from replay.sources import reopened
from replay.sources.base import TF_TYPES, SourceInfo
from replay.thinned_transforms import Thinned
from replay.tracker import Pose, Tracker

AUTO_BYTES = 64 << 20
AUTO_MESSAGES = 20_000
"""Larger recordings, those with more transforms, and those that were compressed as files are read for it only when that
is asked for: it would take more than about a tenth of the time of a usual run."""

_COMPRESSED = "zstd"
_COMPRESSED_PARTS = {".zstd", ".zst"}
# handed from one thread to the other at once: one by one, each would wait for the other
_AT_ONCE = 256

_Item = tuple[int, int, Arrival | str]
"""A time, which input it is of, and what comes then: a transform, or why there are no more."""


class Trajectories:
    """Reads where robots drove, in order of time, as far as it is asked.

    Parameters
    ----------
    plan
        The run.
    options
        What of it is wanted: ``trajectories``. With several ``jobs`` a thread of its own reads.
    """

    def __init__(self, plan: Plan, options: RunOptions) -> None:
        self._plan = plan
        self._options = options
        self._stack = ExitStack()
        self._items: Iterator[_Item] = iter(())
        self._next: _Item | None = None
        self._trackers: dict[int, Tracker] = {}
        self._remarks: list[str] = []

    def __enter__(self) -> Self:
        self._trackers = {index: Tracker(self._frames(index)) for index in self._wanted()}
        if self._trackers:
            streams = [self._stack.enter_context(closing(self._read(index))) for index in self._trackers]
            self._items = heapq.merge(*streams, key=itemgetter(0, 1))
            if self._options.jobs > 1:
                self._items = chain.from_iterable(self._stack.enter_context(ReadAhead(_batches(self._items))))
            self._next = next(self._items, None)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stack.close()

    def until(self, stamp_ns: int) -> tuple[Moved, ...]:
        """Return where robots were since this was asked last, up to a time."""
        while self._next is not None and self._next[0] <= stamp_ns:
            self._take(*self._next)
            self._next = next(self._items, None)
        found: dict[str, list[Pose]] = {}
        for tracker in self._trackers.values():
            for robot, poses in tracker.new_poses().items():
                found.setdefault(robot, []).extend(poses)
        return tuple(Moved(robot, np.array(found[robot])) for robot in sorted(found))

    def remarks(self) -> tuple[str, ...]:
        """Return what is to be said of it since this was asked last."""
        found, self._remarks = tuple(self._remarks), []
        return found

    def _wanted(self) -> list[int]:
        """Return which inputs hold transforms and maps to draw them on."""
        choice = self._options.trajectories
        return [
            index
            for index, info in enumerate(self._plan.infos)
            if choice != "none" and _transforms(info) and self._frames(index)
            if choice == "all" or self._is_cheap(index)
        ]

    def _is_cheap(self, index: int) -> bool:
        """Tell whether an input is one that is read unasked."""
        info = self._plan.infos[index]
        is_small = _transforms(info) <= AUTO_MESSAGES and self._plan.input_bytes(index) <= AUTO_BYTES
        return is_small and not _is_compressed(info, self._plan.feeds[index].source.path)

    def _frames(self, index: int) -> dict[str, str]:
        """Return the recorded map frames of the robots of an input, of those that have one."""
        robots: Iterable[RobotInput] = (item for item in self._plan.robots if index in item.inputs)
        return {item.robot: frame for item in robots if (frame := self._plan.map_frames[item.robot])}

    def _read(self, index: int) -> Generator[_Item, None, None]:
        """Yield what an input holds, and last, if that is not all, why."""
        stamp_ns = 0
        original = self._plan.feeds[index].source
        try:
            with Thinned(reopened(original, self._options.max_memory_bytes)) as source:
                feeds = self._plan.feeds_of_transforms(index, source)
                arrivals = (in_order(feed, Tally(), self._plan.window) for feed in feeds)
                for arrival in heapq.merge(*arrivals, key=lambda item: item.stamp_ns):
                    stamp_ns = arrival.stamp_ns
                    yield stamp_ns, index, arrival
        except ReplayError as error:
            yield stamp_ns, index, f"where robots drove is not read on from {original.path.name}: {error}"

    def _take(self, stamp_ns: int, index: int, item: Arrival | str) -> None:
        if isinstance(item, str):
            self._remarks.append(item)
        elif isinstance(item.content, TransformMessage):
            always = item.feed.clocks[item.raw.topic] == "none"
            self._trackers[index].take(None if always else stamp_ns, item.content.links)


def _batches(items: Iterator[_Item]) -> Iterator[list[_Item]]:
    while batch := list(islice(items, _AT_ONCE)):
        yield batch


def _is_compressed(info: SourceInfo, path: Path) -> bool:
    """Tell whether a recording, or a part of it, was compressed as a file."""
    parts = path.iterdir() if path.is_dir() else ()
    return info.format == _COMPRESSED or any(part.suffix in _COMPRESSED_PARTS for part in parts)


def _transforms(info: SourceInfo) -> int:
    """Return how many messages with transforms a recording holds."""
    return sum(item.message_count for item in info.topics if item.msgtype in TF_TYPES)
