"""Recorded messages in order of time: recordings in, ticks out.

Each recording is read once, in order of log time. Its messages are put in order of their stamps within a window;
the recordings are then merged by time. Memory is that of the window and one message a recording.
"""

from __future__ import annotations

import hashlib
import heapq
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import groupby

from mapmerge.grid import Grid
from replay.assemble import assemble
from replay.clocks import stamp_ns
from replay.codec import decode
from replay.errors import BadMessage, InputError
from replay.events import Clock, SkipCause, Skipped
from replay.messages import GridMessage, UpdateMessage
from replay.sources.base import RawMessage, Source


@dataclass(frozen=True, slots=True)
class Feed:
    """What is read from one recording.

    Parameters
    ----------
    robot_of
        Robot of each topic.
    clocks
        Clock of each robot.
    offsets_ns
        Added to each robot's times.
    untimed_ns
        Time given to saved maps, which have none.
    """

    source: Source
    robot_of: Mapping[str, str]
    clocks: Mapping[str, Clock]
    offsets_ns: Mapping[str, int]
    untimed_ns: int


@dataclass(frozen=True, slots=True)
class Window:
    """Which times are used (``start_ns`` ≤ time < ``stop_ns``), and how far messages are put in order."""

    start_ns: int | None
    stop_ns: int | None
    reorder_ns: int


@dataclass(slots=True)
class Tally:
    """What was read of one recording; grows while it is read."""

    messages: int = 0
    late: int = 0
    digest: hashlib._Hash = field(default_factory=hashlib.sha256)

    def count(self, raw: RawMessage) -> None:
        """Take a message that is used into the count and the digest."""
        self.messages += 1
        self.digest.update(f"{raw.topic} {raw.log_time_ns} {len(raw.data)}\n".encode())
        self.digest.update(raw.data)


@dataclass(frozen=True, slots=True, eq=False)
class Tick:
    """All maps of one time; ``messages`` were read since the tick before."""

    stamp_ns: int
    grids: Mapping[str, Grid]
    messages: int


@dataclass(frozen=True, slots=True, eq=False)
class _Arrival:
    """A message, or why it cannot be used, at the time at which it takes effect."""

    stamp_ns: int
    robot: str
    raw: RawMessage
    content: GridMessage | UpdateMessage | Skipped


def ticks(feeds: Sequence[Feed], tallies: Sequence[Tally], window: Window, *, strict: bool) -> Iterator[Tick | Skipped]:
    """Yield what the recordings say, in order of time.

    Parameters
    ----------
    feeds, tallies
        The recordings, and what is to be counted of each.
    strict
        Whether a message that cannot be used is an error.

    Raises
    ------
    InputError
        If a recording cannot be read or, with ``strict``, a message cannot be used.
    """
    streams = [_in_order(feed, tally, window) for feed, tally in zip(feeds, tallies, strict=True)]
    latest: dict[str, Grid] = {}
    messages = 0
    for time_ns, arrivals in groupby(heapq.merge(*streams, key=_stamp), key=_stamp):
        changed: dict[str, Grid] = {}
        for skipped in _take(arrivals, latest, changed):
            if skipped is not None:
                if strict:
                    raise InputError(
                        f"{skipped.topic} of {skipped.robot} at {skipped.log_time_ns} ns: {skipped.detail}"
                    )
                yield skipped
            messages += 1
        if changed:
            yield Tick(time_ns, changed, messages)
            messages = 0


def _stamp(arrival: _Arrival) -> int:
    return arrival.stamp_ns


def _take(arrivals: Iterable[_Arrival], latest: dict[str, Grid], changed: dict[str, Grid]) -> Iterator[Skipped | None]:
    """Apply messages of one time to the latest maps; yield for each None or why it was not used."""
    for arrival in arrivals:
        if isinstance(arrival.content, Skipped):
            yield arrival.content
            continue
        try:
            latest[arrival.robot] = assemble(latest.get(arrival.robot), arrival.content)
        except BadMessage as error:
            yield _skipped(arrival.robot, arrival.raw, error)
            continue
        changed[arrival.robot] = latest[arrival.robot]
        yield None


def _in_order(feed: Feed, tally: Tally, window: Window) -> Iterator[_Arrival]:
    """Yield a recording's messages with stamps that never decrease.

    A message is held back until one arrives whose stamp is later by the window; one that comes too late to be put in
    its place takes effect on arrival.
    """
    held: list[tuple[int, int, _Arrival]] = []
    newest_ns = released_ns = None
    for number, arrival in enumerate(_stamped(feed, tally, window)):
        stamp = arrival.stamp_ns
        if released_ns is not None and stamp < released_ns:
            tally.late += 1
            arrival = _Arrival(released_ns, arrival.robot, arrival.raw, arrival.content)  # noqa: PLW2901
        newest_ns = stamp if newest_ns is None else max(newest_ns, stamp)
        heapq.heappush(held, (arrival.stamp_ns, number, arrival))
        while held and held[0][0] <= newest_ns - window.reorder_ns:
            released_ns = held[0][0]
            yield heapq.heappop(held)[2]
    while held:
        yield heapq.heappop(held)[2]


def _stamped(feed: Feed, tally: Tally, window: Window) -> Iterator[_Arrival]:
    """Decode a recording's messages and give each its time on the reference's clock.

    Where that is not known, for a message that cannot be decoded or whose header has no time, it is that of the newest
    message before it.
    """
    last_ns = feed.untimed_ns
    lead_ns: int | None = None
    for raw in feed.source.messages(tuple(feed.robot_of)):
        robot = feed.robot_of[raw.topic]
        try:
            message = decode(raw)
        except BadMessage as error:
            if lead_ns is None or _inside(raw.log_time_ns + lead_ns, window):
                tally.count(raw)
                yield _Arrival(last_ns, robot, raw, _skipped(robot, raw, error))
            continue
        clock = feed.clocks[robot]
        if clock == "none":
            time_ns = feed.untimed_ns
        elif clock == "header" and message.stamp_ns <= 0:
            time_ns = last_ns
            tally.late += 1
        else:
            time_ns = max(0, stamp_ns(clock, raw, message) + feed.offsets_ns[robot])
            lead_ns = time_ns - raw.log_time_ns
        if clock != "none" and not _inside(time_ns, window):
            continue
        tally.count(raw)
        last_ns = max(last_ns, time_ns)
        yield _Arrival(time_ns, robot, raw, message)


def _inside(time_ns: int, window: Window) -> bool:
    after = window.start_ns is None or time_ns >= window.start_ns
    return after and (window.stop_ns is None or time_ns < window.stop_ns)


def _skipped(robot: str, raw: RawMessage, error: BadMessage) -> Skipped:
    return Skipped(robot, raw.topic, raw.log_time_ns, SkipCause(error.cause), error.detail)
