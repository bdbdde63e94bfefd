"""Which transforms are read of each recording, and on which clock."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from replay.clocks import Probe
from replay.events import Clock
from replay.feeds import Feed
from replay.options import ClockChoice
from replay.sources.base import TF_TYPES, Source

TF_TOPIC = "/tf"
STATIC_TOPIC = "/tf_static"

_NO_ROBOT = ""


def transform_feeds(
    sources: Sequence[Source],
    probes: Sequence[Probe],
    offsets_ns: Mapping[tuple[int, str], int],
    choice: ClockChoice,
) -> tuple[Feed, ...]:
    """Return what is read of ``/tf`` and ``/tf_static``, each by itself, so that maps arrive as they do without.

    The transforms of a recording are on the clock of its first robot's maps. Those of ``/tf_static`` hold always.
    """
    return tuple(
        feed for index, source in enumerate(sources) for feed in feeds_of(index, source, probes, offsets_ns, choice)
    )


def feeds_of(
    index: int,
    source: Source,
    probes: Sequence[Probe],
    offsets_ns: Mapping[tuple[int, str], int],
    choice: ClockChoice,
) -> tuple[Feed, ...]:
    """Return the same of one recording, given which of the run's inputs it is."""
    there = {item.name for item in source.info.topics if item.msgtype in TF_TYPES and item.message_count}
    own = next((item for item in probes if item.input == index and item.clock != "none"), None)
    clock: Clock = own.clock if own else choice
    offset_ns = offsets_ns.get((index, own.topic), 0) if own else 0
    feeds = []
    if STATIC_TOPIC in there:
        feeds.append(Feed(source, {STATIC_TOPIC: _NO_ROBOT}, {STATIC_TOPIC: "none"}, {STATIC_TOPIC: 0}, 0))
    if TF_TOPIC in there:
        feeds.append(Feed(source, {TF_TOPIC: _NO_ROBOT}, {TF_TOPIC: clock}, {TF_TOPIC: offset_ns}, 0))
    return tuple(feeds)
