"""Consoles on standard output and error, and how much is said on them."""

from __future__ import annotations

from enum import IntEnum
from typing import IO, TYPE_CHECKING

from replay.colours import are_on
from replay.standard_streams import quiet_stderr

if TYPE_CHECKING:
    from rich.console import Console

_WIDTH_WHERE_NO_TERMINAL = 400


class Talk(IntEnum):
    """How much is said."""

    QUIET = 0
    """Nothing."""
    USUAL = 1
    """What is worth a line."""
    VERBOSE = 2
    """What was done at each time, as well."""


def open_notes(colour: str = "auto") -> Console:
    """Return a console on standard error, which falls silent where that cannot be written."""
    return open_console(quiet_stderr(), colour)


def open_console(stream: IO[str], colour: str = "auto") -> Console:
    """Return a console; where there is no terminal, lines are not broken at its width."""
    from rich.console import Console

    on = are_on(stream, colour)
    return Console(
        file=stream,
        width=None if stream.isatty() else _WIDTH_WHERE_NO_TERMINAL,
        highlight=False,
        emoji=False,
        soft_wrap=False,
        # the library would take what forces colours for a terminal, and show its progress there
        force_terminal=stream.isatty(),
        no_color=not on,
        color_system=("auto" if stream.isatty() else "standard") if on else None,
    )
