"""Where the records of an MCAP file go on after what is damaged.

A record whose header is damaged hides where the next one begins. Then the next place is looked for from which records
follow each other as they should: types that there are, lengths that fit the file, fields that fit the record, and times
of messages near each other. Where a sound summary says at which bytes chunks begin, these are tried first. In a
recording with chunks a message is never taken for such a place, because it may be one within a chunk, whose checksum
says nothing of one message.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterator, Sequence

from replay.sources.mcap.chunk import is_consistent
from replay.sources.mcap.records import (
    CHANNEL,
    CHUNK,
    DATA_END,
    FOOTER,
    MESSAGE,
    MESSAGE_INDEX,
    RECORD,
    SCHEMA,
    Record,
    message_header,
)
from replay.sources.mcap.shapes import KNOWN, Shapes

NEAR_NS = 86_400 * 10**9
"""Messages that follow each other are taken to be no further apart, if what is around them is damaged."""

_BLOCK_BYTES = 1 << 20
_MOST_IN_CHAIN = 64
_LEAST_WEIGHT = 4
# Where records may begin again: those that nothing depends on are left out, because they say little of themselves.
# They are at most 4 GiB long, so that half of the length is zeros.
_ANY_RECORD = re.compile(rb"[\x02-\x07\x0f](?=[\s\S]{4}\0{4})")
_NO_MESSAGE = re.compile(rb"[\x02\x06\x07\x0f](?=[\s\S]{4}\0{4})")


class Resumption:
    """Finds where records begin again.

    Parameters
    ----------
    chunk_starts
        Where chunks begin, and where the data section ends, as a sound summary says; ascending.

    Attributes
    ----------
    has_chunks
        Whether the recording has chunks, as far as it is known.
    time_ns
        Time of the last sound message outside of chunks; None as long as there is none.
    """

    def __init__(self, shapes: Shapes, chunk_starts: Sequence[int]) -> None:
        self.has_chunks = bool(chunk_starts)
        self.time_ns: int | None = None
        self._shapes = shapes
        self._file = shapes.file
        self._chunk_starts = chunk_starts
        self._resumed: tuple[int, int | None] = (-1, None)

    def next_after(self, start: int) -> int | None:
        """Return the next place after this one at which records follow each other; None if there is none."""
        if self._resumed[0] != start:
            self._resumed = start, self._sought(start)
        return self._resumed[1]

    def _sought(self, start: int) -> int | None:
        found = self._shapes.head(start)
        if found and found[0].opcode == CHUNK:
            if is_consistent(*found):
                # the file was cut off here
                return None
            self.has_chunks |= self.time_ns is None
        known = bisect_right(self._chunk_starts, start)
        for place in self._chunk_starts[known:]:
            if self._is_chain(place):
                return place
        return next((place for place in self._candidates(start + 1) if self._is_chain(place)), None)

    def _candidates(self, start: int) -> Iterator[int]:
        """Yield where something begins like a record."""
        pattern = _NO_MESSAGE if self.has_chunks else _ANY_RECORD
        overlap = RECORD.size - 1
        while start < self._file.written:
            self._file.file.seek(start)
            block = self._file.file.read(_BLOCK_BYTES + overlap)
            for match in pattern.finditer(block, 0, len(block)):
                if match.start() < _BLOCK_BYTES:
                    yield start + match.start()
            start += _BLOCK_BYTES

    def _is_chain(self, start: int) -> bool:
        """Tell whether so much fits together from here that it is no chance."""
        weight, first_ns = 0, self.time_ns
        for _ in range(_MOST_IN_CHAIN):
            found = self._shapes.head(start)
            if found is None or not self._may_continue(*found):
                return False
            record, head = found
            if not self._file.is_whole(record):
                return record.opcode == CHUNK
            if record.opcode == DATA_END:
                return self._shapes.closes(record.end)
            if record.opcode in {CHUNK, FOOTER} or record.end == self._file.size:
                return True
            if record.opcode == MESSAGE:
                time_ns = message_header(head).log_time_ns
                is_near = first_ns is not None and abs(time_ns - first_ns) < NEAR_NS
                if weight and not is_near:
                    return False
                # the first may be far from all before, as after a clock was set; then those after it are near to it
                first_ns = first_ns if is_near else time_ns
                weight += 2 if is_near else 1
            weight += record.opcode == MESSAGE_INDEX and self.has_chunks
            if weight >= _LEAST_WEIGHT:
                return True
            start = record.end
        return True

    def _may_continue(self, record: Record, head: bytes) -> bool:
        """Tell whether a record may be one of those from which on all is sound."""
        if record.opcode not in KNOWN or not self._shapes.is_plausible(record, head):
            return False
        return record.opcode not in {SCHEMA, CHANNEL} or self._shapes.is_filled(record)
