"""Whether a message's stamp can be believed: one that is far from those around it is an error of its sender.

A robot's clock may be off by anything, drift, run at another rate (in a simulation), and jump once and stay there (as
when it first hears of the right time). What it does not do is to be hours ahead for one message.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from replay.options import NS_PER_S

_OFF_NS = 60 * NS_PER_S
_MOST_OFF_NS = 3_600 * NS_PER_S
_FASTEST = 10
_FOLLOWED = 3


LAST_NS = (NS_PER_S << 31) - 1
"""The last time that a ROS 2 stamp can hold, in the year 2038: its seconds have 32 bits, one of them for the sign."""

PROBED = 3
"""So many messages tell how far the stamps of a topic are ahead when it begins."""


@dataclass(frozen=True, slots=True)
class Stamp:
    """A message's own time, and when it was recorded."""

    own_ns: int
    log_ns: int

    @property
    def lead_ns(self) -> int:
        """How far its own time is ahead."""
        return self.own_ns - self.log_ns

    def may_follow(self, before: Stamp) -> bool:
        """Tell whether one clock may have given these two times.

        It may have stood still, or have run up to ten times as fast as the recorder's: so do simulations.
        """
        recorded_ns = max(0, self.log_ns - before.log_ns)
        ahead_ns = min(_OFF_NS + (_FASTEST - 1) * recorded_ns, _MOST_OFF_NS)
        return -_OFF_NS <= self.own_ns - before.own_ns <= recorded_ns + ahead_ns


class StampCheck:
    """Follows the stamps of one topic.

    A stamp that cannot follow the last one that was believed is not believed, until `_FOLLOWED` in a row follow each
    other: then the clock jumped. Nothing is read ahead.

    A clock that was put back is taken to have gone on: what was recorded last is newest, whatever it says.

    Parameters
    ----------
    lead_ns
        How far the topic's stamps are ahead of the recorder's clock when it begins; None if the first is believed.

    Attributes
    ----------
    put_back_ns
        How far the clock was put back so far: what is to be added to stamps that are believed.
    """

    def __init__(self, lead_ns: int | None = None) -> None:
        self.put_back_ns = 0
        self._first_lead_ns = lead_ns
        self._believed: Stamp | None = None
        self._doubted: Stamp | None = None
        self._in_a_row = 0

    def believes(self, stamp: Stamp) -> bool:
        """Take in a message's stamp; tell whether it can be believed."""
        before = self._before(stamp)
        if before is None or stamp.may_follow(before):
            self._doubted, self._in_a_row = None, 0
        else:
            follows = self._doubted is not None and stamp.may_follow(self._doubted)
            self._doubted, self._in_a_row = stamp, self._in_a_row + 1 if follows else 1
            if self._in_a_row < _FOLLOWED:
                return False
            gone_on_ns = before.own_ns + max(0, stamp.log_ns - before.log_ns)
            self.put_back_ns += gone_on_ns - stamp.own_ns if stamp.own_ns < before.own_ns else 0
        self._believed = stamp
        return True

    def _before(self, stamp: Stamp) -> Stamp | None:
        if self._believed is None and self._first_lead_ns is not None:
            return Stamp(stamp.log_ns + self._first_lead_ns, stamp.log_ns)
        return self._believed


def is_plain(stamp: Stamp) -> bool:
    """Tell whether a stamp is believed without another look: the two clocks agree."""
    return abs(stamp.lead_ns) <= _OFF_NS


def lead_at_start_ns(stamps: Sequence[Stamp]) -> int:
    """Return how far the stamps of a topic are ahead, given its first ones: where two follow each other, as these say.

    Else as the one says that is least ahead or behind.
    """
    for number, stamp in enumerate(stamps):
        if any(later.may_follow(stamp) for later in stamps[number + 1 :]):
            return stamp.lead_ns
    return min((stamp.lead_ns for stamp in stamps), key=abs)
