"""Text of flags as values."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

from replay.errors import OutputError, UsageError
from replay.path_errors import path_errors
from replay.plain_text import plain

_Value = TypeVar("_Value")


def read_flag(flag: str, text: str, parse: Callable[[str], _Value]) -> _Value:
    """Return what a flag says; of what it cannot say, tell which flag it was."""
    try:
        return parse(text)
    except UsageError as error:
        raise UsageError(f"{flag}: {error}") from error


def mcap_path(path: Path, said: str = "--output") -> Path:
    """Return the name of a new MCAP, if it is fit for one; ``said`` is how it was given."""
    if path.suffix != ".mcap":
        raise UsageError(f"{said} {path}: expected a name that ends in .mcap")
    return path


def html_path(path: Path, said: str = "--report") -> Path:
    """Return the name of a new report to look at, if it is fit for one; ``said`` is how it was given."""
    if path.suffix != ".html":
        raise UsageError(f"{said} {path}: expected a name that ends in .html")
    return path


def refuse_no_name(flag: str, path: Path, endings: Sequence[str] = (), example: str = "out") -> None:
    """Refuse what no file can be called, or has nothing before its ending.

    Raises
    ------
    UsageError
        With a name that would do.
    """
    with path_errors(path, OutputError):
        is_folder = path.is_dir()
    if not is_folder and path.name not in ("", "..", *endings):
        return
    why = "this is a folder" if is_folder else "nothing stands before the ending"
    # an empty name is that of the current folder
    why = f"{why}, or the name is empty" if path == Path() else why
    like = plain(str((path if is_folder else path.parent) / example))
    raise UsageError(f"{flag} {plain(str(path))}: {why}; expected a name, such as {like}")
