"""Where the messages of an MCAP file are: from its summary, or from one pass through the file.

The summary serves where it is complete: it says which chunks hold which channels, and the message indexes it points to
say where in them. Any of its parts may be missing, and messages may lie outside of chunks, where no index finds them;
then the file is streamed through once, one chunk in memory at a time.
"""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from replay.errors import InputError
from replay.sources.mcap_records import (
    CHANNEL,
    CHUNK,
    CHUNK_INDEX,
    FOOTER,
    MAGIC,
    MESSAGE,
    MESSAGE_INDEX,
    SCHEMA,
    STATISTICS,
    Channel,
    ChannelTable,
    MessageHeader,
    RecordFile,
    message_header,
    parser_stream,
)

if TYPE_CHECKING:
    from mcap.records import ChunkIndex, Statistics

NO_CHUNK = -1

_FOOTER = struct.Struct("<BQQQI")
_INDEX_HEAD = struct.Struct("<HI")
_INDEX_ROW = struct.Struct("<QQ")


class Entry(NamedTuple):
    """Where a message is; sorts by time, then as written.

    ``block`` is the byte of the file at which its chunk begins and ``inner`` its byte in the decompressed chunk; of a
    message outside of chunks, its own byte and `NO_CHUNK`.
    """

    log_time_ns: int
    block: int
    inner: int
    channel: int


@dataclass(frozen=True, slots=True)
class Contents:
    """What a file holds: channels by id, how many messages they have, times of the first and last message."""

    channels: Mapping[int, Channel]
    counts: Mapping[int, int]
    start_ns: int | None
    stop_ns: int | None


@dataclass(frozen=True, slots=True)
class Summary:
    """A complete summary section."""

    contents: Contents
    chunks: tuple[ChunkIndex, ...]


@dataclass(frozen=True, slots=True)
class Scan:
    """What one pass through a file found; the entries, sorted, are those of the channels asked for."""

    contents: Contents
    entries: tuple[Entry, ...]


def read_summary(file: RecordFile) -> Summary | None:
    """Return the summary of a file; None if it has none, or one that does not serve."""
    from mcap import records

    section = _summary_section(file)
    if section is None:
        return None
    table, chunks = ChannelTable(), []
    statistics: Statistics | None = None
    for record in file.inner_records(section, file.size - len(section)):
        content = section[record.content : record.end]
        table.add(record.opcode, content)
        if record.opcode == STATISTICS:
            statistics = records.Statistics.read(parser_stream(content))
        elif record.opcode == CHUNK_INDEX:
            chunks.append(records.ChunkIndex.read(parser_stream(content)))
    channels = table.all()
    if statistics is None or not _is_complete(statistics, channels, chunks):
        return None
    empty = statistics.message_count == 0
    contents = Contents(
        channels,
        statistics.channel_message_counts,
        None if empty else statistics.message_start_time,
        None if empty else statistics.message_end_time,
    )
    return Summary(contents, tuple(chunks))


def _summary_section(file: RecordFile) -> bytes | None:
    """Return the bytes between the data and the footer, if there are any and they are sound."""
    stop = file.size - _FOOTER.size - len(MAGIC)
    file.file.seek(max(stop, 0))
    footer, magic = file.file.read(_FOOTER.size), file.file.read(len(MAGIC))
    if magic != MAGIC:
        return None
    opcode, _, start, _, crc = _FOOTER.unpack(footer)
    if opcode != FOOTER or not len(MAGIC) < start < stop:
        return None
    file.file.seek(start)
    section = file.file.read(stop - start)
    return section if crc in {0, zlib.crc32(section + footer[:-4])} else None


def _is_complete(statistics: Statistics, channels: Mapping[int, Channel], chunks: Collection[ChunkIndex]) -> bool:
    counts = statistics.channel_message_counts
    return (
        statistics.chunk_count == len(chunks)
        and statistics.message_count == sum(counts.values())
        and counts.keys() <= channels.keys()
    )


def indexed_entries(file: RecordFile, summary: Summary, wanted: Collection[int]) -> tuple[Entry, ...] | None:
    """Return where the messages of these channels are, sorted, as the message indexes say.

    Returns
    -------
    tuple of Entry
        None if the indexes do not find just as many messages as the statistics count.
    """
    entries: list[Entry] = []
    for chunk in summary.chunks:
        for channel in wanted:
            offset = chunk.message_index_offsets.get(channel)
            if offset is not None:
                entries += _message_index(file, offset, channel, chunk.chunk_start_offset)
    found = Counter(entry.channel for entry in entries)
    if any(found[channel] != summary.contents.counts.get(channel, 0) for channel in wanted):
        return None
    return tuple(sorted(entries))


def _message_index(file: RecordFile, offset: int, channel: int, block: int) -> list[Entry]:
    """Return the entries of one message index; none if it is not there."""
    record = file.record_at(offset)
    if record is None or record.opcode != MESSAGE_INDEX:
        return []
    content = file.content(record)
    key, length = _INDEX_HEAD.unpack_from(content)
    rows = content[_INDEX_HEAD.size : _INDEX_HEAD.size + length]
    if key != channel or len(rows) != length or length % _INDEX_ROW.size:
        return []
    return [Entry(log_time, block, inner, channel) for log_time, inner in _INDEX_ROW.iter_unpack(rows)]


def scan(file: RecordFile, wanted: Callable[[Channel], bool]) -> Scan:
    """Pass through a file once, one chunk in memory at a time."""
    found = _Found(file, wanted)
    for record in file.records():
        if record.opcode == CHUNK:
            found.add_chunk(record.start)
        elif record.opcode == MESSAGE:
            found.add_message(file.message_header(record), record.start, NO_CHUNK)
        elif record.opcode in {SCHEMA, CHANNEL}:
            found.table.add(record.opcode, file.content(record))
    return found.scan()


class _Found:
    """What a pass through a file has found so far."""

    def __init__(self, file: RecordFile, wanted: Callable[[Channel], bool]) -> None:
        self.table = ChannelTable()
        self._file = file
        self._wanted = wanted
        self._is_wanted: dict[int, bool] = {}
        self._counts: Counter[int] = Counter()
        self._times_ns: tuple[int, int] | None = None
        self._entries: list[Entry] = []

    def add_chunk(self, start: int) -> None:
        chunk = self._file.chunk(start)
        for record in self._file.inner_records(chunk, start):
            if record.opcode == MESSAGE:
                self.add_message(message_header(chunk, record.content), start, record.start)
            else:
                self.table.add(record.opcode, chunk[record.content : record.end])

    def add_message(self, message: MessageHeader, block: int, inner: int) -> None:
        time_ns, key = message.log_time_ns, message.channel
        first_ns, last_ns = self._times_ns or (time_ns, time_ns)
        self._times_ns = min(first_ns, time_ns), max(last_ns, time_ns)
        self._counts[key] += 1
        if key not in self._is_wanted:
            self._is_wanted[key] = self._wanted(self._channel(key, block))
        if self._is_wanted[key]:
            self._entries.append(Entry(time_ns, block, inner, key))

    def scan(self) -> Scan:
        start_ns, stop_ns = self._times_ns or (None, None)
        contents = Contents(self.table.all(), self._counts, start_ns, stop_ns)
        return Scan(contents, tuple(sorted(self._entries)))

    def _channel(self, key: int, block: int) -> Channel:
        channel = self.table.get(key)
        if channel is None:
            raise InputError(
                f"{self._file.path}: the message or chunk at byte {block} is of channel {key}, which no record before "
                "it describes; the recording is damaged: copy it again from where it was made"
            )
        return channel
