"""Where the messages of an MCAP file are, as its message indexes say."""

from __future__ import annotations

import struct
from collections.abc import Set as AbstractSet
from typing import TYPE_CHECKING, NamedTuple

from replay.sources.mcap.record_file import RecordFile
from replay.sources.mcap.records import MESSAGE_HEAD, RECORD
from replay.sources.mcap.summary import Summary

if TYPE_CHECKING:
    from mcap.records import ChunkIndex

NO_CHUNK = -1

_CHUNK_TIMES = struct.Struct("<QQ")
_LEAST_MESSAGE_BYTES = RECORD.size + MESSAGE_HEAD.size


class Entry(NamedTuple):
    """Where a message is; sorts by time, then as written.

    ``block`` is the byte of the file at which its chunk begins and ``inner`` its byte in the decompressed chunk; of a
    message outside of chunks, its own byte and `NO_CHUNK`.
    """

    log_time_ns: int
    block: int
    inner: int
    channel: int


def indexed_entries(file: RecordFile, summary: Summary, wanted: AbstractSet[int]) -> tuple[Entry, ...] | None:
    """Return where the messages of these channels are, sorted, as the message indexes say.

    No checksum covers these. What the summary, and chunks themselves, say in their place is held against them.

    Returns
    -------
    tuple of Entry
        None if the indexes do not find just as many messages as the statistics count, or one of them twice, or at
        times or places that their chunk does not have.
    """
    counts = summary.statistics.channel_message_counts if summary.statistics else {}
    left = {channel: counts.get(channel, 0) for channel in wanted}
    entries: list[Entry] = []
    for chunk in summary.chunks:
        asked = wanted & chunk.message_index_offsets.keys()
        if asked and not (summary.is_checked or _has_these_times(file, chunk)):
            return None
        for channel in sorted(asked):
            most = min(left[channel], _most_messages(file, chunk))
            found = _message_index(file, chunk, channel, most)
            if found is None:
                return None
            left[channel] -= len(found)
            entries += found
    if any(left.values()) or len({(entry.block, entry.inner) for entry in entries}) < len(entries):
        return None
    return tuple(sorted(entries))


def _has_these_times(file: RecordFile, chunk: ChunkIndex) -> bool:
    """Tell whether a chunk says of its times what the summary does."""
    found = file.head_at(chunk.chunk_start_offset, _CHUNK_TIMES.size)
    said = chunk.message_start_time, chunk.message_end_time
    return found is not None and len(found[1]) == _CHUNK_TIMES.size and _CHUNK_TIMES.unpack(found[1]) == said


def _most_messages(file: RecordFile, chunk: ChunkIndex) -> int:
    """Return how many messages a chunk has room for."""
    return int(min(chunk.uncompressed_size, file.most_bytes) // _LEAST_MESSAGE_BYTES)


def _message_index(file: RecordFile, chunk: ChunkIndex, channel: int, most: int) -> list[Entry] | None:
    """Return the entries of one message index; None if it is not there, or not of this chunk."""
    found = file.message_index(chunk.message_index_offsets[channel], most)
    if found is None or found.channel != channel:
        return None
    first_ns, last_ns = chunk.message_start_time, chunk.message_end_time
    last_place = chunk.uncompressed_size - _LEAST_MESSAGE_BYTES
    entries = []
    for log_time_ns, inner in found.rows():
        if not first_ns <= log_time_ns <= last_ns or inner > last_place:
            return None
        entries.append(Entry(log_time_ns, chunk.chunk_start_offset, inner, channel))
    return entries
