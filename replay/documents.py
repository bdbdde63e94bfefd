"""Values of JSON and YAML documents, read with a word on where each is: what is missing or of another kind is named."""

from __future__ import annotations

import reprlib
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from pathlib import Path
from typing import NoReturn, TypeVar

from replay.errors import InputError
from replay.plain_text import brief

_Value = TypeVar("_Value")
Keys = tuple[str | int, ...]

MOST = 1e12
"""No length, area, time or ratio that a document names is larger: what follows from them is finite."""


@dataclass(frozen=True, slots=True)
class Node:
    """A value of a document.

    Parameters
    ----------
    file
        Which file the document is.
    value
        A plain value, as JSON has them.
    keys
        The keys and indices that lead to it.
    lines
        Lines of the file in which values begin, by their keys, where they are known.
    """

    file: Path
    value: object
    keys: Keys = ()
    lines: Mapping[Keys, int] = field(default_factory=dict)

    @property
    def place(self) -> str:
        """Where it is, in words."""
        named = ".".join(brief(str(key)) for key in self.keys) or "it"
        around = (self.keys[:count] for count in range(len(self.keys), 0, -1))
        line = next((self.lines[keys] for keys in around if keys in self.lines), None)
        return named if line is None else f"line {line}: {named}"

    def refuse(self, expected: str) -> NoReturn:
        """Say what is expected instead of the value.

        Raises
        ------
        InputError
            Always.
        """
        raise InputError(f"{self.file}: {self.place} is {reprlib.repr(self.value)}; expected {expected}")

    def items(self) -> Iterator[tuple[str, Node]]:
        """Yield the values of a mapping, by key."""
        if not isinstance(self.value, dict):
            self.refuse("a mapping of names to values")
        for key, value in self.value.items():
            if not isinstance(key, str):
                replace(self, value=key).refuse("a name: put it in quotes")
            yield key, replace(self, value=value, keys=(*self.keys, key))

    def get(self, key: str) -> Node | None:
        """Return the value of a key; None where it is absent or null."""
        if not isinstance(self.value, dict):
            self.refuse(f"a mapping with the key '{key}'")
        value = self.value.get(key)
        return None if value is None else replace(self, value=value, keys=(*self.keys, key))

    def need(self, key: str) -> Node:
        """Return the value of a key that must be there."""
        found = self.get(key)
        if found is None:
            raise InputError(f"{self.file}: {self.place} has no '{key}', which was expected")
        return found

    def maybe(self, key: str, read: Callable[[Node], _Value]) -> _Value | None:
        """Return what is read of a key's value; None where it is absent or null."""
        found = self.get(key)
        return None if found is None else read(found)

    def only(self, known: Collection[str]) -> None:
        """Refuse keys that are not known, with the one that may have been meant."""
        for key, node in self.items():
            if key not in known:
                close = get_close_matches(key, known, n=1, cutoff=0.6)
                meant = f"did you mean '{close[0]}'?" if close else f"expected {', '.join(known)}"
                raise InputError(f"{self.file}: {node.place}: there is no key '{brief(key)}' here; {meant}")

    def no_slips(self, known: Collection[str]) -> None:
        """Refuse keys that are nearly like one that is known; others are left alone."""
        for key, node in self.items():
            close = [] if key in known else get_close_matches(key, known, n=1, cutoff=0.8)
            if close:
                raise InputError(f"{self.file}: {node.place}: did you mean '{close[0]}'?")

    def text(self) -> str:
        """Return the value as text."""
        return self.value if isinstance(self.value, str) else self.refuse("a text")

    def elements(self) -> tuple[Node, ...]:
        """Return the values of a list."""
        if not isinstance(self.value, list):
            self.refuse("a list")
        return tuple(replace(self, value=each, keys=(*self.keys, at)) for at, each in enumerate(self.value))

    def texts(self) -> tuple[str, ...]:
        """Return a text, or a list of texts."""
        return tuple(each.text() for each in self.elements()) if isinstance(self.value, list) else (self.text(),)

    def truth(self) -> bool:
        """Return the value as true or false."""
        return self.value if isinstance(self.value, bool) else self.refuse("true or false")

    def number(self, low: float = -MOST, high: float = MOST) -> float:
        """Return the value as a number within limits, which belong to it; larger ones than `MOST` are none."""
        if isinstance(self.value, int | float) and not isinstance(self.value, bool):
            with suppress(OverflowError):
                number = float(self.value)
                if low <= number <= high:
                    return number
        return self.refuse(_number_words(low, high))

    def whole(self) -> int:
        """Return the value as a whole number of 64 bits, not negative."""
        if isinstance(self.value, int) and not isinstance(self.value, bool) and 0 <= self.value < 1 << 64:
            return self.value
        return self.refuse("a whole number, 0 or more")

    def place_m(self) -> tuple[float, float]:
        """Return the value as a point: two numbers."""
        if not isinstance(self.value, list) or len(self.value) != 2:
            self.refuse("[x, y], two numbers of metres")
        x_m, y_m = (each.number() for each in self.elements())
        return x_m, y_m


def _number_words(low: float, high: float) -> str:
    if (low, high) == (-MOST, MOST):
        return "a number"
    return f"a number of at least {low:g}" if high == MOST else f"a number from {low:g} to {high:g}"
