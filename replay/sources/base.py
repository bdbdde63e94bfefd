"""What every source of recorded messages offers."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Literal, Protocol, Self

from replay.sources.losses import Losses

Encoding = Literal["cdr", "ros1", "json"]
"""The last is that of reports alone: no map is read from it."""

GRID_TYPE = "nav_msgs/msg/OccupancyGrid"
UPDATE_TYPE = "map_msgs/msg/OccupancyGridUpdate"
TF_TYPE = "tf2_msgs/msg/TFMessage"
TF_TYPES = (TF_TYPE, "tf/msg/tfMessage")
"""Types of transforms: that of ROS 2 and of ROS 1, and the one of ROS 1 before tf2."""
DECODED_TYPES = frozenset({GRID_TYPE, UPDATE_TYPE, *TF_TYPES})
"""Types of all messages that are ever decoded."""


@dataclass(frozen=True, slots=True)
class TopicInfo:
    """One topic of a recording; ``msgtype`` is in the form ``nav_msgs/msg/OccupancyGrid`` whatever the file says."""

    name: str
    msgtype: str
    message_count: int


@dataclass(frozen=True, slots=True)
class RawMessage:
    """One message as recorded, not yet decoded."""

    topic: str
    msgtype: str
    encoding: Encoding
    log_time_ns: int
    data: bytes | memoryview


@dataclass(frozen=True, slots=True)
class SourceInfo:
    """What a recording holds, as far as it is known without reading its messages.

    Parameters
    ----------
    format
        One of the names in `replay.sources.SOURCES`.
    start_ns, stop_ns
        Log times of the first and last message of all topics; None where the recording has no clock (saved maps)
        or no message.
    topics
        In order of name.
    """

    format: str
    start_ns: int | None
    stop_ns: int | None
    topics: tuple[TopicInfo, ...]


class Source(Protocol):
    """One recording, opened for reading. It is never changed.

    All errors of the libraries below leave as `replay.errors.InputError`. What is damaged is left out, and named in
    `losses`; only what cannot be read at all is an error.
    """

    path: Path
    losses: Losses

    @property
    def files(self) -> tuple[Path, ...]:
        """The files that are read; a folder stands for all that is in it."""

    @property
    def info(self) -> SourceInfo:
        """What the recording holds."""

    def messages(self, topics: Collection[str]) -> Iterator[RawMessage]:
        """Yield the messages of these topics in order of log time, ties in the order in which they were written.

        Only what holds these topics is read; memory is bounded by a few chunks, not by the recording.
        """

    def close(self) -> None:
        """Release files and temporary copies."""

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...
