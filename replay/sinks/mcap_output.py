"""An MCAP on its way to its final name: the writer of it, and what becomes of its file."""

from __future__ import annotations

from contextlib import AbstractContextManager, suppress
from typing import ClassVar

from mcap.exceptions import McapError
from mcap.writer import CompressionType, Writer
from zstandard import ZstdError

from replay.sinks.partial_file import PartialFile, output_errors

_CHUNK_BYTES = 4 << 20


class McapOutput:
    """What all that write an MCAP share."""

    foreign: ClassVar[tuple[type[Exception], ...]] = (McapError, ZstdError)
    """What may be raised below where something is written."""

    def __init__(self, file: PartialFile) -> None:
        self._file = file
        with self._errors():
            self._stream = file.stream()
        self._writer = Writer(self._stream, chunk_size=_CHUNK_BYTES, compression=CompressionType.ZSTD)

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
        return output_errors(self._file.path, *self.foreign)
