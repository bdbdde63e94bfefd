"""What the summary of an MCAP file says: which channels there are, how many messages, and which chunks hold which.

The summary serves where it is complete. Any of its parts may be missing, and messages may lie outside of chunks, where
no index finds them; then `replay.sources.mcap.scan` passes through the file instead.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from replay.sources.mcap.channels import NO_SCHEMA, Channel, ChannelTable, check_description
from replay.sources.mcap.chunk import inner_records
from replay.sources.mcap.record_file import RecordFile, file_crc
from replay.sources.mcap.records import (
    CHANNEL,
    CHUNK_INDEX,
    DATA_END,
    FOOTER,
    MAGIC,
    RECORD,
    SCHEMA,
    STATISTICS,
    BadPart,
    foreign_errors,
    parser_stream,
)

if TYPE_CHECKING:
    from mcap.records import ChunkIndex, Statistics

_FOOTER = struct.Struct("<BQQQI")
_DATA_END_BYTES = RECORD.size + 4


@dataclass(frozen=True, slots=True)
class Contents:
    """What a file holds: channels by id, how many messages they have, times of the first and last message."""

    channels: Mapping[int, Channel]
    counts: Mapping[int, int]
    start_ns: int | None
    stop_ns: int | None


@dataclass(frozen=True, slots=True)
class Summary:
    """What the summary section says.

    Parameters
    ----------
    is_checked
        Whether a checksum says that it is as it was written.
    data_end
        The byte at which the data section ends; None if that is not where it should be.
    """

    table: ChannelTable
    statistics: Statistics | None
    chunks: tuple[ChunkIndex, ...]
    is_checked: bool
    data_end: int | None

    @property
    def contents(self) -> Contents | None:
        """What the file holds; None if the summary is not complete, or contradicts itself."""
        known, channels = self.statistics, self.table.all()
        if known is None or not _is_complete(known, channels, self.chunks):
            return None
        empty = known.message_count == 0
        return Contents(
            channels,
            known.channel_message_counts,
            None if empty else known.message_start_time,
            None if empty else known.message_end_time,
        )

    @property
    def places(self) -> list[int]:
        """Where records begin that can be found without those before them: chunks, and the end of the data."""
        if not (self.is_checked and self.chunks):
            return []
        ends = [] if self.data_end is None else [self.data_end]
        return sorted({chunk.chunk_start_offset for chunk in self.chunks} | set(ends))


def read_summary(file: RecordFile, *, keeps_records: bool = False) -> Summary | None:
    """Return the summary of a file; None if it has none, or one that is not sound.

    Parameters
    ----------
    keeps_records
        Whether its table keeps the records of schemas and channels.
    """
    try:
        return _summary(file, ChannelTable(keeps_records=keeps_records))
    except _unsound():
        # what it should say is found by a pass through the file
        return None


def _summary(file: RecordFile, table: ChannelTable) -> Summary | None:
    from mcap import records

    found = _summary_section(file)
    if found is None:
        return None
    section, is_checked = found
    chunks = []
    statistics: Statistics | None = None
    for record in inner_records(section):
        if record.opcode in {SCHEMA, CHANNEL}:
            check_description(record)
        content = section[record.content : record.end]
        table.add(record.opcode, content)
        if record.opcode == STATISTICS:
            statistics = records.Statistics.read(parser_stream(content))
        elif record.opcode == CHUNK_INDEX:
            chunks.append(records.ChunkIndex.read(parser_stream(content)))
    before = file.record_at(file.size - len(MAGIC) - _FOOTER.size - len(section) - _DATA_END_BYTES)
    data_end = before.start if before and before.opcode == DATA_END else None
    return Summary(table, statistics, tuple(chunks), is_checked, data_end)


def statistics_between(file: RecordFile, data_end: int, footer: int) -> Statistics | None:
    """Return what the records between the data and the footer count, wherever the footer says that they begin.

    None if they count nothing, or a checksum says that they are not what was written.
    """
    from mcap import records

    file.file.seek(footer)
    record = file.file.read(_FOOTER.size)
    if not data_end < footer or footer - data_end > file.most_bytes or len(record) < _FOOTER.size:
        return None
    crc = _FOOTER.unpack(record)[-1]
    if crc not in {0, zlib.crc32(record[:-4], file_crc(file, data_end, footer))}:
        return None
    file.file.seek(data_end)
    section = file.file.read(footer - data_end)
    try:
        for inner in inner_records(section):
            if inner.opcode == STATISTICS:
                found: Statistics = records.Statistics.read(parser_stream(section[inner.content : inner.end]))
                return found
    except _unsound():
        return None
    return None


def _unsound() -> tuple[type[Exception], ...]:
    """Return what is raised where a summary is not as it should be; the machine's own troubles are not."""
    return (BadPart, *(each for each in foreign_errors() if not issubclass(each, (OSError, MemoryError))))


def _summary_section(file: RecordFile) -> tuple[bytes, bool] | None:
    """Return the bytes between the data and the footer, and whether a checksum says that they are right.

    None if there are none, or it says that they are wrong.
    """
    stop = file.size - _FOOTER.size - len(MAGIC)
    if stop <= len(MAGIC):
        return None
    file.file.seek(stop)
    footer, magic = file.file.read(_FOOTER.size), file.file.read(len(MAGIC))
    opcode, length, start, _, crc = _FOOTER.unpack(footer)
    if magic != MAGIC or opcode != FOOTER or length != _FOOTER.size - RECORD.size or not len(MAGIC) < start < stop:
        return None
    # The checksum comes first, so that a wrong start does not take the whole file into memory.
    if crc not in {0, zlib.crc32(footer[:-4], file_crc(file, start, stop))} or stop - start > file.most_bytes:
        return None
    file.file.seek(start)
    return file.file.read(stop - start), crc != 0


def _is_complete(statistics: Statistics, channels: Mapping[int, Channel], chunks: Collection[ChunkIndex]) -> bool:
    counts = statistics.channel_message_counts
    return (
        statistics.chunk_count == len(chunks)
        and statistics.message_count == sum(counts.values())
        and counts.keys() <= channels.keys()
        and all(channel.problem != NO_SCHEMA for channel in channels.values())
    )
