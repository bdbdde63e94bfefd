"""What is whole of an MCAP, whatever became of the rest: the messages that a source would read, of all topics."""

from __future__ import annotations

import zlib
from collections import Counter
from collections.abc import Iterator
from typing import Protocol, TypeVar

from mcap.data_stream import ReadDataStream
from mcap.records import Attachment, Channel, Header, Metadata, Schema

from replay.errors import InputError
from replay.sinks.mcap_copy import McapCopy
from replay.skip_cause import SkipCause
from replay.sources.boundary import OF_LIBRARIES
from replay.sources.losses import Loss
from replay.sources.mcap.channels import NO_SCHEMA
from replay.sources.mcap.chunk import chunk_content, cut_chunk_content, inner_records
from replay.sources.mcap.record_file import RecordFile
from replay.sources.mcap.records import (
    ATTACHMENT,
    CHANNEL,
    CHUNK,
    HEADER,
    MAGIC,
    MESSAGE,
    MESSAGE_HEAD,
    METADATA,
    SCHEMA,
    BadPart,
    MessageHeader,
    Record,
    foreign_errors,
    message_header,
    parser_stream,
)
from replay.sources.mcap.scan import Scan, scan
from replay.sources.mcap.summary import read_summary
from replay.sources.mcap.walk import Gap, Walk
from replay.sources.memory import MORE_ALLOWED
from replay.words import counted

_CRC_BYTES = 4
_U16_BYTES = 2
_Read_co = TypeVar("_Read_co", covariant=True)


class _Parser(Protocol[_Read_co]):
    """A record of the mcap package."""

    def read(self, stream: ReadDataStream, /) -> _Read_co:
        """Return what a record's content says."""


class Salvage:
    """Takes what is whole of a file, and notes what is left out.

    The file is passed through twice: once to tell what is whole and what describes the channels, wherever that is, and
    once to copy the messages. One chunk is in memory at a time.
    """

    def __init__(self, file: RecordFile) -> None:
        self._file = file
        self._lost: Counter[int] = Counter()
        self._left_out: list[str] = []
        # channels of which the description before each message counts, because there are several
        self._ambiguous: set[int] = set()
        self.messages = 0
        self.until_ns = 0
        self.is_whole = False

    def to(self, copy: McapCopy) -> None:
        """Give a new file what is whole.

        Raises
        ------
        InputError
            If that is no message at all.
        """
        summary = read_summary(self._file, keeps_records=True)
        found = scan(self._file, None, summary, keeps_records=True)
        # what is of an unknown type can be copied all the same
        losses = [loss for loss in found.losses if loss.cause != SkipCause.UNKNOWN_TYPE]
        self.is_whole = all(loss.cause != SkipCause.ENDS_EARLY for loss in losses)
        self._left_out += [_in_words(loss) for loss in losses if loss.cause != SkipCause.ENDS_EARLY]
        copy.start(self._header())
        self._describe(found, copy)
        walk = Walk(self._file, summary.places if summary else ())
        for record in walk:
            self._take(record, walk, found, copy)
        if found.cut_chunk is not None and found.cut_chunk not in found.bad_chunks and not found.only_covered:
            self._take_content(cut_chunk_content(self._file, found.cut_chunk), copy)
        if not losses:
            self._left_out += map(_costless, walk.gaps)
        if not self.is_whole:
            self._left_out += self._cut_off(walk)
        self._left_out += self._lost_of_channels(found)
        if not self.messages:
            first = f": left out is {self._left_out[0]}" if self._left_out else ""
            path = self._file.path
            raise InputError(f"{path}: there is no whole message in it, so there is nothing to recover{first}")

    @property
    def left_out(self) -> tuple[str, ...]:
        """What is not in the copy, and why."""
        return tuple(self._left_out)

    def _header(self) -> Header:
        """Return the head of the file; an empty one if it is damaged, for nothing depends on what it says."""
        record = self._file.record_at(len(MAGIC))
        if record is not None and record.opcode == HEADER and record.end - record.start <= self._file.most_bytes:
            header: Header | None = self._parsed(Header, record, "its head")
            if header is not None:
                return header
        else:
            self._left_out.append("its head, which is not whole")
        return Header(profile="", library="")

    def _describe(self, found: Scan, copy: McapCopy) -> None:
        """Give the new file all schemas and channels, but those that are described in two ways."""
        for key, channel in found.contents.channels.items():
            if found.table.is_ambiguous(key):
                # of maps and transforms none is believed, so that what is made of them is not merged
                if not channel.problem:
                    self._ambiguous.add(key)
                continue
            content = found.table.record(CHANNEL, key)
            read = self._read(Channel, content, f"channel {key}") if content is not None else None
            if read is None:
                continue
            schema = found.table.record(SCHEMA, read.schema_id)
            if schema is not None and (known := self._read(Schema, schema, f"schema {read.schema_id}")) is not None:
                copy.schema(known)
            copy.channel(read)

    def _take(self, record: Record, walk: Walk, found: Scan, copy: McapCopy) -> None:
        """Give a new file what a record says; what cannot be read is left out, what cannot be written is an error."""
        if record.opcode == CHUNK:
            if record.start not in found.bad_chunks:
                self._take_chunk(record, found, copy)
        elif record.end - record.start > self._file.most_bytes:
            if record.opcode in {METADATA, ATTACHMENT}:
                self._left_out.append(
                    f"the record at byte {record.start}: it has more than {self._file.most_bytes} bytes"
                )
        elif record.opcode == MESSAGE:
            if not found.only_covered:
                content = self._content(record)
                self._give(message_header(content), content[MESSAGE_HEAD.size :], copy)
        elif record.opcode in {SCHEMA, CHANNEL}:
            if self._ambiguous and walk.data_end is None:
                self._describe_again(record.opcode, self._content(record), copy)
        else:
            self._take_other(record, copy)

    def _take_other(self, record: Record, copy: McapCopy) -> None:
        """Give a new file what is neither a message nor needed for any."""
        if record.opcode == METADATA:
            metadata = self._parsed(Metadata, record, f"the metadata at byte {record.start}")
            if metadata is not None:
                copy.metadata(metadata)
        elif record.opcode == ATTACHMENT:
            self._take_attachment(record, copy)

    def _take_content(self, content: bytes, copy: McapCopy) -> None:
        """Give a new file the messages of a chunk."""
        for record in inner_records(content):
            if record.opcode == MESSAGE:
                data = content[record.content + MESSAGE_HEAD.size : record.end]
                self._give(message_header(content, record.content), data, copy)
            elif self._ambiguous and record.opcode in {SCHEMA, CHANNEL}:
                self._describe_again(record.opcode, content[record.content : record.end], copy)

    def _describe_again(self, opcode: int, content: bytes, copy: McapCopy) -> None:
        """Let what describes an ambiguous channel count for the messages that follow."""
        if opcode == SCHEMA:
            schema = self._read(Schema, content, "a schema")
            if schema is not None:
                copy.schema(schema)
        elif int.from_bytes(content[:_U16_BYTES], "little") in self._ambiguous:
            channel = self._read(Channel, content, "a channel")
            if channel is not None:
                copy.channel(channel)

    def _give(self, header: MessageHeader, data: bytes, copy: McapCopy) -> None:
        if not copy.message(header, data):
            self._lost[header.channel] += 1
            return
        self.messages += 1
        self.until_ns = max(self.until_ns, header.log_time_ns)

    def _take_attachment(self, record: Record, copy: McapCopy) -> None:
        place = f"the attachment at byte {record.start}"
        attachment = self._parsed(Attachment, record, place)
        if attachment is None:
            return
        content = self._content(record)
        checksum = int.from_bytes(content[-_CRC_BYTES:], "little")
        if checksum not in {0, zlib.crc32(memoryview(content)[:-_CRC_BYTES])}:
            self._left_out.append(f"{place}: its checksum (CRC) is wrong")
            return
        copy.attachment(attachment)

    def _take_chunk(self, record: Record, found: Scan, copy: McapCopy) -> None:
        try:
            content, is_covered = chunk_content(self._file, record.start)
        except BadPart as error:
            raise self._changed() from error
        if is_covered or not found.only_covered:
            self._take_content(content, copy)

    def _content(self, record: Record) -> bytes:
        content = self._file.content(record)
        if len(content) != record.end - record.content:
            raise self._changed()
        return content

    def _changed(self) -> InputError:
        return InputError(f"{self._file.path}: it changed while it was read; wait until nobody writes it any more")

    def _parsed(self, parser: _Parser[_Read_co], record: Record, place: str) -> _Read_co | None:
        """Return what a record says; None if it is left out."""
        return self._read(parser, self._content(record), place)

    def _read(self, parser: _Parser[_Read_co], content: bytes, place: str) -> _Read_co | None:
        try:
            return parser.read(parser_stream(content))
        except _of_damage() as error:
            found = " ".join(str(error).split())
            self._left_out.append(f"{place}: it cannot be read ({type(error).__name__}: {found})")
            return None

    def _cut_off(self, walk: Walk) -> Iterator[str]:
        """Yield what there is of the record at which the file was cut off, if that is not between two records."""
        if walk.cut_chunk is not None:
            yield f"the end of the chunk at byte {walk.cut_chunk}, at which the file was cut off"
        elif walk.ends_early is not None and walk.ends_early < self._file.size:
            yield f"the last {counted(self._file.size - walk.ends_early, 'byte')}, which are no whole record"

    def _lost_of_channels(self, found: Scan) -> Iterator[str]:
        for key, count in sorted(self._lost.items()):
            channel = found.contents.channels.get(key)
            topic = f", {channel.topic}" if channel else ""
            why = "which is described in two ways" if found.table.is_ambiguous(key) else "whose description is lost"
            why = "whose schema is lost" if channel and channel.problem == NO_SCHEMA else why
            yield f"{counted(count, 'message')} of channel {key}{topic}, {why}"


def _of_damage() -> tuple[type[Exception], ...]:
    """Return what the mcap package raises where bytes are not what is expected."""
    others = (OSError, MemoryError)
    return tuple(each for each in (*foreign_errors(), *OF_LIBRARIES) if each not in others)


def _in_words(loss: Loss) -> str:
    return f"{loss.place}: {loss.detail.replace(MORE_ALLOWED, '')}"


def _costless(gap: Gap) -> str:
    return f"bytes {gap.start} to {gap.stop}: they are no record that can be read; no message is lost with them"
