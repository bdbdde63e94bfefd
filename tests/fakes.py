"""Recordings that are only in memory."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from pathlib import Path

from replay.sources.base import GRID_TYPE, RawMessage, SourceInfo, TopicInfo
from replay.sources.boundary import Closing
from replay.sources.losses import Losses
from tests.bags import Recorded, as_cdr


class FakeSource(Closing):
    """A recording of these messages, in the order given, which should be that of their log times."""

    def __init__(self, messages: Sequence[Recorded], *, has_clock: bool = True) -> None:
        self.path = Path("fake")
        self.losses = Losses()
        self._messages = messages
        self._has_clock = has_clock

    @property
    def info(self) -> SourceInfo:
        times = [each.log_time_ns for each in self._messages] if self._has_clock else []
        types = {each.topic: each.msgtype for each in self._messages}
        counts = [each.topic for each in self._messages]
        rows = tuple(TopicInfo(topic, types[topic], counts.count(topic)) for topic in sorted(types))
        return SourceInfo("fake", min(times, default=None), max(times, default=None), rows)

    def messages(self, topics: Collection[str]) -> Iterator[RawMessage]:
        for each in self._messages:
            if each.topic in topics:
                yield RawMessage(each.topic, each.msgtype, "cdr", each.log_time_ns, as_cdr(each))

    def close(self) -> None:
        """Nothing is held open."""


def info_of(*topics: str, messages: int = 3, msgtype: str = GRID_TYPE) -> SourceInfo:
    """Return what a recording with these topics says of itself."""
    return SourceInfo("fake", 0, 1, tuple(TopicInfo(topic, msgtype, messages) for topic in sorted(topics)))
