"""What the records of MCAP files look like: whether what is at a byte can be one, by its length and its fields."""

from __future__ import annotations

from struct import Struct

from replay.sources.mcap.chunk import CHUNK_HEAD_BYTES, is_consistent
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
)

_MOST_CLOSING = 4

_U32 = Struct("<I")
_U64 = Struct("<Q")

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
KNOWN = {*_SHAPES, FOOTER, CHUNK, MESSAGE_INDEX, DATA_END}
# What they say of themselves leaves no doubt.
SURE = {CHUNK, MESSAGE_INDEX, DATA_END, FOOTER}


class Shapes:
    """The records of a file as they are at a glance: by how their content begins."""

    def __init__(self, file: RecordFile) -> None:
        self.file = file
        self._looked_at: tuple[int, tuple[Record, bytes] | None] = (-1, None)

    def is_magic(self, start: int) -> bool:
        """Tell whether the magic bytes are at a byte."""
        if start > self.file.size:
            return False
        self.file.file.seek(start)
        return self.file.file.read(len(MAGIC)) == MAGIC

    def head(self, start: int) -> tuple[Record, bytes] | None:
        """Return what is at a byte as a record; what was looked at last is not read again."""
        if self._looked_at[0] != start:
            self._looked_at = start, self.file.head_at(start, CHUNK_HEAD_BYTES)
        return self._looked_at[1]

    def is_plausible(self, record: Record, head: bytes) -> bool:
        """Tell whether the fields of a record fit its length."""
        length = record.end - record.content
        if record.opcode == CHUNK:
            return is_consistent(record, head)
        if record.opcode == MESSAGE_INDEX:
            return length % 16 == 6 and _number(head, 2) == length - 6
        if record.opcode == DATA_END:
            return length == 4
        if record.opcode == FOOTER:
            return length == 20 and self.is_magic(record.end)
        least, text_at = _SHAPES[record.opcode]
        return length >= least and (text_at is None or _number(head, text_at) <= length - least)

    def is_filled(self, record: Record) -> bool:
        """Tell whether the three texts of a schema or channel take up all of it."""
        at = record.content + (_SHAPES[record.opcode][1] or 0)
        for _ in range(3):
            if at + _U32.size > record.end:
                return False
            self.file.file.seek(at)
            at += _U32.size + _number(self.file.file.read(_U32.size), 0)
        return at == record.end

    def closes(self, start: int) -> bool:
        """Tell whether the data section may end at this byte."""
        if start == self.file.size:
            return True
        found = self.head(start)
        if found and found[0].opcode == FOOTER:
            return self.is_plausible(*found)
        footer = self.file.head_at(self.file.size - len(MAGIC) - RECORD.size - 20, 20)
        if footer and footer[0].opcode == FOOTER and _U64.unpack_from(footer[1])[0] == start:
            return True
        for _ in range(_MOST_CLOSING):
            found = self.head(start)
            if found is None or not self.file.is_whole(found[0]) or found[0].opcode not in KNOWN - {DATA_END}:
                return False
            if not self.is_plausible(*found):
                return False
            start = found[0].end
        return True


def _number(head: bytes, at: int) -> int:
    """Return the number in 32 bits at a byte of a record's content; more than fits anything if it is not there."""
    return int(_U32.unpack_from(head, at)[0]) if at + _U32.size <= len(head) else 1 << 64
