"""Text of flags as values."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from replay.errors import UsageError

_Value = TypeVar("_Value")


def read_flag(flag: str, text: str, parse: Callable[[str], _Value]) -> _Value:
    """Return what a flag says; of what it cannot say, tell which flag it was."""
    try:
        return parse(text)
    except UsageError as error:
        raise UsageError(f"{flag}: {error}") from error


def mcap_path(path: Path) -> Path:
    """Return the name of a new MCAP, if it is fit for one."""
    if path.suffix != ".mcap":
        raise UsageError(f"--output {path}: expected a name that ends in .mcap")
    return path


def html_path(path: Path) -> Path:
    """Return the name of a new report to look at, if it is fit for one."""
    if path.suffix != ".html":
        raise UsageError(f"--report {path}: expected a name that ends in .html")
    return path
