"""The boundary to the libraries that read recordings: what they raise leaves a source as one clear line."""

from __future__ import annotations

import errno
import os
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import TracebackType
from typing import Self

from replay.errors import InputError

# What is raised below where bytes are not what is expected, or the machine has not what is needed; each source adds
# the classes of its own. OverflowError is that of numbers that no file is as long as. What would sooner be a bug of
# ours than damage is left out: a bug must show itself.
COMMON: tuple[type[Exception], ...] = (OSError, EOFError, ValueError, OverflowError, MemoryError, struct.error)

# What libraries written in Python raise as well where they take bad bytes for good ones. Of our own code these would be
# bugs, so that they are translated around a call of such a library, and nowhere else.
OF_LIBRARIES: tuple[type[Exception], ...] = (LookupError, AssertionError)

TEXT_MODE = (
    "as after a transfer in text mode, which converts line endings: copy it again in binary mode"
    " (Git: mark it `binary` in .gitattributes)"
)

COPY_AGAIN = "copy it again if there is a whole one"

_NO_SPACE = "free space in the temporary folder, or name another in the environment variable TMPDIR"
# The machine's limits, which say nothing about the recording.
_LIMITS = {
    errno.EMFILE: "raise the limit (`ulimit -n`), or give fewer recordings at once",
    errno.ENFILE: "close other programs, or raise the limit of the system",
    # Only temporary copies are written: decompressed, or with what was beside them.
    errno.ENOSPC: _NO_SPACE,
    errno.EDQUOT: _NO_SPACE,
    errno.EFBIG: f"raise the limit (`ulimit -f`), or {_NO_SPACE}",
}


@contextmanager
def translated(path: Path, foreign: tuple[type[Exception], ...] = COMMON, *, part: str = "") -> Iterator[None]:
    """Turn the errors of the libraries below into `InputError` with one line that names the path.

    Parameters
    ----------
    foreign
        The classes to translate; all others pass.
    part
        What was read of the file, where that is known, such as "the chunk at byte 4117".
    """
    try:
        yield
    except foreign as error:
        raise InputError(_line(path, error, part)) from error


def _line(path: Path, error: Exception, part: str) -> str:
    if isinstance(error, PermissionError):
        return f"{_forbidden(path, error)}; make it readable for you and try again"
    if isinstance(error, MemoryError):
        what = f"{part} takes" if part else "it takes"
        advice = "close other programs, or give a smaller --max-memory (of merge and info)"
        return f"{path}: {what} more memory than there is; {advice}"
    if isinstance(error, OSError) and error.errno in _LIMITS:
        return f"{path}: it cannot be read: {error.strerror}; {_LIMITS[error.errno]} and try again"
    if isinstance(error, OSError) and error.strerror:
        return f"{error.filename or path}: {error.strerror}; expected a recording that can be read"
    name, text = type(error).__name__, " ".join(str(error).split())
    found = f"{name}: {text}" if text else name
    what = f"{part} cannot be read" if part else "it cannot be read"
    return f"{path}: {what} ({found}); the recording is damaged or incomplete: copy it again from where it was made"


def _forbidden(path: Path, error: PermissionError) -> str:
    """Return what may not be read: a file, or the outermost folder around it that may not be entered."""
    found = Path(os.fsdecode(error.filename)) if isinstance(error.filename, str | bytes) else path
    # unlike Path's own this one is False of what lies in a closed folder
    closed = [folder for folder in found.parents if os.path.isdir(folder) and not os.access(folder, os.X_OK)]  # noqa: PTH112
    return f"{closed[-1]}: permission to enter this folder denied" if closed else f"{found}: permission denied"


class Closing:
    """Makes a context manager of a source that has a `close`."""

    path: Path

    @property
    def files(self) -> tuple[Path, ...]:
        """The files that are read; a folder stands for all that is in it."""
        return (self.path,)

    def close(self) -> None:
        """Release files and temporary copies."""
        raise NotImplementedError

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
