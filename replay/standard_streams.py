"""Standard output and standard error: open, whatever they lead to, and fit for any character."""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any, TextIO, cast

from replay.errors import OutputError
from replay.plain_text import ascii_json, ascii_toml

_LAST_STANDARD = 2


def prepare() -> None:
    """Open those that are closed, and let characters that the encoding lacks be escaped."""
    with suppress(OSError):
        _open_closed()
    sys.stdout = _prepared(cast("TextIO | None", sys.stdout))
    sys.stderr = _prepared(cast("TextIO | None", sys.stderr))


def _open_closed() -> None:
    """Let no file of a run get the number of a standard stream: what libraries print would be written into it."""
    while (descriptor := os.open(os.devnull, os.O_RDWR)) <= _LAST_STANDARD:
        pass
    os.close(descriptor)


def _prepared(stream: TextIO | None) -> TextIO:
    if stream is None:  # it was closed when Python began
        return Path(os.devnull).open("w", encoding="utf-8")
    if isinstance(stream, io.TextIOWrapper):
        stream.reconfigure(errors="backslashreplace")
    return stream


@contextmanager
def printing() -> Iterator[None]:
    """Say of standard output that cannot be written, to a full disk say, that it is not there.

    If whoever read it has gone, nothing is said: that is how pipes end.

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    try:
        yield
        sys.stdout.flush()
    except BrokenPipeError:
        _drop(sys.stdout)
    except OSError as error:
        _drop(sys.stdout)
        raise OutputError(f"standard output: cannot be written: {error.strerror}") from error


def takes(text: str) -> bool:
    """Tell whether standard output has all characters of a text."""
    try:
        text.encode(getattr(sys.stdout, "encoding", None) or "utf-8")
    except UnicodeEncodeError:
        return False
    return True


def write_json(text: str) -> None:
    r"""Write JSON to standard output; if that lacks a character, all beyond ASCII as \u escapes, which readers undo."""
    sys.stdout.write(text if takes(text) else ascii_json(text))


def write_toml(text: str) -> None:
    r"""Write TOML to standard output; if that lacks a character, all beyond ASCII as \U escapes, which readers undo."""
    sys.stdout.write(text if takes(text) else ascii_toml(text))


def quiet_stderr() -> IO[str]:
    """Return standard error as a stream that falls silent where it cannot be written: no run fails by what it says."""
    return cast("IO[str]", _Quiet(sys.stderr))


def say(line: str) -> None:
    """Print a line on standard error, if it can be written."""
    print(line, file=quiet_stderr())


class _Quiet:
    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        try:
            return self._stream.write(text)
        except OSError:
            _drop(self._stream)
            return len(text)

    def flush(self) -> None:
        try:
            self._stream.flush()
        except OSError:
            _drop(self._stream)

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - all else is the stream's
        return getattr(self._stream, name)


def _drop(stream: TextIO) -> None:
    """Let the stream lead nowhere, also for what waits to be written: Python would complain of that at the end."""
    with suppress(OSError):
        descriptor = os.open(os.devnull, os.O_WRONLY)
        try:
            os.dup2(descriptor, stream.fileno())
        finally:
            os.close(descriptor)
