"""The messages of one recording, decoded, with their times, in order of time.

A recording is read once, in order of log time. Its messages are put in order of their stamps within a window. Memory is
that of the window.
"""

from __future__ import annotations

import hashlib
import heapq
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

from mapmerge.grid import Grid
from replay.assemble import assemble
from replay.clocks import stamp_ns
from replay.codec import decode, decode_transforms
from replay.errors import BadMessage
from replay.events import Clock, Noted, Skipped
from replay.footprint import MemoryLimit
from replay.messages import GridMessage, TransformMessage, UpdateMessage
from replay.odd_cells import OddCells
from replay.options import NS_PER_S
from replay.skip_cause import SkipCause
from replay.sources.base import GRID_TYPE, TF_TYPES, RawMessage, Source
from replay.sources.lapses import Lapse
from replay.stamps import LAST_NS, Stamp, StampCheck
from replay.words import moment

_NO_TIME = BadMessage(
    SkipCause.BAD_TIME,
    "nothing tells when it was: its header has no time that can be believed, or is not asked, and it was recorded at "
    f"one that no ROS stamp can hold; at most {LAST_NS} ns was expected",
)

Content = GridMessage | UpdateMessage | TransformMessage | Skipped | Noted


@dataclass(frozen=True, slots=True)
class Feed:
    """What is read from one recording: maps, or transforms.

    Parameters
    ----------
    robot_of
        Robot of each topic; "" for transforms, which are no robot's own.
    clocks
        Clock of each topic.
    offsets_ns
        Added to each topic's times.
    untimed_ns
        Time given to saved maps, which have none, and to transforms that hold always.
    leads_ns
        How far the stamps of topics are ahead of the recorder's clock when they begin, where that is known.
    memory
        A map that needs more is not used; None for any.
    """

    source: Source
    robot_of: Mapping[str, str]
    clocks: Mapping[str, Clock]
    offsets_ns: Mapping[str, int]
    untimed_ns: int
    leads_ns: Mapping[str, int] = field(default_factory=dict)
    memory: MemoryLimit | None = None

    def assembled(self, last: Grid | None, message: GridMessage | UpdateMessage) -> Grid:
        """Return a robot's map after a message; raises as `assemble` does, or because it would need too much memory."""
        grid = assemble(last, message)
        if self.memory is not None and isinstance(message, UpdateMessage):  # full maps are checked as they are decoded
            self.memory.refuse_over(grid)
        return grid


@dataclass(frozen=True, slots=True)
class Window:
    """Which times are used (``start_ns`` ≤ time < ``stop_ns``), and how far messages are put in order.

    A robot's last map before ``start_ns`` is used as well: at ``start_ns``, it is what is known. So are transforms.
    """

    start_ns: int | None
    stop_ns: int | None
    reorder_ns: int


@dataclass(slots=True)
class Tally:
    """What was read of one recording; grows while it is read."""

    messages: int = 0
    late: int = 0
    bad_stamps: int = 0
    until_ns: int | None = None
    digest: hashlib._Hash = field(default_factory=hashlib.sha256)

    def count(self, raw: RawMessage) -> None:
        """Take a message that is used into the count and the digest."""
        self.messages += 1
        self.until_ns = raw.log_time_ns
        self.digest.update(f"{raw.topic} {raw.log_time_ns} {len(raw.data)}\n".encode())
        self.digest.update(raw.data)


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
        return _skipped(self.feed, self.raw, error)


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
    times = _Times(feed, tally)
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
    return _skipped(feed, raw, error)


class _Times:
    """Gives the messages of a recording their times.

    Where a message does not say, because it cannot be decoded or its header has no time, or one that cannot be believed
    (see `replay.stamps`), it is its log time, shifted as that of the message before it on its topic was; without one,
    the newest time so far. Where no stamp can hold its log time either, nothing tells when it was.
    """

    def __init__(self, feed: Feed, tally: Tally) -> None:
        self._feed = feed
        self._tally = tally
        self._leads_ns = {topic: lead_ns + feed.offsets_ns[topic] for topic, lead_ns in feed.leads_ns.items()}
        self._checks = {topic: StampCheck(feed.leads_ns.get(topic)) for topic in feed.clocks}
        self._doubted: set[str] = set()
        self._notes: list[Noted] = []
        self.newest_ns = feed.untimed_ns

    def of(self, raw: RawMessage, content: Content) -> int | None:
        """Return the time of a message; None if nothing tells it."""
        if self._feed.clocks[raw.topic] == "none":
            return self._feed.untimed_ns
        time_ns = self._time_ns(raw, content)
        if time_ns is None and isinstance(content, Skipped | Noted):
            return self.newest_ns
        self.newest_ns = max(self.newest_ns, time_ns or 0)
        return time_ns

    def _time_ns(self, raw: RawMessage, content: Content) -> int | None:
        is_recorded = raw.log_time_ns <= LAST_NS
        clock = self._feed.clocks[raw.topic]
        if isinstance(content, Skipped | Noted):
            return self._guessed(raw)
        if isinstance(content, TransformMessage) and content.stamp_ns <= 0:
            return self._shifted(raw, raw.log_time_ns) if is_recorded else None
        if clock == "header" and not self._believes(raw, content.stamp_ns):
            return self._guessed(raw)
        own_ns = stamp_ns(clock, raw, content)
        if clock == "header":
            own_ns += self._checks[raw.topic].put_back_ns
        if own_ns > LAST_NS:
            return None
        time_ns = self._shifted(raw, own_ns)
        if is_recorded:
            self._leads_ns[raw.topic] = time_ns - raw.log_time_ns
        return time_ns

    def _shifted(self, raw: RawMessage, time_ns: int) -> int:
        """Return a time on the reference's clock."""
        return min(max(0, time_ns + self._feed.offsets_ns[raw.topic]), LAST_NS)

    def new_notes(self) -> list[Noted]:
        """Return what is to be said of the times that were given since this was asked last."""
        notes, self._notes = self._notes, []
        return notes

    def _believes(self, raw: RawMessage, own_ns: int) -> bool:
        """Tell whether a header has a time that can be believed; note the first on each topic that cannot."""
        if own_ns <= 0:
            return False
        stamp = Stamp(own_ns, raw.log_time_ns)
        check = self._checks[raw.topic]
        before_ns = check.put_back_ns
        if own_ns <= LAST_NS and check.believes(stamp):
            if check.put_back_ns > before_ns:
                back_s = (check.put_back_ns - before_ns) / NS_PER_S
                self._note(raw, f"the clock of its headers was put back by {back_s:.0f} s: it is taken to have gone on")
            return True
        if raw.log_time_ns <= LAST_NS:
            self._doubt(raw, stamp)
        return False

    def _doubt(self, raw: RawMessage, stamp: Stamp) -> None:
        self._tally.bad_stamps += 1
        if raw.topic not in self._doubted:
            self._doubted.add(raw.topic)
            said = f"the header says {moment(stamp.own_ns)}, far from those around it"
            self._note(raw, f"{said}: such a message is taken at the time at which it was recorded")

    def _note(self, raw: RawMessage, said: str) -> None:
        where = f"{self._feed.source.path.name}: {raw.topic} at {raw.log_time_ns} ns"
        self._notes.append(Noted(self._feed.robot_of.get(raw.topic, ""), f"{where}: {said}"))

    def _guessed(self, raw: RawMessage) -> int | None:
        if raw.log_time_ns > LAST_NS:
            return None
        if raw.topic in self._leads_ns:
            return min(max(0, raw.log_time_ns + self._leads_ns[raw.topic]), LAST_NS)
        return self.newest_ns


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


def _skipped(feed: Feed, raw: RawMessage, error: BadMessage) -> Skipped:
    robot, cause = feed.robot_of[raw.topic], SkipCause(error.cause)
    return Skipped(robot, raw.topic, raw.log_time_ns, cause, error.detail, feed.source.path.name)
