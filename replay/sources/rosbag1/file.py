"""ROS 1 bags, version 2.0: ``.bag``, and those that a recorder did not finish: ``.bag.active``."""

from __future__ import annotations

import functools
from collections.abc import Collection, Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path

from replay.errors import InputError
from replay.plain_text import brief
from replay.skip_cause import SkipCause
from replay.sources.base import DECODED_TYPES, RawMessage, SourceInfo
from replay.sources.boundary import COMMON, COPY_AGAIN, TEXT_MODE, Closing, translated
from replay.sources.chunks import ChunkCache
from replay.sources.definitions.difference import differing_field
from replay.sources.lapses import AT_END, lapse_of
from replay.sources.losses import Loss, Losses
from replay.sources.memory import MOST_BYTES
from replay.sources.rosbag1.chunks import Chunk, read_chunk, records_in
from replay.sources.rosbag1.contents import BagFile, Contents, Entry
from replay.sources.rosbag1.index import Index, UnusableIndexError, read_index
from replay.sources.rosbag1.records import BAG_HEADER, CONNECTION, MESSAGE, Record, record_in, record_of
from replay.sources.rosbag1.scan import Scan
from replay.sources.topics import topic_table

_MAGIC = b"#ROSBAG V"
_MAGIC_BEFORE_2_0 = b"#ROSRECORD V"
_MAGIC_2_0 = b"#ROSBAG V2.0\n"
_UNFINISHED = "it has no index, because its recording was not ended properly"
# So many CR bytes, each followed by LF by chance once in 256, come without a single CR LF in 2 of 100 files.
_TELLING_CR_COUNT = 1000


@functools.cache
def _foreign() -> tuple[type[Exception], ...]:
    from rosbags.rosbag1 import ReaderError

    return (*COMMON, ReaderError)


class Rosbag1File(Closing):
    """A ROS 1 bag. Chunks are decompressed one by one, as their messages are asked for.

    rosbags reads its index. If there is none, or it does not fit what it points to, a pass through the file finds the
    messages instead.

    Parameters
    ----------
    copy_of
        The file of which ``path`` is a decompressed copy, to be named in errors.
    most_bytes
        How many bytes a chunk may have, decompressed; larger ones are left out.
    """

    def __init__(self, path: Path, copy_of: Path | None = None, most_bytes: int = MOST_BYTES) -> None:
        self.path = copy_of or path
        self.losses = Losses()
        self._plain = path
        self.most_bytes = most_bytes
        with ExitStack() as stack, translated(self.path, _foreign()):
            file = stack.enter_context(path.open("rb"))
            self._file, header = _begin(self.path, BagFile(file, path.stat().st_size, len(_MAGIC_2_0), 0))
            self._contents = self._read_contents(header)
            self._differing = self._differing_topics()
            self._resources = stack.pop_all()

    @classmethod
    def recognises(cls, path: Path, head: bytes) -> bool:
        """Tell whether this is a ROS 1 bag, readable or not."""
        del path
        return head.startswith((_MAGIC, _MAGIC_BEFORE_2_0))

    @property
    def info(self) -> SourceInfo:
        """What the bag holds."""
        contents, counts = self._contents, self._contents.counts()
        start_ns, stop_ns = contents.times_ns() or (None, None)
        rows = (
            (each.name, self._differing.get(key, each.msgtype), counts.get(key, 0))
            for key, each in contents.topics.items()
        )
        return SourceInfo("rosbag1", start_ns, stop_ns, topic_table(rows))

    def messages(self, topics: Collection[str]) -> Iterator[RawMessage]:
        """Yield the messages of these topics in order of log time, ties in the order in which they were written.

        If the index turns out to be wrong while they are read, those that it hid follow out of order.
        """
        with translated(self.path, _foreign()):
            contents, reading = self._contents, _Reading(self, self._contents)
            try:
                yield from reading.messages(self._entries(contents, topics))
            except _MisfitError as misfit:
                self._distrust_index(contents, misfit)
                rest = [each for each in self._entries(self._contents, topics) if not reading.has_given(each)]
                yield from _Reading(self, self._contents).messages(rest)

    def close(self) -> None:
        """Close the file."""
        self._resources.close()

    def chunk(self, contents: Contents, start: int, wanted: Collection[Entry]) -> Chunk:
        """Return what can be used of a chunk; what cannot is named, unless a pass through the file did so.

        Parameters
        ----------
        wanted
            What the index says to be in it of what is asked for.
        """
        place = contents.chunks[start]
        with translated(self.path, _foreign(), part=place.name):
            chunk = read_chunk(self._file.file, place, self.most_bytes)
        if chunk.problem is not None and isinstance(contents, Index):
            usable = sum(each is not None and each.op == MESSAGE for each in records_in(chunk.records, place))
            lost = max(0, contents.chunk_counts[start] - usable)
            lapse = lapse_of(each.log_time_ns for each in wanted if not _is_there(chunk.records, each))
            self.losses.add(Loss(chunk.problem.cause, place.name, chunk.problem.detail, lost, lapse=lapse))
        return chunk

    def _read_contents(self, header: Record | None) -> Contents:
        """Return what the bag holds, by its index if that can be used."""
        file = self._file
        if header is not None and 0 < file.index_pos <= file.size:
            try:
                return read_index(self._plain, file, header)
            except UnusableIndexError as error:
                return self._scanned(str(error), is_ended=error.is_cut)
        if header is None:
            return self._scanned("its header is damaged")
        reason = f"its index should begin at byte {file.index_pos}" if file.index_pos else _UNFINISHED
        return self._scanned(reason, is_ended=True)

    def _scanned(self, reason: str, *, is_ended: bool = False) -> Scan:
        """Return what a pass through the file finds, and name why it is made."""
        scan = Scan(self._file, self.losses, self.most_bytes)
        if is_ended or scan.is_cut:
            # of one that was never whole there is no other copy
            remedy = "" if reason == _UNFINISHED else f"; {COPY_AGAIN}"
            detail = f"the file ends early: {reason}{remedy}"
            self.losses.add(
                Loss(SkipCause.ENDS_EARLY, f"byte {self._file.size}", detail, scan.lost_at_end, lapse=AT_END)
            )
        else:
            cause = f"{reason}; the file holds not one CR LF, {TEXT_MODE}" if self._lost_line_endings() else reason
            self.losses.add(Loss(SkipCause.DAMAGED, "the index", f"{cause}; messages were found without it", 0))
        return scan

    def _distrust_index(self, contents: Contents, misfit: _MisfitError) -> None:
        """Replace the index, unless another reading has done so, by what a pass through the file finds."""
        if self._contents is contents:
            self._contents = self._scanned(str(misfit))

    def _entries(self, contents: Contents, topics: Collection[str]) -> list[Entry]:
        wanted = {key for key, each in contents.topics.items() if each.name in topics and key not in self._differing}
        return contents.entries(wanted)

    def _differing_topics(self) -> Mapping[int, str]:
        """Return the connections whose messages are not of the standard type, with what they are listed as."""
        found, counts = {}, self._contents.counts()
        for key, each in self._contents.topics.items():
            difference = differing_field(each.msgtype, each.definition, 1) if each.msgtype in DECODED_TYPES else None
            if difference is not None:
                found[key] = f"{each.msgtype} (another definition)"
                loss = Loss(SkipCause.UNKNOWN_TYPE, f"topic {each.name}", difference, counts.get(key, 0), each.name)
                self.losses.add(loss)
        return found

    def _lost_line_endings(self) -> bool:
        """Tell whether the file holds no CR LF although chance alone would have put some there."""
        cr_count, last = 0, b""
        file = self._file.file
        file.seek(0)
        while block := file.read(1 << 20):
            if b"\r\n" in last + block:
                return False
            cr_count += block.count(b"\r")
            last = block[-1:]
        return cr_count >= _TELLING_CR_COUNT


class _MisfitError(Exception):
    """The index points to something else than a message that it describes."""


class _Reading:
    """One reading of a bag's messages.

    Before the first message of a chunk is given, all that are wanted of it are found to be what the index says.
    """

    def __init__(self, bag: Rosbag1File, contents: Contents) -> None:
        self._bag = bag
        self._contents = contents
        # what a pass found was seen to be there
        self._is_scanned = isinstance(contents, Scan)
        self._problems: set[int] = set()
        self._unchecked: dict[int, list[Entry]] = {}
        self._checked: set[int] = set()
        self._last: Entry | None = None

    def messages(self, entries: list[Entry]) -> Iterator[RawMessage]:
        """Yield the messages that these entries point to."""
        if not self._is_scanned:
            for entry in entries:
                self._unchecked.setdefault(entry.chunk, []).append(entry)
        chunks = ChunkCache(self._load, (entry.chunk for entry in entries), self._bag.most_bytes)
        for entry in entries:
            chunk = chunks[entry.chunk]
            if entry.chunk in self._unchecked:
                self._check(chunk, self._unchecked.pop(entry.chunk))
            record = _message_at(chunk, entry)
            # Of a chunk without a problem all were checked.
            is_sure = self._is_scanned or entry.chunk not in self._problems
            if record is None or not (is_sure or _is_followed(chunk, record)):
                # named with the chunk
                continue
            topic = self._contents.topics[entry.connection]
            self._last = entry._replace(inner=record.start)
            yield RawMessage(topic.name, topic.msgtype, "ros1", entry.log_time_ns, chunk[record.data : record.end])

    def has_given(self, entry: Entry) -> bool:
        """Tell whether this message was yielded."""
        return self._last is not None and entry.chunk in self._checked and entry <= self._last

    def _load(self, start: int) -> bytes:
        chunk = self._bag.chunk(self._contents, start, self._unchecked.get(start, ()))
        if chunk.problem is not None:
            self._problems.add(start)
        return chunk.records

    def _check(self, chunk: bytes, entries: list[Entry]) -> None:
        for entry in entries:
            if entry.chunk not in self._problems and not _is_there(chunk, entry):
                raise _MisfitError(
                    f"the index does not fit the chunk at byte {entry.chunk}: it has a message at byte {entry.inner} "
                    "of it that is not there"
                )
        self._checked.add(entries[0].chunk)


def _message_at(chunk: bytes, entry: Entry) -> Record | None:
    """Return the record of a message; None if it is not the one looked for."""
    record = record_in(chunk, entry.inner)
    # Some writers point to the connection record that precedes the first message of a connection.
    while record is not None and record.op == CONNECTION:
        record = record_in(chunk, record.end)
    if record is None or record.op != MESSAGE:
        return None
    is_it = record.number(b"conn") == entry.connection and record.time_ns == entry.log_time_ns
    return record if is_it and record.end <= len(chunk) else None


def _is_there(chunk: bytes, entry: Entry) -> bool:
    record = _message_at(chunk, entry)
    return record is not None and _is_followed(chunk, record)


def _is_followed(chunk: bytes, record: Record) -> bool:
    """Tell whether what follows a record proves that it ends there."""
    return record.end == len(chunk) or record_in(chunk, record.end) is not None


def _begin(path: Path, file: BagFile) -> tuple[BagFile, Record | None]:
    """Return the file with its index's place, and its header if that can be read; refuse other versions."""
    magic = file.file.readline(32)
    version = brief(magic.decode("ascii", "replace").strip())
    if magic.startswith(_MAGIC_BEFORE_2_0):
        raise InputError(
            f"{path}: this bag has the format '{version}' of before 2010; version 2.0 is read: "
            "convert it with the ROS 1 tools, `rosbag fix OLD.bag NEW.bag`"
        )
    if magic.endswith(b"\r\n"):
        raise InputError(f"{path}: its first line ends in CR LF, {TEXT_MODE}")
    if magic != _MAGIC_2_0:
        raise InputError(f"{path}: this bag has the format '{version}'; version 2.0 is read: convert it with `rosbag`")
    header = record_of(file.file, file.start)
    if header is None or header.op != BAG_HEADER:
        return file, None
    encryptor = header.fields.get(b"encryptor", b"").decode("utf-8", "replace")
    if encryptor:
        raise InputError(f"{path}: this bag is encrypted by '{encryptor}'; decrypt it with the ROS 1 tools first")
    return BagFile(file.file, file.size, file.start, header.number(b"index_pos")), header
