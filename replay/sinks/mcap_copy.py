"""A new MCAP from the records of another: the same messages, with an index of their own."""

from __future__ import annotations

import struct
from contextlib import AbstractContextManager, suppress

from mcap.exceptions import McapError
from mcap.records import Attachment, Channel, Header, Metadata, Schema
from mcap.writer import CompressionType, Writer
from zstandard import ZstdError

from replay.sinks.partial_file import PartialFile, output_errors
from replay.sources.mcap_records import MessageHeader

_CHUNK_BYTES = 4 << 20
_NO_SCHEMA = 0


class McapCopy:
    """Writes what it is given in the order in which it is given.

    Ids of schemas and channels are given anew: those of a damaged file may stand for two things.
    """

    def __init__(self, file: PartialFile) -> None:
        self._file = file
        with self._errors():
            self._stream = file.stream()
        self._writer = Writer(self._stream, chunk_size=_CHUNK_BYTES, compression=CompressionType.ZSTD)
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

    def finish(self) -> None:
        """Write the index; the file is whole after this, and on the disk."""
        with self._errors():
            self._writer.finish()  # type: ignore[no-untyped-call]
            self._stream.close()
        self._file.sync()

    def publish(self) -> None:
        """Give the file its final name."""
        self._file.publish()

    def discard(self) -> None:
        """Remove the file."""
        with suppress(OSError):  # the disk may be full of what is still to be written
            self._stream.close()
        self._file.discard()

    def _errors(self) -> AbstractContextManager[None]:
        return output_errors(self._file.path, McapError, ZstdError, struct.error)
