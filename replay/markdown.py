"""Text in Markdown that is read as it is, whatever names are in it, and tables of it."""

from __future__ import annotations

from collections.abc import Sequence

from replay.plain_text import plain

_MARKS = str.maketrans({each: f"\\{each}" for each in "\\`*_{}[]<>|#~"})


def inline(text: str) -> str:
    """Return text that is read as it is, on one line, also within a cell of a table."""
    return plain(text).translate(_MARKS)


def table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table of cells that are Markdown."""
    return "\n".join("| " + " | ".join(row) + " |" for row in (columns, ("---",) * len(columns), *rows))
