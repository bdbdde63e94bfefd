"""Topics and their types, named alike whatever the format."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from replay.sources.base import Encoding, TopicInfo

ENCODINGS: dict[str, Encoding] = {"cdr": "cdr", "ros1": "ros1"}


def normalised_type(name: str) -> str:
    """Return ``nav_msgs/msg/OccupancyGrid`` for ``nav_msgs/OccupancyGrid``; other names are left as they are."""
    package, slash, rest = name.partition("/")
    return f"{package}/msg/{rest}" if slash and rest and "/" not in rest else name


def type_in(encoding: str, name: str) -> str:
    """Return the type to list for a topic in this encoding.

    A type whose messages cannot be decoded is listed with its encoding, so that it is seen and yet never taken for a
    map: ``nav_msgs/msg/OccupancyGrid (json)``.
    """
    known = normalised_type(name) or "unknown"
    return known if encoding in ENCODINGS else f"{known} ({encoding or 'no encoding'})"


def topic_table(rows: Iterable[tuple[str, str, int]]) -> tuple[TopicInfo, ...]:
    """Return the topics in order of name, from rows of name, type and message count; equal topics are added up."""
    counts: Counter[tuple[str, str]] = Counter()
    for name, msgtype, count in rows:
        counts[name, msgtype] += count
    return tuple(TopicInfo(name, msgtype, count) for (name, msgtype), count in sorted(counts.items()))
