"""Numbers of flags."""

from __future__ import annotations

import math

from replay.documents import MOST
from replay.errors import UsageError
from replay.plain_text import brief


def at_least_0(flag: str, text: str) -> float:
    """Return the number that a flag says.

    Raises
    ------
    UsageError
        If it is none, negative, or larger than any number of a document.
    """
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not 0.0 <= number <= MOST:
        raise UsageError(f"{flag} {brief(text)}: expected a number from 0 to {MOST:g}")
    return number
