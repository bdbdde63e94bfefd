"""Numbers of flags."""

from __future__ import annotations

import math

from replay.errors import UsageError


def at_least_0(flag: str, text: str) -> float:
    """Return the number that a flag says.

    Raises
    ------
    UsageError
        If it is none, negative or not finite.
    """
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not 0.0 <= number < math.inf:
        raise UsageError(f"{flag} {text}: expected a number, 0 or more")
    return number
