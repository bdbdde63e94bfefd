"""Where robots drove, of the transforms that were recorded beside their maps: to look at, nothing is decided by it.

The recordings are opened once more for it, so that what is read of them for the maps, and what is said of it, does not
depend on whether anybody looks. What is damaged here is passed over in silence.
"""

from __future__ import annotations

import heapq
from collections.abc import Collection, Iterable, Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from replay.arrivals import Arrival, in_order
from replay.errors import ReplayError
from replay.events import Moved, RobotInput
from replay.feeds import Tally
from replay.messages import TransformMessage
from replay.options import RunOptions
from replay.plan import Plan
from replay.sources import open_source
from replay.sources.base import TF_TYPES, RawMessage, Source, SourceInfo
from replay.tracker import INTERVAL_NS, Pose, Tracker

AUTO_BYTES = 256 << 20
AUTO_MESSAGES = 100_000
"""Larger recordings, and those with more transforms, are read for it only when that is asked for: it would take longer
than a few seconds."""

# Of a message: how many there are, a sequence number or what CDR begins with, a stamp, and then the first frame's name.
_FRAME_AT, _LENGTH = 16, 4
_LONGEST_FRAME = 256
_MOST_PUBLISHERS = 1000


class Trajectories:
    """Reads where robots drove, in order of time, as far as it is asked.

    Parameters
    ----------
    plan
        The run.
    options
        What of it is wanted: ``trajectories``.
    """

    def __init__(self, plan: Plan, options: RunOptions) -> None:
        self._plan = plan
        self._options = options
        self._stack = ExitStack()
        self._arrivals: Iterator[tuple[int, int, Arrival]] = iter(())
        self._next: tuple[int, int, Arrival] | None = None
        self._trackers: dict[int, Tracker] = {}

    def __enter__(self) -> Self:
        wanted = self._wanted()
        with suppress(ReplayError):
            streams = [stream for index in wanted for stream in self._opened(index)]
            self._arrivals = heapq.merge(*streams, key=lambda item: item[:2])
            self._next = next(self._arrivals, None)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._arrivals = iter(())
        self._stack.close()

    def until(self, stamp_ns: int) -> tuple[Moved, ...]:
        """Return where robots were since this was asked last, up to a time."""
        with suppress(ReplayError):
            while self._next is not None and self._next[0] <= stamp_ns:
                self._take(*self._next)
                self._next = None  # which it stays if the recording breaks off here
                self._next = next(self._arrivals, None)
        found: dict[str, list[Pose]] = {}
        for tracker in self._trackers.values():
            for robot, poses in tracker.new_poses().items():
                found.setdefault(robot, []).extend(poses)
        return tuple(Moved(robot, np.array(found[robot])) for robot in sorted(found))

    def _wanted(self) -> list[int]:
        """Return which inputs hold transforms and maps to draw them on."""
        choice = self._options.trajectories
        if choice == "none":
            return []
        return [
            index
            for index, info in enumerate(self._plan.infos)
            if (messages := _transforms(info))
            and self._frames(index)
            and (choice == "all" or (messages <= AUTO_MESSAGES and self._plan.input_bytes(index) <= AUTO_BYTES))
        ]

    def _frames(self, index: int) -> dict[str, str]:
        """Return the recorded map frames of the robots of an input, of those that have one."""
        robots: Iterable[RobotInput] = (item for item in self._plan.robots if index in item.inputs)
        return {item.robot: frame for item in robots if (frame := self._plan.map_frames[item.robot])}

    def _opened(self, index: int) -> list[Iterator[tuple[int, int, Arrival]]]:
        path = self._options.runs[index].path
        source = self._stack.enter_context(Thinned(open_source(path, self._options.max_memory_bytes)))
        self._trackers[index] = Tracker(self._frames(index))
        return [
            ((arrival.stamp_ns, index, arrival) for arrival in in_order(feed, Tally(), self._plan.window))
            for feed in self._plan.feeds_of_transforms(index, source)
        ]

    def _take(self, stamp_ns: int, index: int, arrival: Arrival) -> None:
        content = arrival.content
        if isinstance(content, TransformMessage):
            always = arrival.feed.clocks[arrival.raw.topic] == "none"
            self._trackers[index].take(None if always else stamp_ns, content.links)


class Thinned:
    """A recording of whose transforms ten a second of each publisher are read: decoding them is what takes time.

    Who published a message is told from its length and from the first two frames in it, which stand at the same place
    whatever recorded them.
    """

    def __init__(self, source: Source) -> None:
        self._source = source
        self._last_ns: dict[tuple[str, int, bytes], int] = {}
        self.path, self.losses = source.path, source.losses

    @property
    def files(self) -> tuple[Path, ...]:
        """Those of the recording."""
        return self._source.files

    @property
    def info(self) -> SourceInfo:
        """What the recording holds."""
        return self._source.info

    def close(self) -> None:
        """Close the recording."""
        self._source.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def messages(self, topics: Collection[str]) -> Iterator[RawMessage]:
        """Yield messages as the recording does, without those that follow too soon."""
        for raw in self._source.messages(topics):
            key = raw.topic, len(raw.data), _first_frames(raw.data, raw.encoding == "cdr")
            since_ns = raw.log_time_ns - self._last_ns.get(key, -INTERVAL_NS)
            if 0 <= since_ns < INTERVAL_NS:
                continue
            if len(self._last_ns) > _MOST_PUBLISHERS:
                self._last_ns.clear()
            self._last_ns[key] = raw.log_time_ns
            yield raw


def _first_frames(data: bytes | memoryview, is_cdr: bool) -> bytes:
    """Return the bytes of the first transform's frames in a message, whatever they are."""
    child_at = _FRAME_AT + _LENGTH + _length(data, _FRAME_AT)
    if is_cdr:
        child_at += -child_at % _LENGTH
    return bytes(data[_FRAME_AT : child_at + _LENGTH + _length(data, child_at)])


def _length(data: bytes | memoryview, at: int) -> int:
    return min(int.from_bytes(data[at : at + _LENGTH], "little"), _LONGEST_FRAME)


def _transforms(info: SourceInfo) -> int:
    """Return how many messages with transforms a recording holds."""
    return sum(item.message_count for item in info.topics if item.msgtype in TF_TYPES)
