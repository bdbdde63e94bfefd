"""Numbers of things in words."""

from __future__ import annotations


def counted(number: int, what: str) -> str:
    """Return a number of things: 1 message, 2 messages."""
    return f"{number} {what}{'' if number == 1 else 's'}"
