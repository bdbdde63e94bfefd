"""Where the Rerun library's bytes go: through a pipe to a file that is written here.

When a thread of the library fails to write, on a full disk say, whatever waits for it waits for ever, and sometimes the
process is aborted. Here the library writes to a pipe, which never fails, and what goes wrong with the file is an
error like any other.
"""

from __future__ import annotations

import os
from pathlib import Path
from threading import Thread
from typing import BinaryIO, Protocol

from replay.sinks.partial_file import DESCRIPTORS, PartialFile

_READ_BYTES = 1 << 20


class Outlet(Protocol):
    """A path for the library to write to, and what becomes of what it writes."""

    path: Path

    def opened(self) -> None:
        """Take note that the library has opened the path."""

    def written_bytes(self) -> int:
        """Return how much was taken from the library so far."""

    def check(self) -> None:
        """Raise the `OSError` that what was written met, if any."""

    def close(self) -> None:
        """Wait until all is in the file, once the library has closed the path."""


def outlet_to(file: PartialFile) -> Outlet:
    """Return the way to a file: a pipe, where pipes have paths."""
    return _Pipe(file.stream()) if DESCRIPTORS.is_dir() else _Direct(file.partial)


class _Direct:
    """The file itself."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def opened(self) -> None:
        pass

    def written_bytes(self) -> int:
        return self.path.stat().st_size

    def check(self) -> None:
        pass

    def close(self) -> None:
        pass


class _Pipe:
    """A pipe whose other end a thread copies to the file; all is taken from it even if the file takes no more."""

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self._error: Exception | None = None
        self._written_bytes = 0
        self._reading, self._writing = os.pipe()
        self._is_opened = False
        self.path = DESCRIPTORS / str(self._writing)
        self._thread = Thread(target=self._copy, name="rrd", daemon=True)
        self._thread.start()

    def opened(self) -> None:
        if not self._is_opened:
            self._is_opened = True
            os.close(self._writing)

    def written_bytes(self) -> int:
        return self._written_bytes

    def check(self) -> None:
        if self._error is not None:
            raise self._error

    def close(self) -> None:
        self.opened()  # or, if it never was, nobody would close this end
        self._thread.join()

    def _copy(self) -> None:
        while data := os.read(self._reading, _READ_BYTES):
            try:
                if self._error is None:
                    self._stream.write(data)
                    self._stream.flush()
            except Exception as error:  # noqa: BLE001 - it is raised again by `check`
                self._error = error
            self._written_bytes += len(data)
        os.close(self._reading)
        self._end()

    def _end(self) -> None:
        try:
            self._stream.close()
        except OSError as error:  # what could not be written before cannot be now
            self._error = self._error or error
