"""Whether an argument is of the kind that is expected, and how one that is not is shown."""

from __future__ import annotations

import math
import reprlib
from numbers import Real

_LONGEST = 60


def is_number(value: object) -> bool:
    """Tell whether a value is a number, of Python or of another library; True and False are none."""
    return isinstance(value, Real) and not isinstance(value, bool)


def is_finite(number: float) -> bool:
    """Tell whether a number is finite as a `float`."""
    try:
        return math.isfinite(number)
    except OverflowError:
        return False


def shown(value: object) -> str:
    """Return a value for an error: in one line, and cut if it is long."""
    try:
        text = str(value) if isinstance(value, (int, float)) else reprlib.repr(value)
    except ValueError:  # an int of so many digits that Python does not print it
        return "a number of too many digits"
    line = " ".join(text.split())
    return line if len(line) <= _LONGEST else f"{line[: _LONGEST - 1]}…"
