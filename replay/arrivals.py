"""The messages of one recording, decoded, with their times, in order of time.

A recording is read once, in order of log time. Its messages are put in order of their stamps within a window. Memory is
that of the window.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from dataclasses import dataclass, replace

from mapmerge.grid import Grid
from replay.codec import decode, decode_transforms
from replay.errors import BadMessage
from replay.events import Noted, Skipped
from replay.feeds import Content, Feed, Tally, Window
from replay.message_times import MessageTimes
from replay.messages import GridMessage, TransformMessage, UpdateMessage
from replay.odd_cells import OddCells
from replay.skip_cause import SkipCause
from replay.sources.base import GRID_TYPE, TF_TYPES, RawMessage
from replay.sources.lapses import Lapse
from replay.stamps import LAST_NS

_NO_TIME = BadMessage(
    SkipCause.BAD_TIME,
    "nothing tells when it was: its header has no time that can be believed, or is not asked, and it was recorded at "
    f"one that no ROS stamp can hold; at most {LAST_NS} ns was expected",
)


@dataclass(frozen=True, slots=True, eq=False)
class KnownMap:
    """A robot's map, with all updates of it; ``topic`` and ``log_time_ns`` are those of the full map."""

    grid: Grid
    topic: str
    log_time_ns: int


@dataclass(frozen=True, slots=True, eq=False)
class Arrival:
    """A message, or why it cannot be used, at the time at which it takes effect."""

    stamp_ns: int
    feed: Feed
    raw: RawMessage
    content: Content

    @property
    def robot(self) -> str:
        """Whose map it is; "" if it is none."""
        return self.feed.robot_of.get(self.raw.topic, "")

    def applied(self, known: KnownMap | None) -> KnownMap:
        """Return the robot's map after this message, which is a map or an update of one.

        Raises
        ------
        BadMessage
            If it cannot be: an update without a map, or between which and its map another one may be lost.
        """
        if not isinstance(self.content, GridMessage | UpdateMessage):
            raise TypeError("neither a map nor an update")
        is_new = isinstance(self.content, GridMessage)
        last = None if known is None or is_new or self._is_parted_from(known) else known
        full = last or self.raw
        return KnownMap(self.feed.assembled(last.grid if last else None, self.content), full.topic, full.log_time_ns)

    def _is_parted_from(self, known: KnownMap) -> bool:
        """Tell whether another full map may be lost between one and this update."""
        return self.feed.source.losses.part(known.topic, known.log_time_ns, self.raw.log_time_ns)

    def skipped(self, error: BadMessage) -> Skipped:
        """Return why the message, or a part of it, is not used after all."""
        return self.feed.skipped(self.raw, error)


def in_order(feed: Feed, tally: Tally, window: Window) -> Iterator[Arrival]:
    """Yield a recording's messages with stamps that never decrease.

    A message is held back until one arrives whose stamp is later by the window; one that comes too late to be put in
    its place takes effect on arrival.
    """
    held: list[tuple[int, int, Arrival]] = []
    newest_ns = released_ns = None
    for number, arrival in enumerate(_stamped(feed, tally, window)):
        stamp = arrival.stamp_ns
        if released_ns is not None and stamp < released_ns:
            tally.late += not isinstance(arrival.content, Skipped | Noted)  # which are not taken in at all
            arrival = replace(arrival, stamp_ns=released_ns)  # noqa: PLW2901
        newest_ns = stamp if newest_ns is None else max(newest_ns, stamp)
        heapq.heappush(held, (arrival.stamp_ns, number, arrival))
        while held and held[0][0] <= newest_ns - window.reorder_ns:
            released_ns = held[0][0]
            yield heapq.heappop(held)[2]
    while held:
        yield heapq.heappop(held)[2]


def _stamped(feed: Feed, tally: Tally, window: Window) -> Iterator[Arrival]:
    """Decode a recording's messages and give each its time on the reference's clock."""
    times = MessageTimes(feed, tally)
    before = _Before()
    odd_cells = OddCells(feed.source.path.name)
    for raw in feed.source.messages(tuple(feed.robot_of)):
        yield from _lost(feed, raw.log_time_ns, times.newest_ns)
        content = _decoded(feed, raw)
        time_ns = times.of(raw, content)
        if time_ns is None:
            content, time_ns = _unusable(feed, raw, _NO_TIME), times.newest_ns
        yield from (Arrival(time_ns, feed, raw, note) for note in times.new_notes())
        if (odd := odd_cells.note(raw, content)) is not None:
            yield Arrival(time_ns, feed, raw, Noted(feed.robot_of[raw.topic], odd))
        early = window.start_ns is not None and time_ns < window.start_ns
        if early and isinstance(content, GridMessage | UpdateMessage):
            tally.count(raw)
            before.take(Arrival(time_ns, feed, raw, content))
        unwanted = early and not isinstance(content, TransformMessage)
        if unwanted or (window.stop_ns is not None and time_ns >= window.stop_ns):
            continue
        yield from before.release(window.start_ns)
        tally.count(raw)
        yield Arrival(time_ns, feed, raw, content)
    yield from before.release(window.start_ns)
    yield from _lost(feed, tally.until_ns or 0, times.newest_ns)


def _lost(feed: Feed, log_time_ns: int, time_ns: int) -> Iterator[Arrival]:
    """Yield what of a recording turned out to be lost since this was asked last."""
    for loss in feed.source.losses.new():
        raw = RawMessage(loss.topic, "", "cdr", log_time_ns, b"")
        robot, name = feed.robot_of.get(loss.topic, ""), feed.source.path.name
        lost = Skipped(robot, loss.topic, log_time_ns, loss.cause, loss.detail, name, loss.place, loss.messages)
        yield Arrival(time_ns, feed, raw, lost)


def _decoded(feed: Feed, raw: RawMessage) -> Content:
    try:
        if raw.msgtype in TF_TYPES:
            return decode_transforms(raw)
        message = decode(raw)
        if feed.memory is not None and isinstance(message, GridMessage):
            feed.memory.refuse_over(message.grid)
        return message
    except BadMessage as error:
        return _unusable(feed, raw, error)


def _unusable(feed: Feed, raw: RawMessage, error: BadMessage) -> Skipped:
    """Return why a message is not used; no update belongs to the full map before it, if it is one."""
    if raw.msgtype == GRID_TYPE:
        feed.source.losses.add_lapse(raw.topic, Lapse(raw.log_time_ns, raw.log_time_ns))
    return feed.skipped(raw, error)


class _Before:
    """The last map of each robot before the times that are used."""

    def __init__(self) -> None:
        self._last: dict[str, tuple[int, Arrival, KnownMap]] = {}

    def take(self, arrival: Arrival) -> None:
        """Keep a map, or an update of the one that is kept; what cannot be used is left out, as all of that time is."""
        kept = self._last.get(arrival.robot)
        is_map = isinstance(arrival.content, GridMessage)
        if kept is not None and is_map and arrival.stamp_ns < kept[0]:
            return
        try:
            known = arrival.applied(kept[2] if kept else None)
        except BadMessage:
            return
        # of its map, because what may be lost behind that decides which updates belong to it
        full = arrival if kept is None or is_map else kept[1]
        self._last[arrival.robot] = arrival.stamp_ns, full, known

    def release(self, start_ns: int | None) -> Iterator[Arrival]:
        """Yield what was kept, once, as maps of the time ``start_ns``."""
        for time_ns, full, known in self._last.values():
            yield replace(full, stamp_ns=start_ns or 0, content=GridMessage(time_ns, "", known.grid))
        self._last.clear()
