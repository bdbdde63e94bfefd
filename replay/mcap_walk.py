"""The records of an MCAP from its beginning to where they end, whatever became of its index."""

from __future__ import annotations

import zlib
from collections import Counter
from collections.abc import Callable

from mcap.records import Attachment, Channel, Header, Metadata, Schema

from replay.errors import InputError
from replay.sinks.mcap_copy import McapCopy
from replay.sources.boundary import translated
from replay.sources.mcap_chunk import BadPart, chunk_content, inner_records
from replay.sources.mcap_records import (
    CHANNEL,
    CHUNK,
    FOOTER,
    MAGIC,
    MESSAGE,
    SCHEMA,
    Record,
    RecordFile,
    foreign_errors,
    message_at,
    parser_stream,
)
from replay.words import counted

HEADER, ATTACHMENT, METADATA, DATA_END = 0x01, 0x09, 0x0C, 0x0F

_CRC_BYTES = 4


class Walk:
    """Takes the records of a file in order, and notes what is left out.

    A chunk that is cut off is left out as a whole: nothing can vouch for the part of it that is there, for its checksum
    is that of all of it.
    """

    def __init__(self, records: RecordFile) -> None:
        self._records = records
        self._lost: Counter[int] = Counter()
        self._left_out: list[str] = []
        self.messages = 0
        self.until_ns = 0
        self.is_whole = False

    @property
    def left_out(self) -> tuple[str, ...]:
        """What is not in the copy, and why."""
        lost = (
            f"{counted(count, 'message')} of channel {channel}, whose description is lost"
            for channel, count in sorted(self._lost.items())
        )
        return (*self._left_out, *lost)

    def to(self, copy: McapCopy) -> None:
        """Give a new file what is whole.

        Raises
        ------
        InputError
            If that is no message at all.
        """
        start = self._head(copy)
        while record := self._records.record_at(start):
            if record.opcode in {DATA_END, FOOTER}:  # what follows says again what was said, or where it is
                self.is_whole = True
                break
            self._take(record, copy)
            start = record.end
        if not self.is_whole and start < self._records.size:
            self._left_out.append(f"the last {self._records.size - start} bytes, which are no whole record")
        if not self.messages:
            raise InputError(f"{self._records.path}: there is no whole message in it, so there is nothing to recover")

    def _head(self, copy: McapCopy) -> int:
        """Give a new file the head of this one; return where that ends."""
        record = self._records.record_at(len(MAGIC))
        if record is None or record.opcode != HEADER:
            raise InputError(f"{self._records.path}: its head is not whole, so there is nothing to recover")
        with translated(self._records.path, foreign_errors(), part="its head"):
            copy.start(Header.read(parser_stream(self._records.content(record))))
        return record.end

    def _take(self, record: Record, copy: McapCopy) -> None:
        part = f"the record at byte {record.start}"
        try:
            with translated(self._records.path, foreign_errors(), part=part):
                if record.opcode == CHUNK:
                    self._chunk(record, copy)
                elif record.opcode in _READERS:
                    _READERS[record.opcode](self, self._records.content(record), copy)
                elif record.opcode == MESSAGE:
                    self._message(self._records.record_bytes(record.start), 0, copy)
        except InputError as error:
            self._left_out.append(str(error))

    def _chunk(self, chunk: Record, copy: McapCopy) -> None:
        try:
            content, _ = chunk_content(self._records, chunk.start)
        except BadPart as error:
            raise InputError(f"{self._records.path}: the chunk at byte {chunk.start} is damaged: {error.detail}") from error
        for record in inner_records(content):
            if record.opcode == MESSAGE:
                self._message(content, record.start, copy)
            elif record.opcode in {SCHEMA, CHANNEL}:
                _READERS[record.opcode](self, content[record.content : record.end], copy)

    def _message(self, container: bytes, start: int, copy: McapCopy) -> None:
        found = message_at(container, start)
        if found is None:
            raise InputError(f"{self._records.path}: a message at byte {start} of its chunk is too short to be one")
        header, data = found
        if not copy.message(header, data):
            self._lost[header.channel] += 1
            return
        self.messages += 1
        self.until_ns = max(self.until_ns, header.log_time_ns)

    def _schema(self, content: bytes, copy: McapCopy) -> None:
        copy.schema(Schema.read(parser_stream(content)))

    def _channel(self, content: bytes, copy: McapCopy) -> None:
        channel = Channel.read(parser_stream(content))
        if not copy.channel(channel):
            self._left_out.append(f"{channel.topic}: its schema, {channel.schema_id}, is lost")

    def _metadata(self, content: bytes, copy: McapCopy) -> None:
        copy.metadata(Metadata.read(parser_stream(content)))

    def _attachment(self, content: bytes, copy: McapCopy) -> None:
        attachment = Attachment.read(parser_stream(content))
        checksum = int.from_bytes(content[-_CRC_BYTES:], "little")
        if checksum not in {0, zlib.crc32(content[:-_CRC_BYTES])}:
            raise InputError(f"{self._records.path}: the checksum (CRC) of the attachment {attachment.name} is wrong")
        copy.attachment(attachment)


_READERS: dict[int, Callable[[Walk, bytes, McapCopy], None]] = {
    SCHEMA: Walk._schema,  # noqa: SLF001 - a table of this class's own
    CHANNEL: Walk._channel,  # noqa: SLF001
    METADATA: Walk._metadata,  # noqa: SLF001
    ATTACHMENT: Walk._attachment,  # noqa: SLF001
}
