"""The index of a ROS 1 bag without a row for each message, which in a long recording would take gigabytes."""

from __future__ import annotations

from array import array
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

from rosbags.rosbag1 import Reader, ReaderError

from replay.sources.rosbag1.records import INDEX, index_rows, record_of

if TYPE_CHECKING:
    from rosbags.rosbag1.reader import IndexData


class LeanReader(Reader):
    """Reads the index and keeps, instead of its rows, where in the file they are.

    Attributes
    ----------
    places
        Of each connection, in turn, where an index record of it is in the file and where its chunk is.
    listed
        How many messages of each connection the index lists in each chunk.
    times_ns
        The times of the first and last message; None if there is none.
    """

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self.places: dict[int, array[int]] = {}
        self.listed: dict[int, Counter[int]] = {}
        self.times_ns: tuple[int, int] | None = None

    def read_index_data(self, pos: int, indexes: dict[int, list[IndexData]]) -> None:
        """Read an index record of the chunk at ``pos``; called by `open` for each."""
        del indexes
        if self.bio is None:
            raise ReaderError("the bag is read before it was opened")
        place = self.bio.tell()
        record = record_of(self.bio, place)
        if record is None or record.op != INDEX or record.number(b"ver") != 1:
            raise ReaderError(f"there is no index record at byte {place}")
        self.bio.seek(record.data)
        times = [time_ns for time_ns, _ in index_rows(self.bio.read(record.end - record.data))]
        key = record.number(b"conn")
        if times and any(each.id == key for each in self.connections):
            self.places.setdefault(key, array("Q")).extend((place, pos))
            self.listed.setdefault(pos, Counter())[key] += len(times)
            first_ns, last_ns = self.times_ns or (times[0], times[0])
            self.times_ns = min(first_ns, *times), max(last_ns, *times)
