"""What is known of a ROS 1 bag, whichever way it is found: its connections, its chunks, and where messages are."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import BinaryIO, NamedTuple, Protocol

from replay.sources.rosbag1.chunks import ChunkPlace


class Entry(NamedTuple):
    """Where a message is; sorts by time, then as written."""

    log_time_ns: int
    chunk: int
    inner: int
    connection: int


@dataclass(frozen=True, slots=True)
class BagFile:
    """An open bag, where its first record is, and where its index should be; 0 if that is not known."""

    file: BinaryIO
    size: int
    start: int
    index_pos: int


@dataclass(frozen=True, slots=True)
class Topic:
    """What a connection says of its messages; ``definition`` is the text of their type."""

    name: str
    msgtype: str
    definition: str


class Contents(Protocol):
    """What is known of a bag, by its index or by a pass through it."""

    @property
    def topics(self) -> Mapping[int, Topic]:
        """Connections by id."""

    @property
    def chunks(self) -> Mapping[int, ChunkPlace]:
        """Chunks by their byte in the file."""

    def counts(self) -> Mapping[int, int]:
        """Return how many messages each connection has."""

    def times_ns(self) -> tuple[int, int] | None:
        """Return the times of the first and last message; None if there is none."""

    def entries(self, connections: Collection[int]) -> list[Entry]:
        """Return where the messages of these connections are, sorted."""


def normalised_topic(name: str) -> str:
    """Return a topic's name without the slashes that say nothing."""
    return f"{'/' * name.startswith('/')}{'/'.join(part for part in name.split('/') if part)}"
