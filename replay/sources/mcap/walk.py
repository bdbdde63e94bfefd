"""The records of an MCAP file one after the other, past what is damaged.

A record whose header is damaged hides where the next one begins. Then the next place is looked for from which records
follow each other as they should: types that there are, lengths that fit the file, fields that fit the record, and times
of messages near each other. Where a sound summary says at which bytes chunks begin, these are tried first. In a
recording with chunks a message is never taken for such a place, because it may be one within a chunk, whose checksum
says nothing of one message.

A length may be damaged and fit all the same. So what could be of any length is taken for a record only if one follows
it; if none does, and nothing says that it is the next one which is damaged, both are passed over.

The file is read from its begin to its end, and what is in doubt a few times; each place is looked at in constant time.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from struct import Struct

from replay.sources.mcap.chunk import CHUNK_HEAD_BYTES, is_consistent, seems_a_chunk
from replay.sources.mcap.record_file import RecordFile
from replay.sources.mcap.records import (
    ATTACHMENT,
    ATTACHMENT_INDEX,
    CHANNEL,
    CHUNK,
    CHUNK_INDEX,
    DATA_END,
    FOOTER,
    HEADER,
    MAGIC,
    MESSAGE,
    MESSAGE_HEAD,
    MESSAGE_INDEX,
    METADATA,
    METADATA_INDEX,
    RECORD,
    SCHEMA,
    STATISTICS,
    SUMMARY_OFFSET,
    Record,
    message_header,
)

_PRIVATE = 0x80
_HEAD_BYTES = CHUNK_HEAD_BYTES
_BLOCK_BYTES = 1 << 20
_NEAR_NS = 86_400 * 10**9
_MOST_UNKNOWN = 16
_MOST_TIMES_AGAIN = 4
_LEAST_CONTENT_BYTES = 4
_LONGEST_BYTES = 1 << 40
_MOST_IN_CHAIN = 64
_LEAST_WEIGHT = 4

_U32 = Struct("<I")
_U64 = Struct("<Q")
# Where records may begin again: those that nothing depends on are left out, because they say little of themselves.
# They are at most 4 GiB long, so that half of the length is zeros.
_ANY_RECORD = re.compile(rb"[\x02-\x07\x0f](?=[\s\S]{4}\0{4})")
_NO_MESSAGE = re.compile(rb"[\x02\x06\x07\x0f](?=[\s\S]{4}\0{4})")

# How long the content of a record is at least, and where in it the length of its first text is, if it has one.
_SHAPES: dict[int, tuple[int, int | None]] = {
    HEADER: (8, 0),
    SCHEMA: (14, 2),
    CHANNEL: (16, 4),
    MESSAGE: (MESSAGE_HEAD.size, None),
    CHUNK_INDEX: (64, None),
    ATTACHMENT: (36, 16),
    ATTACHMENT_INDEX: (48, None),
    STATISTICS: (46, None),
    METADATA: (8, 0),
    METADATA_INDEX: (20, 16),
    SUMMARY_OFFSET: (17, None),
}
_KNOWN = {*_SHAPES, FOOTER, CHUNK, MESSAGE_INDEX, DATA_END}
# What they say of themselves leaves no doubt.
_SURE = {CHUNK, MESSAGE_INDEX, DATA_END, FOOTER}


@dataclass(frozen=True, slots=True)
class Gap:
    """Bytes of the file that are no records; ``opcode`` is what the first of them would be as one."""

    start: int
    stop: int
    opcode: int


class Walk:
    """Yields the records of the data section; of the summary section, no more than there is.

    Parameters
    ----------
    chunk_starts
        Where chunks begin, and where the data section ends, as a sound summary says; ascending.

    Attributes
    ----------
    gaps
        What was passed over as damaged, or as of a type that there is not.
    ends_early
        Where the last whole record ends, if nothing closes the recording.
    cut_chunk
        Where the chunk begins at which it was cut off, if it was.
    data_end
        The record that closes the data section, if it was met.
    footer
        The record that closes the file, if it was met.
    head
        How the content of the record begins that was yielded last.
    """

    def __init__(self, file: RecordFile, chunk_starts: Sequence[int] = ()) -> None:
        self.gaps: list[Gap] = []
        self.ends_early: int | None = None
        self.cut_chunk: int | None = None
        self.data_end: Record | None = None
        self.footer: Record | None = None
        self.head = b""
        self._file = file
        self._chunk_starts = chunk_starts
        self._has_chunks = bool(chunk_starts)
        self._has_header = False
        self._time_ns: int | None = None
        self._resumed: tuple[int, int | None] = (-1, None)
        self._looked_at: tuple[int, tuple[Record, bytes] | None] = (-1, None)
        self._doubted: Record | None = None
        # so that neither takes more than a few times as long as the file is
        self._bytes_again = _MOST_TIMES_AGAIN * file.size
        self._steps_left = _MOST_TIMES_AGAIN * file.size // RECORD.size
        # a record of an unknown type, and where the records end that follow it and are of one as well
        self._unknown = (-1, -1)

    def __iter__(self) -> Iterator[Record]:
        start = self._after_magic(len(MAGIC))
        while True:
            record = self._next(start)
            if record is None:
                resumed = self._resume(start)
                if resumed is None:
                    self._end_early(start)
                    return
                self._pass_over(start, resumed)
                start = resumed
                continue
            if self.data_end is None and self._is_suspicious(record):
                self.gaps.append(Gap(record.start, record.end, record.opcode))
            self._has_header |= record.opcode == HEADER
            yield record
            start = self._after(record)
            if record.opcode == DATA_END:
                self.data_end = record
            if record.opcode == FOOTER:
                self.footer = record
                return

    def is_followed(self, record: Record) -> bool:
        """Tell whether another record follows this one, or the end of what was written of the file."""
        if not self._follows(record.end):
            return self._is_cut_at(record.end)
        following = self._after_unknown(record.end)
        found = None if following in {self._file.size, self._file.written} else self._head(following)
        # By chance, the others are there more easily.
        if found is None or found[0].opcode in _SURE:
            return True
        return self._follows(found[0].end) or self._is_cut_at(found[0].end)

    def doubt(self, record: Record) -> None:
        """Look for the next record within the one that was yielded last, and not behind it only.

        Where bytes of a record are missing, it has bytes of what follows in their place.
        """
        self._doubted = record

    def _after(self, record: Record) -> int:
        """Return where it goes on after a record."""
        length = record.end - record.content
        if self._doubted != record or length > self._bytes_again:
            return record.end
        self._bytes_again -= length
        resumed = self._resume(record.content)
        return record.end if resumed is None else min(resumed, record.end)

    def _after_magic(self, start: int) -> int:
        """Return where records begin; the magic bytes may be there several times."""
        while self._is_magic(start):
            start += len(MAGIC)
        return start

    def _is_magic(self, start: int) -> bool:
        if start > self._file.size:
            return False
        self._file.file.seek(start)
        return self._file.file.read(len(MAGIC)) == MAGIC

    def _head(self, start: int) -> tuple[Record, bytes] | None:
        """Return what is at a byte as a record; what was looked at last is not read again."""
        if self._looked_at[0] != start:
            self._looked_at = start, self._file.head_at(start, _HEAD_BYTES)
        return self._looked_at[1]

    def _next(self, start: int) -> Record | None:
        """Return the record at a byte; None if there is none that can be taken for one."""
        found = self._head(start)
        if found is None or not self._file.is_whole(found[0]):
            return None
        record, head = found
        if self.data_end is None and record.opcode not in {CHUNK, MESSAGE} and seems_a_chunk(record, head):
            self._has_chunks = True
            return None
        if record.opcode not in _KNOWN:
            return record if self._follows(record.end, after_unknown=True) else None
        if not self._is_plausible(record, head):
            # a chunk that nothing but itself speaks against is left to who reads it
            return record if record.opcode == CHUNK and self._follows(record.end) else None
        self._has_chunks |= record.opcode in {CHUNK, MESSAGE_INDEX}
        if not self._is_sure(record):
            after = self._resume(record.end)
            if after is None:
                # the end of the file, unless this record reaches over others
                within = self._resume(record.start)
                if within is not None and within < record.end:
                    return None
            elif not self._begins_damaged(record, after):
                return None
        if record.opcode == MESSAGE:
            self._time_ns = message_header(head).log_time_ns
        self.head = head
        return record

    def _is_sure(self, record: Record) -> bool:
        """Tell whether a plausible record leaves no doubt, by itself or by what follows it."""
        if record.opcode == DATA_END and self.gaps:
            return self._closes(record.end)
        return record.opcode in _SURE or self._follows(record.end)

    def _is_suspicious(self, record: Record) -> bool:
        """Tell whether a record is of a type that there is not, or not here, or of a private one yet like messages."""
        if record.opcode == HEADER:
            return self._has_header
        if record.opcode in _KNOWN or record.opcode < _PRIVATE:
            return record.opcode not in _KNOWN
        if record.end - record.content < MESSAGE_HEAD.size:
            return False
        time_ns = self._time_ns if self._time_ns is not None else self._next_time_ns(record.end)
        return time_ns is not None and abs(self._file.message_header(record).log_time_ns - time_ns) < _NEAR_NS

    def _next_time_ns(self, start: int) -> int | None:
        """Return the time of the next message outside of chunks, if it is not far."""
        for _ in range(_MOST_UNKNOWN):
            found = self._file.head_at(start, MESSAGE_HEAD.size)
            if found is None or not self._file.is_whole(found[0]):
                return None
            if found[0].opcode == MESSAGE and len(found[1]) == MESSAGE_HEAD.size:
                return message_header(found[1]).log_time_ns
            start = found[0].end
        return None

    def _follows(self, start: int, *, after_unknown: bool = False) -> bool:
        """Tell whether a record begins where another one ends, or the file is at its end there."""
        known = self._after_unknown(start)
        if known in {self._file.size, self._file.written}:
            return True
        found = self._head(known)
        if found is None or not self._file.is_whole(found[0]) or found[0].opcode not in _KNOWN:
            return False
        is_plausible = self._is_plausible(*found)
        # These follow chunks only: what seems to be of an unknown type is a chunk with a damaged header.
        is_chunk = is_plausible and after_unknown and found[0].opcode == MESSAGE_INDEX
        self._has_chunks |= is_chunk
        return is_plausible and not is_chunk

    def _after_unknown(self, start: int) -> int:
        """Return where, from a record on, those end that are whole and of an unknown type."""
        before, stop = self._unknown
        if start == before or (before < stop and self._file.end_of(before) == start):
            self._unknown = start, stop
            return stop
        stop = start
        while self._steps_left > 0 and stop not in {self._file.size, self._file.written}:
            found = self._head(stop)
            if found is None or found[0].opcode in _KNOWN or not self._file.is_whole(found[0]):
                break
            stop = found[0].end
            self._steps_left -= 1
        if stop > start:
            self._unknown = start, stop
        return stop

    def _is_cut_at(self, start: int) -> bool:
        """Tell whether a record begins at a byte at which the file was cut off."""
        if self._is_magic(self._file.size - len(MAGIC)):
            return False
        found = self._head(start)
        if found is None:
            self._file.file.seek(start)
            return self._file.file.read(1) in {bytes([each]) for each in _KNOWN}
        record, head = found
        length = record.end - record.content
        if record.opcode not in _KNOWN or record.end <= self._file.written or length >= _LONGEST_BYTES:
            return False
        written = head[: max(0, self._file.written - record.content)]
        if record.opcode == MESSAGE_INDEX:
            return length % 16 == 6 and (len(written) < 6 or self._is_plausible(record, written))
        return record.opcode != CHUNK or len(written) < CHUNK_HEAD_BYTES or self._is_plausible(record, written)

    def _begins_damaged(self, record: Record, after: int) -> bool:
        """Tell whether it is the record that follows this one of which the header is damaged, and not this one's.

        Parameters
        ----------
        after
            Where sound records begin again.
        """
        found = self._file.head_at(record.end, MESSAGE_HEAD.size)
        if found is None:
            return False
        following, head = found
        # No record has less content.
        if following.end == after and following.end - following.content >= _LEAST_CONTENT_BYTES:
            return True
        if record.opcode != MESSAGE or following.opcode != MESSAGE or len(head) < MESSAGE_HEAD.size:
            return False
        own = self._file.message_header(record)
        return abs(message_header(head).log_time_ns - own.log_time_ns) < _NEAR_NS

    def _is_plausible(self, record: Record, head: bytes) -> bool:
        """Tell whether the fields of a record fit its length."""
        length = record.end - record.content
        if record.opcode == CHUNK:
            return is_consistent(record, head)
        if record.opcode == MESSAGE_INDEX:
            return length % 16 == 6 and _number(head, 2) == length - 6
        if record.opcode == DATA_END:
            return length == 4
        if record.opcode == FOOTER:
            return length == 20 and self._is_magic(record.end)
        least, text_at = _SHAPES[record.opcode]
        return length >= least and (text_at is None or _number(head, text_at) <= length - least)

    def _end_early(self, start: int) -> None:
        """Note where the file ends; after the data section nothing is missing that cannot do without."""
        if self.data_end is not None:
            return
        self.ends_early = start
        found = self._head(start)
        if found and found[0].opcode == CHUNK and is_consistent(*found):
            self.cut_chunk = start

    def _pass_over(self, start: int, stop: int) -> None:
        if self.data_end is None:
            found = self._file.head_at(start)
            self.gaps.append(Gap(start, stop, found[0].opcode if found else 0))

    def _resume(self, start: int) -> int | None:
        """Return the next place after this one at which records follow each other; None if there is none."""
        if self._resumed[0] != start:
            self._resumed = start, self._sought(start)
        return self._resumed[1]

    def _sought(self, start: int) -> int | None:
        found = self._head(start)
        if found and found[0].opcode == CHUNK:
            if is_consistent(*found):
                # the file was cut off here
                return None
            self._has_chunks |= self._time_ns is None
        known = bisect_right(self._chunk_starts, start)
        for place in self._chunk_starts[known:]:
            if self._is_chain(place):
                return place
        return next((place for place in self._candidates(start + 1) if self._is_chain(place)), None)

    def _candidates(self, start: int) -> Iterator[int]:
        """Yield where something begins like a record."""
        pattern = _NO_MESSAGE if self._has_chunks else _ANY_RECORD
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
        weight, first_ns = 0, self._time_ns
        for _ in range(_MOST_IN_CHAIN):
            found = self._head(start)
            if found is None or not self._may_continue(*found):
                return False
            record, head = found
            if not self._file.is_whole(record):
                return record.opcode == CHUNK
            if record.opcode == DATA_END:
                return self._closes(record.end)
            if record.opcode in {CHUNK, FOOTER} or record.end == self._file.size:
                return True
            if record.opcode == MESSAGE:
                time_ns = message_header(head).log_time_ns
                is_near = first_ns is not None and abs(time_ns - first_ns) < _NEAR_NS
                if weight and not is_near:
                    return False
                # the first may be far from all before, as after a clock was set; then those after it are near to it
                first_ns = first_ns if is_near else time_ns
                weight += 2 if is_near else 1
            weight += record.opcode == MESSAGE_INDEX and self._has_chunks
            if weight >= _LEAST_WEIGHT:
                return True
            start = record.end
        return True

    def _may_continue(self, record: Record, head: bytes) -> bool:
        """Tell whether a record may be one of those from which on all is sound."""
        if record.opcode not in _KNOWN or not self._is_plausible(record, head):
            return False
        return record.opcode not in {SCHEMA, CHANNEL} or self._is_filled(record)

    def _is_filled(self, record: Record) -> bool:
        """Tell whether the three texts of a schema or channel take up all of it."""
        at = record.content + (_SHAPES[record.opcode][1] or 0)
        for _ in range(3):
            if at + _U32.size > record.end:
                return False
            self._file.file.seek(at)
            at += _U32.size + _number(self._file.file.read(_U32.size), 0)
        return at == record.end

    def _closes(self, start: int) -> bool:
        """Tell whether the data section may end at this byte."""
        if start == self._file.size:
            return True
        found = self._head(start)
        if found and found[0].opcode == FOOTER:
            return self._is_plausible(*found)
        footer = self._file.head_at(self._file.size - len(MAGIC) - RECORD.size - 20, 20)
        if footer and footer[0].opcode == FOOTER and _U64.unpack_from(footer[1])[0] == start:
            return True
        for _ in range(_LEAST_WEIGHT):
            found = self._head(start)
            if found is None or not self._file.is_whole(found[0]) or found[0].opcode not in _KNOWN - {DATA_END}:
                return False
            if not self._is_plausible(*found):
                return False
            start = found[0].end
        return True


def _number(head: bytes, at: int) -> int:
    """Return the number in 32 bits at a byte of a record's content; more than fits anything if it is not there."""
    return int(_U32.unpack_from(head, at)[0]) if at + _U32.size <= len(head) else 1 << 64
