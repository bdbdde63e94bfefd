"""The records of an MCAP from its beginning to where they end, whatever became of its index."""

from __future__ import annotations

import zlib
from collections import Counter
from collections.abc import Iterator

from mcap.records import Attachment, Channel, Header, Metadata, Schema

from replay.errors import InputError
from replay.sinks.mcap_copy import McapCopy
from replay.skip_cause import SkipCause
from replay.sources.boundary import translated
from replay.sources.mcap_chunk import BadPart, chunk_content, inner_records
from replay.sources.mcap_records import (
    CHANNEL,
    CHUNK,
    FOOTER,
    MAGIC,
    MESSAGE,
    SCHEMA,
    MessageHeader,
    Record,
    RecordFile,
    foreign_errors,
    message_data,
    message_header_at,
    parser_stream,
)
from replay.words import counted

HEADER, ATTACHMENT, METADATA, DATA_END = 0x01, 0x09, 0x0C, 0x0F

_HEAD_BYTES = 9
_CRC_BYTES = 4

_PARSERS: dict[int, type[Schema | Channel | Metadata | Attachment]] = {
    SCHEMA: Schema,
    CHANNEL: Channel,
    METADATA: Metadata,
    ATTACHMENT: Attachment,
}
_Item = Schema | Channel | Metadata | Attachment | tuple[MessageHeader, bytes]


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
        """Give a new file what a record says; what cannot be read is left out, what cannot be written is an error."""
        part = f"the record at byte {record.start}"
        try:
            with translated(self._records.path, foreign_errors(), part=part):
                items = list(self._items(record))
        except InputError as error:
            self._left_out.append(str(error))
            return
        for item in items:
            self._give(item, copy)

    def _items(self, record: Record) -> Iterator[_Item]:
        """Yield what a record says: of a chunk, all the records in it."""
        if record.opcode == CHUNK:
            chunk = self._chunk(record.start)
            for inner in inner_records(chunk):
                if inner.opcode in {SCHEMA, CHANNEL, MESSAGE}:
                    yield self._item(chunk[inner.start : inner.end], inner.opcode)
        elif record.opcode == MESSAGE or record.opcode in _PARSERS:
            if record.end - record.start > self._records.most_bytes:
                raise self._too_large(f"the record at byte {record.start}")
            yield self._item(self._records.record_bytes(record.start), record.opcode)

    def _chunk(self, start: int) -> bytes:
        try:
            return chunk_content(self._records, start)[0]
        except BadPart as error:
            if error.cause == SkipCause.OVER_MEMORY:
                raise self._too_large(f"the chunk at byte {start}") from error
            raise InputError(f"{self._records.path}: the chunk at byte {start} is damaged: {error.detail}") from error

    def _too_large(self, part: str) -> InputError:
        path, most_bytes = self._records.path, self._records.most_bytes
        return InputError(f"{path}: {part} has more than {most_bytes} bytes, the most that is read at once")

    def _item(self, record: bytes, opcode: int) -> _Item:
        if opcode == MESSAGE:
            header, data = message_header_at(record, 0), message_data(record, 0)
            if header is None or data is None:
                raise InputError(f"{self._records.path}: a message of {len(record)} bytes is too short to be one")
            return header, data
        content = record[_HEAD_BYTES:]
        if opcode == ATTACHMENT:
            self._check_attachment(content)
        item: _Item = _PARSERS[opcode].read(parser_stream(content))
        return item

    def _check_attachment(self, content: bytes) -> None:
        checksum = int.from_bytes(content[-_CRC_BYTES:], "little")
        if checksum not in {0, zlib.crc32(content[:-_CRC_BYTES])}:
            raise InputError(f"{self._records.path}: the checksum (CRC) of an attachment is wrong")

    def _give(self, item: _Item, copy: McapCopy) -> None:
        match item:
            case Schema():
                copy.schema(item)
            case Channel():
                if not copy.channel(item):
                    self._left_out.append(f"{item.topic}: its schema, {item.schema_id}, is lost")
            case Metadata():
                copy.metadata(item)
            case Attachment():
                copy.attachment(item)
            case (header, data):
                self._message(header, data, copy)

    def _message(self, header: MessageHeader, data: bytes, copy: McapCopy) -> None:
        if not copy.message(header, data):
            self._lost[header.channel] += 1
            return
        self.messages += 1
        self.until_ns = max(self.until_ns, header.log_time_ns)
