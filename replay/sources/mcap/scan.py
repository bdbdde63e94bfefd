"""One pass through an MCAP file, one chunk in memory at a time: what is there, and what cannot be used.

Messages outside of chunks, and those in chunks without a checksum, are covered by the checksum of the data section
alone, if it has one. Where that is wrong, nothing tells which of them are right: none of them is used.
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

from replay.skip_cause import SkipCause
from replay.sources.lapses import Written, lapse_of
from replay.sources.losses import Loss
from replay.sources.mcap.channels import Channel, ChannelTable, check_description
from replay.sources.mcap.chunk import chunk_content, cut_chunk_content, describes, inner_records, inside_of
from replay.sources.mcap.chunk_ends import ChunkEnds
from replay.sources.mcap.index import NO_CHUNK, Entry
from replay.sources.mcap.losses import Unusable, damaged
from replay.sources.mcap.record_file import RecordFile, file_crc, indexed_counts
from replay.sources.mcap.records import (
    CHANNEL,
    CHUNK,
    MESSAGE,
    SCHEMA,
    BadPart,
    MessageHeader,
    Record,
    message_header,
    message_header_at,
)
from replay.sources.mcap.summary import Contents, Summary
from replay.sources.mcap.walk import Walk
from replay.sources.memory import over_memory

_CRC = struct.Struct("<I")


@dataclass(frozen=True, slots=True)
class Scan:
    """What one pass through a file found.

    Parameters
    ----------
    entries
        Where the messages of the channels asked for are, sorted.
    cut_chunk
        Where the chunk begins at which the file was cut off, if it was.
    losses
        What cannot be used.
    bad_chunks
        Where those begin of which nothing is used.
    only_covered
        Whether only messages are used that a checksum of their chunk covers.
    table
        What describes the channels.
    """

    contents: Contents
    entries: tuple[Entry, ...]
    cut_chunk: int | None = None
    losses: tuple[Loss, ...] = ()
    bad_chunks: frozenset[int] = frozenset()
    only_covered: bool = False
    table: ChannelTable = field(default_factory=ChannelTable)


def scan(
    file: RecordFile,
    wanted: Callable[[Channel], bool] | None,
    summary: Summary | None = None,
    *,
    keeps_records: bool = False,
) -> Scan:
    """Pass through a file once.

    Parameters
    ----------
    wanted
        Tells of which channels the messages are to be found; None for no messages at all.
    summary
        What it says is taken where nothing else does or, if it is checked, in place of what else does.
    keeps_records
        Whether the table of channels keeps their records.
    """
    walk = Walk(file, summary.places if summary else ())
    found = _Found(file, wanted, summary, keeps_records=keeps_records)
    for record in walk:
        if record.opcode == CHUNK:
            if not found.add_chunk(record, is_followed=walk.is_followed(record)):
                walk.doubt(record)
        elif record.opcode == MESSAGE:
            found.add_loose(record, message_header(walk.head))
        elif record.opcode in {SCHEMA, CHANNEL}:
            found.describe(record, is_repeated=walk.data_end is not None)
    return found.scan(walk)


@dataclass(slots=True)
class _Messages:
    """Messages of a pass."""

    entries: list[Entry] = field(default_factory=list)
    counts: Counter[int] = field(default_factory=Counter)
    times_ns: tuple[int, int] | None = None

    def add(self, message: MessageHeader) -> None:
        first_ns, last_ns = self.times_ns or (message.log_time_ns, message.log_time_ns)
        self.times_ns = min(first_ns, message.log_time_ns), max(last_ns, message.log_time_ns)
        self.counts[message.channel] += 1


class _Found:
    """What a pass through a file has found so far."""

    def __init__(
        self,
        file: RecordFile,
        wanted: Callable[[Channel], bool] | None,
        summary: Summary | None,
        *,
        keeps_records: bool,
    ) -> None:
        self._file = file
        self._wanted = wanted
        self._summary = summary
        self._table = ChannelTable(keeps_records=keeps_records)
        self._repeated = ChannelTable(keeps_records=keeps_records)
        self._is_wanted: dict[int, bool] = {}
        # those that a checksum of their own covers, and the others
        self._covered, self._others = _Messages(), _Messages()
        self._unusable = Unusable(file, summary)
        self._only_covered = False
        self._chunk_ends = ChunkEnds(file)

    def describe(self, record: Record, *, is_repeated: bool) -> None:
        """Take in a schema or channel outside of chunks; behind the data they are only repeated."""
        try:
            check_description(record)
            table = self._repeated if is_repeated else self._table
            table.add(record.opcode, self._file.content(record))
        except ValueError as error:
            if not is_repeated:
                detail = f"it does not describe a channel: {error}"
                self._unusable.named.append(damaged(record.start, record.end, detail))

    def add_chunk(self, record: Record, *, is_followed: bool) -> bool:
        """Take in a chunk, all of it or nothing; return whether it surely ends where it says.

        If it has no checksum, bytes of it may be missing. Were they missing within it, its records would not fit; of
        its last message it does not show, which has some of what follows in their place.
        """
        try:
            content, is_covered = chunk_content(self._file, record.start)
            is_sure = is_covered or is_followed
            inside = None if is_covered else inside_of(content)
            certain = content if inside is None or is_sure else content[: inside.last_record]
            self._add_content(certain, record.start, self._covered if is_covered else self._others)
        except BadPart as error:
            self._unusable.bad_chunks.append((record.start, error, indexed_counts(self._file, record.end)))
            return is_followed
        if len(certain) < len(content):
            self._unusable.doubtful.append((record.start, len(certain)))
        elif inside is not None:
            self._chunk_ends.add(record, inside)
        return is_sure

    def _drop_doubtful(self, walk: Walk) -> None:
        """Leave out the last messages of chunks of which bytes may be missing."""
        doubtful = self._chunk_ends.doubtful(walk)
        if not doubtful:
            return
        for block, inner in doubtful.items():
            header = message_header_at(chunk_content(self._file, block)[0], inner)
            if header is not None:
                self._others.counts[header.channel] -= 1
                self._unusable.doubtful.append((block, inner))
        left = [each for each in self._others.entries if doubtful.get(each.block) != each.inner]
        self._others.entries = left

    def add_loose(self, record: Record, message: MessageHeader) -> None:
        """Take in a message outside of chunks."""
        length = record.end - record.start
        if length > self._file.most_bytes:
            detail = over_memory(self._file.most_bytes)
            loss = Loss(SkipCause.OVER_MEMORY, f"the message at byte {record.start}", detail, 1)
            self._unusable.named.append(replace(loss, lapse=lapse_of([message.log_time_ns])))
            return
        self._add(message, record.start, NO_CHUNK, self._others)

    def _add_content(self, content: bytes, start: int, messages: _Messages) -> None:
        # all is checked before any of it is taken in
        if describes(content):
            self._add_descriptions(content)
        for record in inner_records(content):
            if record.opcode == MESSAGE:
                self._add(message_header(content, record.content), start, record.start, messages)

    def _add_descriptions(self, content: bytes) -> None:
        try:
            for record in inner_records(content):
                if record.opcode in {SCHEMA, CHANNEL}:
                    check_description(record)
                    self._table.add(record.opcode, content[record.content : record.end])
        except ValueError as error:
            raise BadPart(SkipCause.DAMAGED, f"a record in it does not describe a channel: {error}") from error

    def _add(self, message: MessageHeader, block: int, inner: int, messages: _Messages) -> None:
        messages.add(message)
        if self._wanted is None:
            return
        key = message.channel
        if key not in self._is_wanted:
            channel = self._known().get(key)
            # what is not described yet may be later
            self._is_wanted[key] = channel is None or bool(channel.problem) or self._wanted(channel)
        if self._is_wanted[key]:
            messages.entries.append(Entry(message.log_time_ns, block, inner, key))

    def _known(self) -> ChannelTable:
        """Return the channels met so far, with those that a checked summary describes."""
        if self._summary is not None and self._summary.is_checked:
            return self._summary.table.completed_by(self._table)
        return self._table

    def _channels(self, completed: ChannelTable, counts: Mapping[int, int]) -> dict[int, Channel]:
        """Return all channels, of those that are described behind the data alone only those that have messages."""
        known = self._known().all()
        return {key: channel for key, channel in completed.all().items() if key in known or counts.get(key)}

    def scan(self, walk: Walk) -> Scan:
        """Return what was found, once all was passed through."""
        if walk.cut_chunk is not None:
            self._add_cut_chunk(walk.cut_chunk)
        self._drop_doubtful(walk)
        self._check_data(walk)
        counts = self._covered.counts + self._others.counts
        table = self._known().completed_by(self._repeated)
        channels = self._channels(table, counts)
        contents = Contents(channels, counts, *self._times_ns())
        entries = tuple(self._entries(channels))
        # which takes as much memory as the entries
        needed = entries if self._unusable.doubtful or self._unusable.bad_chunks or walk.gaps else ()
        written = Written(((entry.block, entry.inner), entry.log_time_ns) for entry in needed)
        losses = tuple(self._unusable.losses(walk, contents, written))
        bad_chunks = frozenset(start for start, _, _ in self._unusable.bad_chunks)
        return Scan(contents, entries, walk.cut_chunk, losses, bad_chunks, self._only_covered, table)

    def _entries(self, channels: Mapping[int, Channel]) -> list[Entry]:
        if self._wanted is None:
            return []
        return sorted(
            entry
            for entry in (*self._covered.entries, *self._others.entries)
            if entry.channel in channels and self._wanted(channels[entry.channel])
        )

    def _add_cut_chunk(self, start: int) -> None:
        try:
            self._add_content(cut_chunk_content(self._file, start), start, self._others)
        except BadPart as error:
            self._unusable.bad_chunks.append((start, error, None))

    def _check_data(self, walk: Walk) -> None:
        """Let go of what only the checksum of the data section covers, if it is wrong."""
        if walk.data_end is None or not self._others.counts:
            return
        content = self._file.content(walk.data_end)
        if _CRC.unpack(content)[0] in {0, file_crc(self._file, 0, walk.data_end.start)}:
            return
        detail = (
            "its checksum (CRC) is wrong, and the messages that no other one covers are left out, because nothing "
            "tells which of them are right; copy the recording again from where it was made"
        )
        lost = self._others.counts.total()
        self._unusable.named.append(Loss(SkipCause.WRONG_CHECKSUM, "the data section", detail, lost))
        self._others = _Messages()
        self._only_covered = True

    def _times_ns(self) -> tuple[int | None, int | None]:
        times = [times for each in (self._covered, self._others) if (times := each.times_ns)]
        return min((first for first, _ in times), default=None), max((last for _, last in times), default=None)
