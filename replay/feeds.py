"""What is read from one recording, of which times, and how much of it was read."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field

from mapmerge.grid import Grid
from replay.assemble import assemble
from replay.errors import BadMessage
from replay.events import Clock, Noted, Skipped
from replay.footprint import MemoryLimit
from replay.messages import GridMessage, TransformMessage, UpdateMessage
from replay.skip_cause import SkipCause
from replay.sources.base import RawMessage, Source

Content = GridMessage | UpdateMessage | TransformMessage | Skipped | Noted
"""A message, why it cannot be used, or what is to be said of it."""


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

    def skipped(self, raw: RawMessage, error: BadMessage) -> Skipped:
        """Return why a message of it, or a part of one, is not used."""
        robot, cause = self.robot_of[raw.topic], SkipCause(error.cause)
        return Skipped(robot, raw.topic, raw.log_time_ns, cause, error.detail, self.source.path.name)


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
