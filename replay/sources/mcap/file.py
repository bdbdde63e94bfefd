"""MCAP files of ROS 1, ROS 2 or no profile: ``.mcap``."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

from replay.errors import InputError
from replay.skip_cause import SkipCause
from replay.sources.base import Encoding, RawMessage, SourceInfo
from replay.sources.boundary import TEXT_MODE, Closing, translated
from replay.sources.lapses import lapse_of
from replay.sources.losses import Loss, Losses
from replay.sources.mcap.channels import Channel
from replay.sources.mcap.chunk_reader import ChunkReader, IndexLiesError
from replay.sources.mcap.index import NO_CHUNK, Entry, indexed_entries
from replay.sources.mcap.losses import chunk_loss, unknown_types
from replay.sources.mcap.record_file import RecordFile, indexed_counts, written_bytes
from replay.sources.mcap.records import MAGIC, BadPart, foreign_errors
from replay.sources.mcap.scan import Scan, scan
from replay.sources.mcap.summary import Contents, read_summary
from replay.sources.memory import MOST_BYTES, TooLargeError
from replay.sources.topics import ENCODINGS, topic_table
from replay.sources.zstd import ZstdError, decompressed_cdr

# What is left of the magic bytes after line endings were converted, or bytes that are no text were replaced.
_MAGIC_IN_TEXT_MODE = (b"\x89MCAP0\n", b"\x89MCAP0\r\r\n", b"\xef\xbf\xbdMCAP0")


class McapFile(Closing):
    """An MCAP file, whichever of chunks, compression, indexes and summary it has, whole or not.

    A file whose summary and message indexes are complete is read by them. Any other is read twice: once to find the
    maps, once to read them. So is one whose indexes turn out to be wrong when they are used. What is damaged is left
    out and named.

    Parameters
    ----------
    copy_of
        The file of which ``path`` is a decompressed copy, to be named in errors.
    map_scan
        What the `map_scan` of this same file was when it was open before, so that its maps are not looked for again.
    most_bytes
        The largest message, or decompressed chunk, that is read.

    Attributes
    ----------
    map_scan
        What a pass through the file found of its maps; None as long as no pass was needed.
    """

    encodings: ClassVar[Mapping[str, Encoding]] = ENCODINGS
    """Which encodings of messages are read."""

    def __init__(
        self, path: Path, copy_of: Path | None = None, map_scan: Scan | None = None, most_bytes: int = MOST_BYTES
    ) -> None:
        self.path = copy_of or path
        self.losses = Losses()
        with ExitStack() as stack, translated(self.path, foreign_errors()):
            file = stack.enter_context(path.open("rb"))
            if file.read(len(MAGIC)) != MAGIC:
                raise InputError(f"{self.path}: it begins like an MCAP file {TEXT_MODE}")
            size = path.stat().st_size
            self._file = RecordFile(self.path, file, size, written_bytes(file, size), most_bytes)
            self._summary = read_summary(self._file)
            self.map_scan = map_scan
            self._index_lies = False
            self._contents = self._known_contents()
            self._resources = stack.pop_all()

    @classmethod
    def recognises(cls, path: Path, head: bytes) -> bool:
        """Tell whether this is an MCAP file, readable or not."""
        del path
        return head.startswith((MAGIC, *_MAGIC_IN_TEXT_MODE))

    @property
    def info(self) -> SourceInfo:
        """What the file holds, as far as it is known to be readable.

        Chunks that an index leads to are not looked into before they are needed.
        """
        contents = self._contents
        rows = ((each.topic, each.msgtype, contents.counts.get(key, 0)) for key, each in contents.channels.items())
        return SourceInfo("mcap", contents.start_ns, contents.stop_ns, topic_table(rows))

    def messages(self, topics: Collection[str]) -> Iterator[RawMessage]:
        """Yield the messages of these topics in order of log time, ties in the order in which they were written."""
        with translated(self.path, foreign_errors()):
            done: list[Entry] = []
            entries = self._indexed(topics)
            if entries is not None:
                try:
                    for entry, message in self._read(entries, self._wanted(topics), self._claimed(entries)):
                        done.append(entry)
                        yield message
                except IndexLiesError:
                    self._distrust_index()
                else:
                    return
            known = self._passed_through(topics)
            wanted = self._wanted(topics, known.contents)
            left = self._in_order_after(done, [each for each in known.entries if each.channel in wanted])
            for _, message in self._read(left, wanted, ChunkReader(self._file, left, cut_chunk=known.cut_chunk)):
                yield message

    def latest(self, topics: Collection[str], until_ns: int | None = None) -> RawMessage | None:
        """Return the last message of these topics, up to and with a log time; None if there is none.

        Where the indexes serve, no other message is read, and no chunk but the one it is in.
        """
        with translated(self.path, foreign_errors()):
            entries = self._indexed(topics)
            if entries is not None:
                chosen = [each for each in entries if until_ns is None or each.log_time_ns <= until_ns][-1:]
                try:
                    found = self._read(chosen, self._wanted(topics), self._claimed(chosen))
                    return next((message for _, message in found), None)
                except IndexLiesError:
                    self._distrust_index()
        # of messages that are found by a pass through the file, one is held at a time
        last: RawMessage | None = None
        for message in self.messages(topics):
            if until_ns is not None and message.log_time_ns > until_ns:
                break
            last = message
        return last

    def _claimed(self, entries: Collection[Entry]) -> ChunkReader:
        chunks = self._summary.chunks if self._summary else ()
        begins_ns = {chunk.chunk_start_offset: chunk.message_start_time for chunk in chunks}
        return ChunkReader(self._file, entries, begins_ns)

    def _in_order_after(self, done: Collection[Entry], entries: Collection[Entry]) -> list[Entry]:
        """Return the entries that are not done; those before what is done already are named and left out.

        They would take the place of newer ones. No single wrong index can hide one so long.
        """
        had = {(entry.block, entry.inner) for entry in done}
        reached_ns = max((entry.log_time_ns for entry in done), default=0)
        left = [each for each in entries if (each.block, each.inner) not in had]
        late_ns = [each.log_time_ns for each in left if each.log_time_ns < reached_ns]
        if late_ns:
            detail = "the indexes say wrongly when they were recorded, which was met too late to use them in order"
            loss = Loss(SkipCause.DAMAGED, "the message indexes", detail, len(late_ns), lapse=lapse_of(late_ns))
            self.losses.add(loss)
        return [each for each in left if each.log_time_ns >= reached_ns]

    def close(self) -> None:
        """Close the file."""
        self._resources.close()

    def _known_contents(self) -> Contents:
        """Return what is known of the file, and take in what is known to be lost."""
        contents = self._summary.contents if self._summary else None
        if contents is None or not self._has_index(contents) or self.map_scan is not None:
            return self._scanned().contents
        for loss in unknown_types(contents):
            self.losses.add(loss)
        return contents

    def _has_index(self, contents: Contents) -> bool:
        """Tell whether there is any index of messages, if there are messages."""
        chunks = self._summary.chunks if self._summary else ()
        return contents.start_ns is None or any(chunk.message_index_offsets for chunk in chunks)

    def _wanted(self, topics: Collection[str], contents: Contents | None = None) -> dict[int, Channel]:
        """Return the channels of these topics whose messages can be used."""
        channels = (contents or self._contents).channels
        wanted = {key: each for key, each in channels.items() if each.topic in topics and not each.problem}
        for channel in wanted.values():
            if channel.encoding not in self.encodings:
                raise InputError(
                    f"{self.path}: topic {channel.topic} is encoded as '{channel.encoding}'; "
                    f"{' or '.join(self.encodings)} is read: convert the recording, or choose another topic"
                )
        return wanted

    def _indexed(self, topics: Collection[str]) -> tuple[Entry, ...] | None:
        """Return where the messages of these topics are, sorted, as the indexes say; None if they do not serve."""
        wanted = self._wanted(topics)
        if self._summary is None or self._summary.contents is None or self._index_lies:
            return None
        if self.map_scan is not None and _are_maps(wanted):
            return None
        return indexed_entries(self._file, self._summary, wanted.keys())

    def _passed_through(self, topics: Collection[str]) -> Scan:
        """Return what a pass through the file finds of these topics."""
        if _are_maps(self._wanted(topics)):
            return self._scanned()
        return self._named(scan(self._file, lambda channel: channel.topic in topics, self._summary))

    def _scanned(self) -> Scan:
        """Return what a pass through the file finds of its maps. It is made once, whatever is asked for first."""
        if self.map_scan is None:
            self.map_scan = scan(self._file, lambda channel: channel.is_map, self._summary)
        return self._named(self.map_scan)

    def _named(self, known: Scan) -> Scan:
        for loss in known.losses:
            self.losses.add(loss)
        return known

    def _distrust_index(self) -> None:
        self._index_lies = True
        self._contents = self._scanned().contents

    def _read(
        self, entries: Iterable[Entry], wanted: Mapping[int, Channel], chunks: ChunkReader
    ) -> Iterator[tuple[Entry, RawMessage]]:
        """Yield the messages at these places; what turns out to be damaged is left out and named."""
        times_ns = _times_ns(entries)
        for entry in entries:
            for block in chunks.begun(entry.log_time_ns):
                self._check(chunks, block, times_ns[block])
            try:
                data = chunks.data(entry)
            except BadPart as error:
                self.losses.add(self._chunk_loss(entry.block, error, times_ns[entry.block]))
                continue
            if data is None:
                continue
            channel = wanted[entry.channel]
            encoding = self.encodings[channel.encoding]
            if encoding == "cdr":
                try:
                    data = decompressed_cdr(data, self._file.most_bytes)
                except (ZstdError, TooLargeError) as error:
                    self.losses.add(_bad_message(entry, channel, error))
                    continue
            yield entry, RawMessage(channel.topic, channel.msgtype, encoding, entry.log_time_ns, data)

    def _check(self, chunks: ChunkReader, block: int, times_ns: tuple[int, int]) -> None:
        try:
            chunks.check(block)
        except BadPart as error:
            self.losses.add(self._chunk_loss(block, error, times_ns))

    def _chunk_loss(self, block: int, error: BadPart, times_ns: tuple[int, int]) -> Loss:
        lost = indexed_counts(self._file, self._file.end_of(block))
        return replace(chunk_loss(block, error, lost, self._contents.channels), lapse=lapse_of(times_ns))


def _are_maps(channels: Mapping[int, Channel]) -> bool:
    return all(channel.is_map for channel in channels.values())


def _times_ns(entries: Iterable[Entry]) -> dict[int, tuple[int, int]]:
    """Return the first and last time in each chunk."""
    times_ns: dict[int, tuple[int, int]] = {}
    for entry in entries:
        first_ns, last_ns = times_ns.get(entry.block, (entry.log_time_ns, entry.log_time_ns))
        times_ns[entry.block] = min(first_ns, entry.log_time_ns), max(last_ns, entry.log_time_ns)
    return times_ns


def _bad_message(entry: Entry, channel: Channel, error: Exception) -> Loss:
    inside = "" if entry.inner == NO_CHUNK else f"at byte {entry.inner} of the chunk "
    place, lapse = f"the message {inside}at byte {entry.block}", lapse_of([entry.log_time_ns])
    if isinstance(error, TooLargeError):
        return Loss(SkipCause.OVER_MEMORY, place, str(error), 1, channel.topic, lapse=lapse)
    found = " ".join(str(error).split())
    return Loss(SkipCause.DAMAGED, place, f"it cannot be decompressed ({found})", 1, channel.topic, lapse=lapse)
