"""What message definitions state, in whichever language they are written."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

Fields = Mapping[str, Sequence[tuple[str, str]]]
"""By name of a message, the names and types of its fields."""

SEPARATOR_LINE = re.compile(r"^={3,}[ \t]*$", re.MULTILINE)
"""Between the definitions of several types."""

_NUMBERS = {"bool", "byte", "char", "float32", "float64"} | {
    f"{sign}int{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)
}
BASE = _NUMBERS | {"string", "wstring"}
"""Types that are made of no others."""


class NoDefinitionError(Exception):
    """A text is no message definition."""
