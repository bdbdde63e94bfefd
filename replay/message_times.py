"""When the messages of a recording were, by what they say themselves and by when they were recorded."""

from __future__ import annotations

from collections import Counter

from replay.clocks import stamp_ns
from replay.events import Noted, Skipped
from replay.feeds import Content, Feed, Tally
from replay.messages import TransformMessage
from replay.options import NS_PER_S
from replay.sources.base import RawMessage
from replay.stamps import LAST_NS, Stamp, StampCheck
from replay.words import moment

MOST_PUT_BACK = 20
"""So often it is said of a topic that its clock was put back."""


class MessageTimes:
    """Gives the messages of a recording their times.

    Where a message does not say, because it cannot be decoded or its header has no time, or one that cannot be believed
    (see `replay.stamps`), it is its log time, shifted as that of the message before it on its topic was; without one,
    the newest time so far. Where no stamp can hold its log time either, nothing tells when it was.

    Attributes
    ----------
    newest_ns
        The newest time so far.
    """

    def __init__(self, feed: Feed, tally: Tally) -> None:
        self._feed = feed
        self._tally = tally
        self._leads_ns = {topic: lead_ns + feed.offsets_ns[topic] for topic, lead_ns in feed.leads_ns.items()}
        self._checks = {topic: StampCheck(feed.leads_ns.get(topic)) for topic in feed.clocks}
        self._doubted: set[str] = set()
        self._put_back: Counter[str] = Counter()
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
                self._say_put_back(raw, check.put_back_ns - before_ns)
            return True
        if raw.log_time_ns <= LAST_NS:
            self._doubt(raw, stamp)
        return False

    def _say_put_back(self, raw: RawMessage, back_ns: int) -> None:
        """Note that a clock was put back, at most a few times: every report has all notes."""
        self._put_back[raw.topic] += 1
        if self._put_back[raw.topic] > MOST_PUT_BACK:
            return
        said = f"the clock of its headers was put back by {back_ns / NS_PER_S:.0f} s: it is taken to have gone on"
        if self._put_back[raw.topic] == MOST_PUT_BACK:
            said += "; if it is put back once more, that is not said again"
        self._note(raw, said)

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
