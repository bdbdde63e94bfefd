"""What the schemas and channels of an MCAP file say: of which topic and type messages are, and why some cannot be used.

No length is believed before what it says fits: neither that of a record nor those of the texts within it.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

from replay.sources.base import DECODED_TYPES, GRID_TYPE, TF_TYPES, UPDATE_TYPE
from replay.sources.definitions.difference import LARGEST_CHARS, differing_field
from replay.sources.mcap.records import CHANNEL, SCHEMA, Record
from replay.sources.topics import ENCODINGS, normalised_type, type_in

NO_SCHEMA = "its schema is nowhere in the file"

_U16 = struct.Struct("<H")
_U32 = struct.Struct("<I")

_MOST_DESCRIPTION_BYTES = 1 << 24
_MOST_DESCRIPTIONS_BYTES = 1 << 26
_BYTES_A_CHARACTER = 4

_DEFINITION_ENCODINGS = {"ros2msg", "ros1msg", "ros2idl", "omgidl"}


def check_description(record: Record) -> None:
    """Refuse a schema or channel record that is larger than any description, before it is read.

    Raises
    ------
    ValueError
        If it is.
    """
    length = record.end - record.content
    if length > _MOST_DESCRIPTION_BYTES:
        raise ValueError(f"it has {length} bytes, and at most {_MOST_DESCRIPTION_BYTES} are read")


@dataclass(frozen=True, slots=True)
class Channel:
    """A channel with the type of its schema.

    Parameters
    ----------
    problem
        Why its messages cannot be used whatever they hold; "" if nothing speaks against them.
    """

    topic: str
    msgtype: str
    encoding: str
    problem: str = ""

    @property
    def is_map(self) -> bool:
        """Tell whether its messages are maps or updates of maps."""
        return self.msgtype in {GRID_TYPE, UPDATE_TYPE}


class _Schema(NamedTuple):
    name: str
    encoding: str
    definition: bytes


class _Described(NamedTuple):
    topic: str
    encoding: str
    schema: int


_Variant = TypeVar("_Variant", _Schema, _Described)


class ChannelTable:
    """The channels and schemas met so far.

    A record may be there several times, and must then say the same each time. Of those that do not, two are kept:
    enough to tell that none is to be believed.

    Parameters
    ----------
    keeps_records
        Whether the file is copied, so that `record` is asked, and nothing depends on whether messages can be maps; else
        only what tells that is kept, and definitions are held against the standard ones.
    """

    def __init__(self, *, keeps_records: bool = False) -> None:
        self._schemas: dict[int, list[_Schema]] = {0: [_Schema("", "", b"")]}
        self._channels: dict[int, list[_Described]] = {}
        self._keeps_records = keeps_records
        self._records: dict[tuple[int, int], bytes] = {}
        self._held_bytes = 0

    def add(self, opcode: int, content: bytes) -> None:
        """Take the content of a schema or channel record; others are passed over.

        Raises
        ------
        ValueError
            If its fields do not fit it, or more would be held of all such records than any recording needs.
        """
        if opcode == SCHEMA:
            fields = _Fields(content)
            key, name, encoding, definition = fields.number(), fields.text(), fields.text(), fields.block()
            # of other types it is never looked at
            is_used = normalised_type(name) in DECODED_TYPES
            # so much of a longer one that it is seen to be too long
            kept = definition[: _BYTES_A_CHARACTER * LARGEST_CHARS + 1] if is_used else b""
            if key:
                self._hold(self._schemas.setdefault(key, []), _Schema(name, encoding, kept))
                self._keep(opcode, key, content)
        elif opcode == CHANNEL:
            fields = _Fields(content)
            key, schema, topic, encoding = fields.number(), fields.number(), fields.text(), fields.text()
            fields.block()
            self._hold(self._channels.setdefault(key, []), _Described(topic, encoding, schema))
            self._keep(opcode, key, content)

    def _keep(self, opcode: int, key: int, content: bytes) -> None:
        if self._keeps_records:
            self._records.setdefault((opcode, key), content)

    def _hold(self, variants: list[_Variant], variant: _Variant) -> None:
        if variant in variants or len(variants) >= 2:
            return
        self._held_bytes += sum(len(each) for each in variant if isinstance(each, str | bytes))
        if self._held_bytes > _MOST_DESCRIPTIONS_BYTES:
            raise ValueError(f"of all such records, at most {_MOST_DESCRIPTIONS_BYTES} bytes are held")
        variants.append(variant)

    def completed_by(self, other: ChannelTable) -> ChannelTable:
        """Return a table with what this one says and, where it says nothing, what the other one says."""
        both = ChannelTable(keeps_records=self._keeps_records)
        both._schemas = {**other._schemas, **self._schemas}
        both._channels = {**other._channels, **self._channels}
        both._records = {**other._records, **self._records}
        return both

    def record(self, opcode: int, key: int) -> bytes | None:
        """Return the content of the first record of a schema or channel; None if none has been met."""
        return self._records.get((opcode, key))

    def is_ambiguous(self, key: int) -> bool:
        """Tell whether a channel, or its schema, is described in two ways."""
        described = self._channels.get(key, [])
        return len(described) > 1 or any(len(self._schemas.get(each.schema, ())) > 1 for each in described)

    def get(self, key: int) -> Channel | None:
        """Return a channel; None if it has not been met."""
        unknown: list[_Schema | None] = [None]
        variants = {
            _channel(described, schema, is_copied=self._keeps_records)
            for described in self._channels.get(key, ())
            for schema in self._schemas.get(described.schema, unknown)
        }
        if len(variants) <= 1:
            return next(iter(variants), None)
        first = _channel(self._channels[key][0], None, is_copied=self._keeps_records)
        may_matter = any(each.is_map or each.msgtype in TF_TYPES or each.problem for each in variants)
        problem = "the file describes it in two ways" if may_matter else ""
        return Channel(first.topic, "unknown", first.encoding, problem)

    def all(self) -> dict[int, Channel]:
        """Return all channels that have been met, by id."""
        return {key: channel for key in sorted(self._channels) if (channel := self.get(key))}


class _Fields:
    """Takes the fields of a record one after the other.

    Raises
    ------
    ValueError
        If one does not fit into the record, or a text is none.
    """

    def __init__(self, content: bytes) -> None:
        self._content = content
        self._at = 0

    def number(self) -> int:
        return int(_U16.unpack(self._take(_U16.size))[0])

    def block(self) -> bytes:
        return self._take(_U32.unpack(self._take(_U32.size))[0])

    def text(self) -> str:
        return self.block().decode()

    def _take(self, length: int) -> bytes:
        end = self._at + length
        if end > len(self._content):
            raise ValueError(f"a field of {length} bytes does not fit into a record of {len(self._content)}")
        taken, self._at = self._content[self._at : end], end
        return taken


def _channel(described: _Described, schema: _Schema | None, *, is_copied: bool) -> Channel:
    topic, encoding, _ = described
    if schema is None:
        return Channel(topic, type_in(encoding, ""), encoding, NO_SCHEMA)
    msgtype = type_in(encoding, schema.name)
    if msgtype in DECODED_TYPES and schema.encoding in _DEFINITION_ENCODINGS and not is_copied:
        text = schema.definition.decode(errors="replace")
        difference = differing_field(msgtype, text, 1 if encoding == "ros1" else 2)
        if difference is not None:
            return Channel(topic, f"{msgtype} (another definition)", encoding, difference)
    if encoding not in ENCODINGS and normalised_type(schema.name) in {GRID_TYPE, UPDATE_TYPE}:
        problem = f"its maps are encoded as '{encoding}'; {' or '.join(ENCODINGS)} is read: convert the recording"
        return Channel(topic, msgtype, encoding, problem)
    return Channel(topic, msgtype, encoding)
