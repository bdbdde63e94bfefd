"""A new MCAP from the records of another: the same messages, with an index of their own."""

from __future__ import annotations

import struct

from mcap.records import Attachment, Channel, Header, Metadata, Schema

from replay.sinks.mcap_output import McapOutput
from replay.sinks.partial_file import PartialFile
from replay.sources.mcap.records import MessageHeader

_NO_SCHEMA = 0


class McapCopy(McapOutput):
    """Writes what it is given in the order in which it is given.

    Ids of schemas and channels are given anew: those of a damaged file may stand for two things.
    """

    # numbers of a damaged file may fit no field
    foreign = (*McapOutput.foreign, struct.error)

    def __init__(self, file: PartialFile) -> None:
        super().__init__(file)
        self._schemas: dict[tuple[str, str, bytes], int] = {}
        self._channels: dict[tuple[object, ...], int] = {}
        self._schema_of = {_NO_SCHEMA: _NO_SCHEMA}
        self._channel_of: dict[int, int] = {}

    def start(self, header: Header) -> None:
        """Write the head."""
        with self._errors():
            self._writer.start(header.profile, header.library)

    def schema(self, schema: Schema) -> None:
        """Take in a schema."""
        key = (schema.name, schema.encoding, schema.data)
        with self._errors():
            if key not in self._schemas:
                self._schemas[key] = self._writer.register_schema(*key)
        self._schema_of[schema.id] = self._schemas[key]

    def channel(self, channel: Channel) -> bool:
        """Take in a channel; tell whether its schema is known."""
        if channel.schema_id not in self._schema_of:
            return False
        known = (channel.topic, channel.message_encoding, self._schema_of[channel.schema_id])
        key = (*known, *sorted(channel.metadata.items()))
        with self._errors():
            if key not in self._channels:
                self._channels[key] = self._writer.register_channel(*known, channel.metadata)
        self._channel_of[channel.id] = self._channels[key]
        return True

    def message(self, header: MessageHeader, data: bytes) -> bool:
        """Write a message; tell whether its channel is known."""
        channel = self._channel_of.get(header.channel)
        if channel is None:
            return False
        with self._errors():
            self._writer.add_message(channel, header.log_time_ns, data, header.publish_time_ns, header.sequence)
        return True

    def metadata(self, metadata: Metadata) -> None:
        """Write named values."""
        with self._errors():
            self._writer.add_metadata(metadata.name, metadata.metadata)

    def attachment(self, attachment: Attachment) -> None:
        """Write a file within the file."""
        with self._errors():
            self._writer.add_attachment(
                attachment.create_time,
                attachment.log_time,
                attachment.name,
                attachment.media_type,
                attachment.data,
            )
