"""What is read of the tables of a ROS 2 bag, whichever way they are read."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import NamedTuple, Protocol

from replay.sources.sqlite3.record import Value


class Row(NamedTuple):
    """Where a message is; sorts by time, then as written."""

    log_time_ns: int
    key: int
    topic_id: int


class NoBagError(Exception):
    """The file has not the tables of a ROS 2 bag, or they cannot be told."""


class BadRowError(Exception):
    """The row of a message cannot be read."""


Record = Mapping[str, Value]


class BagTables(Protocol):
    """What is read of the tables."""

    def topics(self) -> list[Record]:
        """Return the rows of ``topics``."""

    def definitions(self) -> list[Record]:
        """Return the rows of ``message_definitions``; none if there is no such table."""

    def counts(self) -> Mapping[Value, int]:
        """Return how many messages each topic has."""

    def indexed(self) -> int:
        """Return how many messages there should be."""

    def times_ns(self) -> tuple[int, int] | None:
        """Return the times of the first and last message."""

    def rows(self, topic_ids: Collection[int]) -> Iterator[Row]:
        """Yield where the messages of these topics are, in order."""

    def data(self, row: Row, most_bytes: int) -> bytes:
        """Return the data of a message.

        Raises
        ------
        BadRowError
            If it is not there.
        TooLargeError
            If it is larger than ``most_bytes``.
        """
