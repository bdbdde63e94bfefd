"""The records of an MCAP file one after the other, past what is damaged.

A record whose header is damaged hides where the next one begins; `replay.sources.mcap.resume` looks for it.

A length may be damaged and fit all the same. So what could be of any length is taken for a record only if one follows
it; if none does, and nothing says that it is the next one which is damaged, both are passed over.

The file is read from its begin to its end, and what is in doubt a few times; each place is looked at in constant time.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from replay.sources.mcap.chunk import CHUNK_HEAD_BYTES, is_consistent, seems_a_chunk
from replay.sources.mcap.record_file import RecordFile
from replay.sources.mcap.records import (
    CHUNK,
    DATA_END,
    FOOTER,
    HEADER,
    MAGIC,
    MESSAGE,
    MESSAGE_HEAD,
    MESSAGE_INDEX,
    RECORD,
    Record,
    message_header,
)
from replay.sources.mcap.resume import NEAR_NS, Resumption
from replay.sources.mcap.shapes import KNOWN, SURE, Shapes

_PRIVATE = 0x80
_MOST_UNKNOWN = 16
_MOST_TIMES_AGAIN = 4
_LEAST_CONTENT_BYTES = 4
_LONGEST_BYTES = 1 << 40


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
        self._shapes = Shapes(file)
        self._resumption = Resumption(self._shapes, chunk_starts)
        self._has_header = False
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
                resumed = self._resumption.next_after(start)
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
        found = None if following in {self._file.size, self._file.written} else self._shapes.head(following)
        # By chance, the others are there more easily.
        if found is None or found[0].opcode in SURE:
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
        resumed = self._resumption.next_after(record.content)
        return record.end if resumed is None else min(resumed, record.end)

    def _after_magic(self, start: int) -> int:
        """Return where records begin; the magic bytes may be there several times."""
        while self._shapes.is_magic(start):
            start += len(MAGIC)
        return start

    def _next(self, start: int) -> Record | None:
        """Return the record at a byte; None if there is none that can be taken for one."""
        found = self._shapes.head(start)
        if found is None or not self._file.is_whole(found[0]):
            return None
        record, head = found
        if self.data_end is None and record.opcode not in {CHUNK, MESSAGE} and seems_a_chunk(record, head):
            self._resumption.has_chunks = True
            return None
        if record.opcode not in KNOWN:
            return record if self._follows(record.end, after_unknown=True) else None
        if not self._shapes.is_plausible(record, head):
            # a chunk that nothing but itself speaks against is left to who reads it
            return record if record.opcode == CHUNK and self._follows(record.end) else None
        self._resumption.has_chunks |= record.opcode in {CHUNK, MESSAGE_INDEX}
        if not self._is_sure(record):
            after = self._resumption.next_after(record.end)
            if after is None:
                # the end of the file, unless this record reaches over others
                within = self._resumption.next_after(record.start)
                if within is not None and within < record.end:
                    return None
            elif not self._begins_damaged(record, after):
                return None
        if record.opcode == MESSAGE:
            self._resumption.time_ns = message_header(head).log_time_ns
        self.head = head
        return record

    def _is_sure(self, record: Record) -> bool:
        """Tell whether a plausible record leaves no doubt, by itself or by what follows it."""
        if record.opcode == DATA_END and self.gaps:
            return self._shapes.closes(record.end)
        return record.opcode in SURE or self._follows(record.end)

    def _is_suspicious(self, record: Record) -> bool:
        """Tell whether a record is of a type that there is not, or not here, or of a private one yet like messages."""
        if record.opcode == HEADER:
            return self._has_header
        if record.opcode in KNOWN or record.opcode < _PRIVATE:
            return record.opcode not in KNOWN
        if record.end - record.content < MESSAGE_HEAD.size:
            return False
        time_ns = self._resumption.time_ns if self._resumption.time_ns is not None else self._next_time_ns(record.end)
        return time_ns is not None and abs(self._file.message_header(record).log_time_ns - time_ns) < NEAR_NS

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
        found = self._shapes.head(known)
        if found is None or not self._file.is_whole(found[0]) or found[0].opcode not in KNOWN:
            return False
        is_plausible = self._shapes.is_plausible(*found)
        # These follow chunks only: what seems to be of an unknown type is a chunk with a damaged header.
        is_chunk = is_plausible and after_unknown and found[0].opcode == MESSAGE_INDEX
        self._resumption.has_chunks |= is_chunk
        return is_plausible and not is_chunk

    def _after_unknown(self, start: int) -> int:
        """Return where, from a record on, those end that are whole and of an unknown type."""
        before, stop = self._unknown
        if start == before or (before < stop and self._file.end_of(before) == start):
            self._unknown = start, stop
            return stop
        stop = start
        while self._steps_left > 0 and stop not in {self._file.size, self._file.written}:
            found = self._shapes.head(stop)
            if found is None or found[0].opcode in KNOWN or not self._file.is_whole(found[0]):
                break
            stop = found[0].end
            self._steps_left -= 1
        if stop > start:
            self._unknown = start, stop
        return stop

    def _is_cut_at(self, start: int) -> bool:
        """Tell whether a record begins at a byte at which the file was cut off."""
        if self._shapes.is_magic(self._file.size - len(MAGIC)):
            return False
        found = self._shapes.head(start)
        if found is None:
            self._file.file.seek(start)
            return self._file.file.read(1) in {bytes([each]) for each in KNOWN}
        record, head = found
        length = record.end - record.content
        if record.opcode not in KNOWN or record.end <= self._file.written or length >= _LONGEST_BYTES:
            return False
        written = head[: max(0, self._file.written - record.content)]
        if record.opcode == MESSAGE_INDEX:
            return length % 16 == 6 and (len(written) < 6 or self._shapes.is_plausible(record, written))
        return record.opcode != CHUNK or len(written) < CHUNK_HEAD_BYTES or self._shapes.is_plausible(record, written)

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
        return abs(message_header(head).log_time_ns - own.log_time_ns) < NEAR_NS

    def _end_early(self, start: int) -> None:
        """Note where the file ends; after the data section nothing is missing that cannot do without."""
        if self.data_end is not None:
            return
        self.ends_early = start
        found = self._shapes.head(start)
        if found and found[0].opcode == CHUNK and is_consistent(*found):
            self.cut_chunk = start

    def _pass_over(self, start: int, stop: int) -> None:
        if self.data_end is None:
            found = self._file.head_at(start)
            self.gaps.append(Gap(start, stop, found[0].opcode if found else 0))
