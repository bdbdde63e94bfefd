"""A file that has its final name only once it is whole."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from replay.errors import OutputError


class PartialFile:
    """Names a file while it is written, and renames it when it is whole.

    Parameters
    ----------
    path
        The final name. The temporary one has ``.partial`` behind it, in the same folder, so that renaming is atomic.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.partial = path.with_name(f"{path.name}.partial")

    def publish(self) -> None:
        """Give the file its final name, replacing what has it."""
        with output_errors(self.path):
            self.partial.replace(self.path)

    def discard(self) -> None:
        """Remove the file if it still has its temporary name."""
        with suppress(OSError):
            self.partial.unlink(missing_ok=True)


@contextmanager
def output_errors(path: Path, *foreign: type[Exception]) -> Iterator[None]:
    """Translate errors of the file system, and those named, into an `OutputError` that names the path."""
    try:
        yield
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror or error}") from error
    except foreign as error:
        raise OutputError(f"{path}: cannot be written: {error}") from error
