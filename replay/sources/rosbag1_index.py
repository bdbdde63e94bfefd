"""The index of a ROS 1 bag, as far as it fits itself."""

from __future__ import annotations

import errno
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from replay.sources.rosbag1_chunks import ChunkPlace
from replay.sources.rosbag1_records import CHUNK, CHUNK_INFO, CONNECTION, Record, record_of
from replay.sources.rosbag1_scan import BagFile, Entry, Topic, index_section

if TYPE_CHECKING:
    from rosbags.rosbag1 import Reader


class UnusableIndexError(Exception):
    """The index is damaged; ``is_cut`` if the file ends within it."""

    def __init__(self, text: str, *, is_cut: bool = False) -> None:
        super().__init__(text)
        self.is_cut = is_cut


class Index:
    """What the index of a bag says it holds.

    Attributes
    ----------
    chunk_counts
        How many messages each chunk has.
    """

    def __init__(self, reader: Reader, chunks: Mapping[int, ChunkPlace]) -> None:
        self.topics = {each.id: Topic(each.topic, each.msgtype, each.msgdef.data) for each in reader.connections}
        self.chunks = chunks
        self.chunk_counts = {each.pos: sum(each.connection_counts.values()) for each in reader.chunk_infos}
        # rosbags lets go of it when it is closed
        self._rows = dict(reader.indexes)

    def counts(self) -> Mapping[int, int]:
        """Return how many messages each connection has."""
        return {key: len(rows) for key, rows in self._rows.items()}

    def times_ns(self) -> tuple[int, int] | None:
        """Return the times of the first and last message; None if there is none."""
        # in order of time each
        ends = [(rows[0].time, rows[-1].time) for rows in self._rows.values() if rows]
        return (min(start for start, _ in ends), max(stop for _, stop in ends)) if ends else None

    def entries(self, connections: Collection[int]) -> list[Entry]:
        """Return where the messages of these connections are, sorted."""
        return sorted(
            Entry(each.time, each.chunk_pos, each.offset, key) for key in connections for each in self._rows[key]
        )


def read_index(path: Path, file: BagFile, header: Record, foreign: tuple[type[Exception], ...]) -> Index:
    """Return what the index says, read by rosbags.

    Raises
    ------
    UnusableIndexError
        If it cannot be read, or contradicts itself.
    """
    from rosbags.rosbag1 import Reader

    records = list(index_section(file.file, file.index_pos))
    _check_counts(file, header, records)
    connections_in = [each.number(b"count") for each in records if each.op == CHUNK_INFO]
    try:
        with Reader(path) as reader:
            _check_chunk_counts(reader, connections_in)
            return Index(reader, {start: _place(file, start) for start in reader.chunks})
    except foreign as error:
        # which is what a place beyond all files leads to
        if isinstance(error, OSError) and error.errno != errno.EINVAL:
            raise
        found = " ".join(str(error).split()) or "an index record has not the size that its count calls for"
        raise UnusableIndexError(f"the index of this bag is damaged ({found})") from error


def _check_counts(file: BagFile, header: Record, records: Sequence[Record]) -> None:
    """Find as many connections and chunks in the index as the bag's header says, because rosbags stops at that."""
    found = Counter(each.op == CONNECTION for each in records if each.end <= file.size)
    connections, chunks = header.number(b"conn_count"), header.number(b"chunk_count")
    if (found[True], found[False]) == (connections, chunks):
        return
    end = records[-1].end if records else file.index_pos
    is_short = found[True] <= connections and found[False] <= chunks
    # A record that was cut off has lost its end, or so much that it is none.
    is_cut = is_short and (end >= file.size or (record_of(file.file, end) is None and file.size - end < 1 << 16))
    raise UnusableIndexError(
        f"its index has {found[True]} of {connections} connections and {found[False]} of {chunks} chunks",
        is_cut=is_cut,
    )


def _check_chunk_counts(reader: Reader, connections_in: Collection[int]) -> None:
    """Compare what two parts of the index say of each chunk.

    Parameters
    ----------
    connections_in
        How many connections each chunk has; rosbags takes two that are called alike for one.
    """
    listed: dict[int, Counter[int]] = {info.pos: Counter() for info in reader.chunk_infos}
    for key, rows in reader.indexes.items():
        for row in rows:
            listed[row.chunk_pos][key] += 1
    for info, connections in zip(reader.chunk_infos, connections_in, strict=True):
        counts = {key: count for key, count in info.connection_counts.items() if count}
        if listed[info.pos] != counts or len(info.connection_counts) != connections:
            raise UnusableIndexError(f"its two lists of the messages in the chunk at byte {info.pos} differ")


def _place(file: BagFile, start: int) -> ChunkPlace:
    record = record_of(file.file, start)
    if record is None or record.op != CHUNK or record.end > file.size:
        raise UnusableIndexError(f"the index has a chunk at byte {start} that is not there")
    compression = record.fields[b"compression"].decode("utf-8", "replace")
    return ChunkPlace(start, record.data, record.end, compression, record.number(b"size"))
