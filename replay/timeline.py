"""Recorded messages in order of time: recordings in, ticks out. Memory is that of the recordings' windows."""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

from mapmerge.grid import Grid
from replay.arrivals import Arrival, KnownMap, in_order
from replay.errors import BadMessage, InputError
from replay.events import Noted, Skipped
from replay.feeds import Feed, Tally, Window
from replay.messages import FrameLink, TransformMessage
from replay.skip_cause import SkipCause
from replay.sources.base import Source

_MOST_HELD = 1000


@dataclass(frozen=True, slots=True, eq=False)
class Tick:
    """All maps of one time.

    Parameters
    ----------
    messages
        How many were read since the tick before.
    is_last
        Whether no other tick comes after it.
    """

    stamp_ns: int
    grids: Mapping[str, Grid]
    messages: int
    is_last: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Transforms:
    """Transforms of one recording that hold from this time on; ``stamp_ns`` is None if they hold always."""

    recording: Source
    stamp_ns: int | None
    links: tuple[FrameLink, ...]


def ticks(
    feeds: Sequence[Feed], tallies: Sequence[Tally], window: Window, *, strict: bool
) -> Iterator[Tick | Skipped | Noted | Transforms]:
    """Yield what the recordings say, in order of time; of one time, transforms before the tick.

    The last tick says that it is the last, so that one is held back until the next one is read. If too much else comes
    between, it is not: then a tick without maps ends the run.

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
    last: Tick | None = None
    held: list[Tick | Skipped | Noted | Transforms] = []
    for item in _items(feeds, tallies, window, strict=strict):
        if isinstance(item, Tick) or len(held) >= _MOST_HELD:
            yield from held
            held.clear()
        if isinstance(item, Tick):
            last = item
        held.append(item)
    if last is None:
        yield from held
    elif last in held:
        yield from (replace(item, is_last=True) if item is last else item for item in held)
    else:
        yield from held
        yield Tick(last.stamp_ns, {}, 0, is_last=True)


def _items(
    feeds: Sequence[Feed], tallies: Sequence[Tally], window: Window, *, strict: bool
) -> Iterator[Tick | Skipped | Noted | Transforms]:
    streams = [in_order(feed, tally, window) for feed, tally in zip(feeds, tallies, strict=True)]
    latest: dict[str, KnownMap] = {}
    messages = 0
    for time_ns, arrivals in groupby(heapq.merge(*streams, key=_stamp), key=_stamp):
        changed: dict[str, Grid] = {}
        for arrival in arrivals:
            for item in _taken(arrival, latest, changed):
                if strict and isinstance(item, Skipped):
                    raise InputError(
                        f"{item.input}: {item.where}: {item.detail}; without --strict it would be skipped and counted"
                    )
                yield item
            messages += arrival.robot != "" and not isinstance(arrival.content, Noted)
        if changed:
            yield Tick(time_ns, changed, messages)
            messages = 0


def _stamp(arrival: Arrival) -> int:
    return arrival.stamp_ns


def _taken(
    arrival: Arrival, latest: dict[str, KnownMap], changed: dict[str, Grid]
) -> Iterator[Skipped | Noted | Transforms]:
    """Apply a message to the latest maps; yield its transforms, or why it was not used."""
    content = arrival.content
    if isinstance(content, Skipped | Noted):
        yield content
    elif isinstance(content, TransformMessage):
        if content.bad:
            yield arrival.skipped(BadMessage(SkipCause.BAD_TRANSFORM, "; ".join(content.bad)))
        always = arrival.feed.clocks[arrival.raw.topic] == "none"
        yield Transforms(arrival.feed.source, None if always else arrival.stamp_ns, content.links)
    else:
        try:
            latest[arrival.robot] = arrival.applied(latest.get(arrival.robot))
        except BadMessage as error:
            yield arrival.skipped(error)
            return
        changed[arrival.robot] = latest[arrival.robot].grid
