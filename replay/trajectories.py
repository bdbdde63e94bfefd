"""Where robots drove, of the transforms that were recorded beside their maps: to look at, nothing is decided by it.

The recordings are opened once more for it, so that what is read of them for the maps, and what is said of it, does not
depend on whether anybody looks. What is damaged here is passed over in silence.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from mapmerge.sim2 import wrap_angle
from replay.arrivals import Arrival, in_order
from replay.errors import ReplayError
from replay.events import Moved, RobotInput
from replay.feeds import Tally
from replay.messages import FrameLink, TransformMessage
from replay.options import RunOptions
from replay.plan import Plan
from replay.sources import open_source
from replay.sources.base import TF_TYPES, RawMessage, Source, SourceInfo
from replay.transforms import TransformBuffer

AUTO_BYTES = 256 << 20
AUTO_MESSAGES = 100_000
"""Larger recordings, and those with more transforms, are read for it only when that is asked for: it would take longer
than a few seconds."""

STEP_M = 0.1
STEP_RAD = 0.1
MOST_POSES = 10_000
"""After so many poses of a robot the steps are twice as long, and so on."""

_INTERVAL_NS = 80_000_000
# Of a message: how many there are, a sequence number or what CDR begins with, a stamp, and then the first frame's name.
_FRAME_AT, _LENGTH = 16, 4
_LONGEST_FRAME = 256
_MOST_PUBLISHERS = 1000
_BASES = ("base_footprint", "base_link")

_Pose = tuple[float, float, float]


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
        found: dict[str, list[_Pose]] = {}
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
            since_ns = raw.log_time_ns - self._last_ns.get(key, -_INTERVAL_NS)
            if 0 <= since_ns < _INTERVAL_NS:
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


@dataclass(slots=True)
class _Track:
    """What is known of one robot's way."""

    base: str | None = None
    links: int = 0
    last: _Pose | None = None
    seen_ns: int | None = None
    count: int = 0


class Tracker:
    """Folds the transforms of one recording into poses of the robots in their map frames.

    A robot is where its base is: the frame ``base_footprint`` or ``base_link``, by itself or behind a prefix, that
    hangs on its map frame. Where several do, it is the one whose prefix is the robot's name; else nobody can tell.

    Parameters
    ----------
    frames
        Map frame of each robot of the recording.
    """

    def __init__(self, frames: Mapping[str, str]) -> None:
        self._frames = frames
        self._buffer = TransformBuffer()
        self._bases: list[str] = []
        self._known: set[str] = set()
        self._tracks = {robot: _Track() for robot in frames}
        self._new: dict[str, list[_Pose]] = {}

    def take(self, stamp_ns: int | None, links: Sequence[FrameLink]) -> None:
        """Take in transforms that hold from a time on, or always."""
        for link in links:
            self._buffer.hold(link, stamp_ns)
            if link.child not in self._known:
                self._known.add(link.child)
                if _base_prefix(link.child) is not None:
                    self._bases.append(link.child)
        if stamp_ns is None:
            return
        for robot, track in self._tracks.items():
            if track.seen_ns is None or stamp_ns - track.seen_ns >= _INTERVAL_NS:
                self._look(robot, track, stamp_ns)

    def new_poses(self) -> dict[str, list[_Pose]]:
        """Return where robots were since this was asked last."""
        new, self._new = self._new, {}
        return new

    def _look(self, robot: str, track: _Track, stamp_ns: int) -> None:
        track.seen_ns = stamp_ns
        chain = None if track.base is None else self._buffer.chain(self._frames[robot], track.base)
        if chain is None or track.links != len(self._known):
            # which base it is depends on which frames there are
            track.base, track.links = self._base(robot), len(self._known)
            chain = None if track.base is None else self._buffer.chain(self._frames[robot], track.base)
        if chain is None:
            return
        flat = chain.target_from_source.flat()
        pose = flat.x_m, flat.y_m, flat.yaw_rad
        if track.last is None or _is_step(track.last, pose, 2.0 ** (track.count // MOST_POSES)):
            track.last = pose
            track.count += 1
            self._new.setdefault(robot, []).append(pose)

    def _base(self, robot: str) -> str | None:
        """Return the robot's base frame; of several of one robot the first kind, None where they may be others'."""
        frame = self._frames[robot]
        linked = [base for base in self._bases if self._buffer.chain(frame, base) is not None]
        own = [base for base in linked if _base_prefix(base) == robot]
        prefixes = {_base_prefix(base) for base in linked}
        is_shared = list(self._frames.values()).count(frame) > 1
        if not own and (len(prefixes) != 1 or is_shared):
            return None
        return min(
            own or linked, key=lambda base: next(rank for rank, kind in enumerate(_BASES) if base.endswith(kind))
        )


def _base_prefix(frame: str) -> str | None:
    """Return what stands before ``base_link`` in the name of a frame, without what parts them; None if it is none."""
    for kind in _BASES:
        prefix = frame.removesuffix(kind)
        if prefix != frame and (not prefix or prefix[-1] in "/_."):
            return prefix.rstrip("/_.")
    return None


def _rank(base: str) -> int:
    return next(rank for rank, kind in enumerate(_BASES) if base.endswith(kind))


def _is_step(one: _Pose, other: _Pose, times: float) -> bool:
    far_m = math.hypot(one[0] - other[0], one[1] - other[1])
    return far_m >= STEP_M * times or abs(wrap_angle(one[2] - other[2])) >= STEP_RAD * times


def _transforms(info: SourceInfo) -> int:
    """Return how many messages with transforms a recording holds."""
    return sum(item.message_count for item in info.topics if item.msgtype in TF_TYPES)
