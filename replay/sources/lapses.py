"""When what is lost of a recording was recorded, as far as what is left of it tells.

An update belongs to the full map before it. If a full map may be lost between the two, it belongs to that one.
"""

from __future__ import annotations

from bisect import bisect_left, insort
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import accumulate

EARLIEST = -(1 << 65)
LATEST = 1 << 65

Place = tuple[int, int]
"""Where a message is in a recording, such as its chunk and its byte in that; sorts as written."""


@dataclass(frozen=True, slots=True)
class Lapse:
    """Log times between which something is lost; without them, it may have been recorded at any time."""

    first_ns: int = EARLIEST
    last_ns: int = LATEST

    def parts(self, map_ns: int, update_ns: int) -> bool:
        """Tell whether a full map may be lost between a full map and an update, of these log times."""
        return map_ns <= self.last_ns and self.first_ns <= update_ns

    def within(self, other: Lapse) -> Lapse:
        """Return the lapse of something that was recorded in both."""
        return Lapse(max(self.first_ns, other.first_ns), min(self.last_ns, other.last_ns))


AT_END = Lapse(LATEST, LATEST)
"""What is lost comes behind all that is left."""


def lapse_of(times_ns: Iterable[int]) -> Lapse:
    """Return the lapse of messages of which it is known when they were recorded; there may be none."""
    known = list(times_ns)
    return Lapse(min(known), max(known)) if known else AT_END


class Written:
    """What is left of a recording, as it was written.

    What is lost was recorded when its place says: behind what was written before it. How far messages that are left
    were written out of order, what is lost may have been as well.

    Parameters
    ----------
    found
        Where messages are, and their log times.
    """

    def __init__(self, found: Iterable[tuple[Place, int]]) -> None:
        rows = sorted(found)
        times_ns = [time_ns for _, time_ns in rows]
        self._places = [place for place, _ in rows]
        self._newest_ns = list(accumulate(times_ns, max))
        self._oldest_ns = list(accumulate(reversed(times_ns), min))[::-1]
        behind_ns = (newest - own for newest, own in zip(self._newest_ns, times_ns, strict=True))
        self._disorder_ns = max(behind_ns, default=0)

    def between(self, start: Place, stop: Place) -> Lapse:
        """Return the lapse of what is lost from one place until before another."""
        before, behind = bisect_left(self._places, start), bisect_left(self._places, stop)
        if behind == len(self._places):
            return AT_END if before == behind else Lapse(first_ns=self._first_ns(before))
        oldest_ns = self._oldest_ns[behind]
        if not before:
            return Lapse(last_ns=oldest_ns + self._disorder_ns - 1)
        newest_ns = self._newest_ns[before - 1]
        # of equal times, what is before and what is behind are parted
        first_ns = min(self._first_ns(before), oldest_ns)
        return Lapse(first_ns, max(oldest_ns + self._disorder_ns - 1, newest_ns))

    def _first_ns(self, before: int) -> int:
        return self._newest_ns[before - 1] - self._disorder_ns + 1 if before else EARLIEST


class Lapses:
    """The lapses of one topic. Of those within another, only that one is kept."""

    def __init__(self) -> None:
        # sorted by both their ends
        self._kept: list[tuple[int, int]] = []

    def add(self, lapse: Lapse) -> None:
        """Take in a lapse."""
        if self.part(lapse.last_ns, lapse.first_ns):
            return
        at = bisect_left(self._kept, (lapse.last_ns, LATEST + 1))
        start = at
        while start and self._kept[start - 1][1] >= lapse.first_ns:
            start -= 1
        del self._kept[start:at]
        insort(self._kept, (lapse.last_ns, lapse.first_ns))

    def part(self, map_ns: int, update_ns: int) -> bool:
        """Tell whether a full map may be lost between a full map and an update, of these log times."""
        at = bisect_left(self._kept, (map_ns, EARLIEST))
        return at < len(self._kept) and self._kept[at][1] <= update_ns
