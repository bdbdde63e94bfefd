"""Recorded messages in order of time: recordings in, ticks out. Memory is that of the recordings' windows."""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby

from mapmerge.grid import Grid
from replay.arrivals import Arrival, Feed, Tally, Window, in_order
from replay.assemble import assemble
from replay.errors import BadMessage, InputError
from replay.events import Skipped


@dataclass(frozen=True, slots=True, eq=False)
class Tick:
    """All maps of one time; ``messages`` were read since the tick before."""

    stamp_ns: int
    grids: Mapping[str, Grid]
    messages: int


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
    streams = [in_order(feed, tally, window) for feed, tally in zip(feeds, tallies, strict=True)]
    latest: dict[str, Grid] = {}
    messages = 0
    for time_ns, arrivals in groupby(heapq.merge(*streams, key=_stamp), key=_stamp):
        changed: dict[str, Grid] = {}
        for skipped in _take(arrivals, latest, changed):
            if skipped is not None:
                if strict:
                    raise InputError(
                        f"{skipped.input}: {skipped.topic} at {skipped.log_time_ns} ns: {skipped.detail}; "
                        "without --strict it would be skipped and counted"
                    )
                yield skipped
            messages += 1
        if changed:
            yield Tick(time_ns, changed, messages)
            messages = 0


def _stamp(arrival: Arrival) -> int:
    return arrival.stamp_ns


def _take(arrivals: Iterable[Arrival], latest: dict[str, Grid], changed: dict[str, Grid]) -> Iterator[Skipped | None]:
    """Apply messages of one time to the latest maps; yield for each None or why it was not used."""
    for arrival in arrivals:
        if isinstance(arrival.content, Skipped):
            yield arrival.content
            continue
        try:
            latest[arrival.robot] = assemble(latest.get(arrival.robot), arrival.content)
        except BadMessage as error:
            yield arrival.skipped(error)
            continue
        changed[arrival.robot] = latest[arrival.robot]
        yield None
