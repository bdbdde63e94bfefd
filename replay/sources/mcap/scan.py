"""One pass through an MCAP file, one chunk in memory at a time: what is there, and what cannot be used.

A chunk that cannot be used costs the messages in it, a damaged record those up to the next sound one, and the end of a
file that was cut off what would have come after it. Each is named. Where a sound summary counts just as many messages
as were found, nothing is lost, whatever else is damaged.

Messages outside of chunks, and those in chunks without a checksum, are covered by the checksum of the data section
alone, if it has one. Where that is wrong, nothing tells which of them are right: none of them is used.
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

from replay.skip_cause import SkipCause
from replay.sources.boundary import COPY_AGAIN
from replay.sources.lapses import AT_END, Place, Written, lapse_of
from replay.sources.losses import Loss
from replay.sources.mcap.channels import Channel, ChannelTable, check_description
from replay.sources.mcap.chunk import (
    BadPart,
    Inside,
    chunk_content,
    cut_chunk_content,
    describes,
    inner_records,
    inside_of,
)
from replay.sources.mcap.index import NO_CHUNK, Entry
from replay.sources.mcap.record_file import RecordFile, file_crc
from replay.sources.mcap.records import (
    CHANNEL,
    CHUNK,
    HEADER,
    MAGIC,
    MESSAGE,
    SCHEMA,
    MessageHeader,
    Record,
    message_header,
    message_header_at,
)
from replay.sources.mcap.summary import Contents, Summary, statistics_between
from replay.sources.mcap.walk import Walk
from replay.sources.memory import over_memory
from replay.words import counted

_CRC = struct.Struct("<I")
_MOST_NAMED = 3


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
        self._bad_chunks: list[tuple[int, BadPart, Counter[int] | None]] = []
        self._losses: list[Loss] = []
        # messages that are left out though they may be right
        self._doubtful: list[Place] = []
        self._only_covered = False
        # of chunks without a checksum: whether any has indexes; of those that have not all of theirs, where the last
        # record in them begins, and where in the file those end that there are
        self._has_indexes = False
        self._without_index: dict[int, tuple[int, int]] = {}

    def describe(self, record: Record, *, is_repeated: bool) -> None:
        """Take in a schema or channel outside of chunks; behind the data they are only repeated."""
        try:
            check_description(record)
            table = self._repeated if is_repeated else self._table
            table.add(record.opcode, self._file.content(record))
        except ValueError as error:
            if not is_repeated:
                self._losses.append(_damaged(record.start, record.end, f"it does not describe a channel: {error}"))

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
            self._bad_chunks.append((record.start, error, indexed_counts(self._file, record.end)))
            return is_followed
        if len(certain) < len(content):
            self._doubtful.append((record.start, len(certain)))
        elif inside is not None:
            self._look_for_indexes(record, inside)
        return is_sure

    def _look_for_indexes(self, record: Record, inside: Inside) -> None:
        """Note a chunk that has not all message indexes behind it.

        If as many bytes of it are missing as an index has, that is in it, and the next record follows all the same.
        """
        indexed, end = indexes_behind(self._file, record.end)
        self._has_indexes |= bool(indexed)
        if indexed.keys() < inside.channels:
            self._without_index[record.start] = inside.last_record, end

    def _drop_doubtful(self, walk: Walk) -> None:
        """Leave out the last message of chunks that have not all indexes though there are some."""
        ends = {walk.ends_early, self._file.size, self._file.written}
        doubtful = {block: inner for block, (inner, end) in self._without_index.items() if end not in ends}
        if not self._has_indexes:
            return
        for block, inner in doubtful.items():
            header = message_header_at(chunk_content(self._file, block)[0], inner)
            if header is not None:
                self._others.counts[header.channel] -= 1
                self._doubtful.append((block, inner))
        left = [each for each in self._others.entries if doubtful.get(each.block) != each.inner]
        self._others.entries = left

    def add_loose(self, record: Record, message: MessageHeader) -> None:
        """Take in a message outside of chunks."""
        length = record.end - record.start
        if length > self._file.most_bytes:
            detail = over_memory(self._file.most_bytes)
            loss = Loss(SkipCause.OVER_MEMORY, f"the message at byte {record.start}", detail, 1)
            self._losses.append(replace(loss, lapse=lapse_of([message.log_time_ns])))
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
        needed = entries if self._doubtful or self._bad_chunks or walk.gaps else ()
        written = Written(((entry.block, entry.inner), entry.log_time_ns) for entry in needed)
        losses = tuple(self._all_losses(walk, contents, written))
        bad_chunks = frozenset(start for start, _, _ in self._bad_chunks)
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
            self._bad_chunks.append((start, error, None))

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
        self._losses.append(Loss(SkipCause.WRONG_CHECKSUM, "the data section", detail, lost))
        self._others = _Messages()
        self._only_covered = True

    def _times_ns(self) -> tuple[int | None, int | None]:
        times = [times for each in (self._covered, self._others) if (times := each.times_ns)]
        return min((first for first, _ in times), default=None), max((last for _, last in times), default=None)

    def _all_losses(self, walk: Walk, contents: Contents, written: Written) -> list[Loss]:
        unknown = list(unknown_types(contents))
        counted_all = self._summary.statistics if self._summary and self._summary.is_checked else None
        found = {key: count for key, count in contents.counts.items() if count}
        if counted_all is not None and found == {
            key: count for key, count in counted_all.channel_message_counts.items() if count
        }:
            return unknown
        losses = [*self._losses]
        for place in self._doubtful:
            lapse = written.between(place, (place[0] + 1, NO_CHUNK))
            losses.append(replace(_doubtful_end(place[0]), lapse=lapse))
        for start, error, lost in self._bad_chunks:
            # whatever of a chunk that was cut off is there comes before what is not
            lapse = AT_END if start == walk.cut_chunk else written.between((start, NO_CHUNK), (start + 1, NO_CHUNK))
            losses.append(replace(chunk_loss(start, error, lost, contents.channels), lapse=lapse))
        losses += self._gap_losses(walk, contents, written, sum(each.messages or 0 for each in losses))
        if walk.ends_early is not None:
            losses.append(_ends_early(walk.ends_early, self._file))
        if not losses:
            losses += _missing(self._said_counts(walk), contents)
        return [*losses, *self._after_the_end(walk), *unknown]

    def _said_counts(self, walk: Walk) -> Mapping[int, int]:
        """Return how many messages of each channel the file says that it has; nothing if it does not say."""
        said = self._summary.statistics if self._summary else None
        if said is None and walk.data_end is not None and walk.footer is not None:
            # What comes before the summary may have become shorter or longer, so that it is not where it should be.
            said = statistics_between(self._file, walk.data_end.end, walk.footer.start)
        return said.channel_message_counts if said else {}

    def _gap_losses(self, walk: Walk, contents: Contents, written: Written, named: int) -> list[Loss]:
        """Return what is lost in gaps, beside what was named.

        The indexes that follow a gap are those of the last chunk in it, and there may have been others: what they count
        is believed if what the summary counts says so, too.
        """
        counts = [indexed_counts(self._file, gap.stop) for gap in walk.gaps]
        totals = [count.total() if count else None for count in counts]
        said = self._said_counts(walk)
        short = sum(max(0, count - contents.counts.get(key, 0)) for key, count in said.items())
        is_all = bool(said) and short <= named + sum(total or 0 for total in totals)
        losses = []
        for gap, total in zip(walk.gaps, totals, strict=True):
            detail = f"what should be a record there, of type {gap.opcode}, is none that can be read"
            loss = _damaged(gap.start, gap.stop, detail, total if is_all else None)
            losses.append(replace(loss, lapse=written.between((gap.start, NO_CHUNK), (gap.stop, NO_CHUNK))))
        return losses

    def _after_the_end(self, walk: Walk) -> list[Loss]:
        """Return what is lost if files were put together end to end."""
        if walk.footer is None:
            return []
        end = walk.footer.end + len(MAGIC)
        self._file.file.seek(end)
        if self._file.file.read(len(MAGIC) + 1) != MAGIC + bytes([HEADER]):
            return []
        loss = _damaged(end, self._file.size, "another recording begins there, after the end of this one: split them")
        return [replace(loss, lapse=AT_END)]


def _doubtful_end(start: int) -> Loss:
    detail = "it has no checksum, and not what should follow it, so that bytes of its last message may be missing"
    return Loss(SkipCause.DAMAGED, f"the chunk at byte {start}", detail, 1)


def _damaged(start: int, stop: int, detail: str, messages: int | None = None) -> Loss:
    return Loss(SkipCause.DAMAGED, f"bytes {start} to {stop}", detail, messages)


def _ends_early(end: int, file: RecordFile) -> Loss:
    name = file.path.name
    # what a run of ours left is the only one
    remedy = f"finish it with `replay recover {name}`" if name.endswith(".partial") else COPY_AGAIN
    detail = (
        f"the last whole record ends there, {counted(file.size - end, 'byte')} before the end of the file, and nothing "
        f"closes the recording, as when recording or copying was cut off; {remedy}"
    )
    return Loss(SkipCause.ENDS_EARLY, f"byte {end}", detail, lapse=AT_END)


def indexed_counts(file: RecordFile, start: int) -> Counter[int] | None:
    """Return how many messages of each channel a chunk has, as the indexes say that follow it; None if none do."""
    return indexes_behind(file, start)[0] or None


def indexes_behind(file: RecordFile, start: int) -> tuple[Counter[int], int]:
    """Return how many messages of each channel the message indexes from a byte on list, and where these end."""
    counts: Counter[int] = Counter()
    while (index := file.message_index(start)) is not None:
        counts[index.channel] += index.count
        start = index.end
    return counts, start


def chunk_loss(start: int, error: BadPart, lost: Counter[int] | None, channels: Mapping[int, Channel]) -> Loss:
    """Return what is lost with a chunk."""
    place = f"the chunk at byte {start}"
    if not lost:
        return Loss(error.cause, place, error.detail)
    topics: Counter[str] = Counter()
    for key, count in lost.items():
        topics[channels[key].topic if key in channels else f"channel {key}"] += count
    named = ", ".join(f"{count} of {topic}" for topic, count in topics.most_common(_MOST_NAMED))
    more = " and others" if len(topics) > _MOST_NAMED else ""
    return Loss(
        error.cause,
        place,
        f"{error.detail}; in it are {named}{more}",
        lost.total(),
        next(iter(topics)) if len(topics) == 1 and lost.keys() <= channels.keys() else "",
        tuple(topics) if lost.keys() <= channels.keys() else (),
    )


def unknown_types(contents: Contents) -> list[Loss]:
    """Return which messages are there and cannot be used, because of what is known of their channels."""
    losses = []
    for key, count in sorted(contents.counts.items()):
        channel = contents.channels.get(key)
        if not count:
            continue
        if channel is None:
            losses.append(
                Loss(SkipCause.UNKNOWN_TYPE, f"channel {key}", "no record of the file describes this channel", count)
            )
        elif channel.problem:
            losses.append(Loss(SkipCause.UNKNOWN_TYPE, f"topic {channel.topic}", channel.problem, count, channel.topic))
    return losses


def _missing(counts: Mapping[int, int], contents: Contents) -> list[Loss]:
    """Return of which channels there are fewer messages than the summary counts."""
    losses = []
    for key, count in sorted(counts.items()):
        short = count - contents.counts.get(key, 0)
        topic = contents.channels[key].topic if key in contents.channels else ""
        if short > 0:
            # named, as two channels of which nothing else is known would be taken for one
            whose = "" if topic else f" of channel {key}"
            detail = f"the summary counts {counted(count, 'message')}{whose}, and {count - short} are there"
            losses.append(Loss(SkipCause.DAMAGED, "the data section", detail, short, topic))
    return losses
