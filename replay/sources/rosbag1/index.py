"""The index of a ROS 1 bag, as far as it fits itself."""

from __future__ import annotations

import errno
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from replay.sources.boundary import COMMON, OF_LIBRARIES
from replay.sources.rosbag1.chunks import ChunkPlace
from replay.sources.rosbag1.contents import BagFile, Entry, Topic
from replay.sources.rosbag1.records import CHUNK, CHUNK_INFO, CONNECTION, Record, index_rows, index_section, record_of

if TYPE_CHECKING:
    from replay.sources.rosbag1.lean import LeanReader


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

    def __init__(self, reader: LeanReader, chunks: Mapping[int, ChunkPlace], file: BinaryIO) -> None:
        self.topics = {each.id: Topic(each.topic, each.msgtype, each.msgdef.data) for each in reader.connections}
        self.chunks = chunks
        self.chunk_counts = {each.pos: sum(each.connection_counts.values()) for each in reader.chunk_infos}
        self._file = file
        self._places = reader.places
        self._counts = sum(reader.listed.values(), Counter[int]())
        self._times_ns = reader.times_ns

    def counts(self) -> Mapping[int, int]:
        """Return how many messages each connection has."""
        return self._counts

    def times_ns(self) -> tuple[int, int] | None:
        """Return the times of the first and last message; None if there is none."""
        return self._times_ns

    def entries(self, connections: Collection[int]) -> list[Entry]:
        """Return where the messages of these connections are, sorted."""
        return sorted(entry for key in connections for entry in self._entries_of(key))

    def _entries_of(self, connection: int) -> Iterator[Entry]:
        places = self._places.get(connection, ())
        for place, chunk in zip(places[::2], places[1::2], strict=True):
            record = record_of(self._file, place)
            if record is None:
                raise ValueError(f"the index record at byte {place} is not there any more")
            self._file.seek(record.data)
            rows = self._file.read(record.end - record.data)
            yield from (Entry(time_ns, chunk, inner, connection) for time_ns, inner in index_rows(rows))


def read_index(path: Path, file: BagFile, header: Record) -> Index:
    """Return what the index says, read by rosbags.

    Raises
    ------
    UnusableIndexError
        If it cannot be read, or contradicts itself.
    """
    from rosbags.rosbag1 import ReaderError

    records = list(index_section(file.file, file.index_pos))
    _check_counts(file, header, records)
    connections_in = [each.number(b"count") for each in records if each.op == CHUNK_INFO]
    foreign: tuple[type[Exception], ...] = (*COMMON, ReaderError)
    try:
        with _opened(path) as reader:
            _check_chunk_counts(reader, connections_in)
            return Index(reader, {start: _place(file, start) for start in reader.chunks}, file.file)
    except foreign as error:
        # which is what a place beyond all files leads to
        if isinstance(error, OSError) and error.errno != errno.EINVAL:
            raise
        found = " ".join(str(error).split()) or "an index record has not the size that its count calls for"
        raise UnusableIndexError(f"the index of this bag is damaged ({found})") from error


@contextmanager
def _opened(path: Path) -> Iterator[LeanReader]:
    from rosbags.rosbag1 import ReaderError

    from replay.sources.rosbag1.lean import LeanReader

    reader = LeanReader(path)
    try:
        reader.open()
    except OF_LIBRARIES as error:
        raise ReaderError(" ".join(str(error).split())) from error
    with closing(reader):
        yield reader


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


def _check_chunk_counts(reader: LeanReader, connections_in: Collection[int]) -> None:
    """Compare what two parts of the index say of each chunk.

    Parameters
    ----------
    connections_in
        How many connections each chunk has; rosbags takes two that are called alike for one.
    """
    for info, connections in zip(reader.chunk_infos, connections_in, strict=True):
        counts = {key: count for key, count in info.connection_counts.items() if count}
        if reader.listed.get(info.pos, {}) != counts or len(info.connection_counts) != connections:
            raise UnusableIndexError(f"its two lists of the messages in the chunk at byte {info.pos} differ")


def _place(file: BagFile, start: int) -> ChunkPlace:
    record = record_of(file.file, start)
    if record is None or record.op != CHUNK or record.end > file.size:
        raise UnusableIndexError(f"the index has a chunk at byte {start} that is not there")
    compression = record.fields[b"compression"].decode("utf-8", "replace")
    return ChunkPlace(start, record.data, record.end, compression, record.number(b"size"))
