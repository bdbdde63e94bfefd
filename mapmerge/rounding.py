"""Numbers for people: rounded so that what is less than a limit reads like that, wherever it is said."""

from __future__ import annotations

import math

_MOST_DIGITS = 6
_NEAR_ONE, _NEAR_ZERO = 0.9, 0.01
"""Shares beyond these are told with two digits more."""


def rounded_down(value: float, digits: int) -> float:
    """Return a number rounded down to so many digits after the point."""
    return math.floor(round(value * 10.0**digits, 9)) / 10.0**digits


def fixed(value: float, digits: int) -> str:
    """Return a number with so many digits after the point; no zero has a sign."""
    return f"{round(value, digits) + 0.0:.{digits}f}"


def percent_below(share: float, limit: float) -> tuple[str, str]:
    """Return a share and the limit that it is below as percents, with as many digits as show which is less."""
    for digits in range(2 if share > _NEAR_ONE or share < _NEAR_ZERO else 0, _MOST_DIGITS):
        below, least = rounded_down(share * 100.0, digits), round(limit * 100.0, digits)
        if below < least and math.isclose(least, limit * 100.0):
            break
    return f"{below:g}%", f"{least:g}%"
