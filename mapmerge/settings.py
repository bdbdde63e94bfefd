"""What all settings have in common: the type and the limits of each are declared with the field."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cache
from numbers import Integral
from typing import Annotated, Any, Literal, get_args, get_origin, get_type_hints

from mapmerge.checks import is_finite, is_number, shown
from mapmerge.errors import ConfigError

MOST = 1e12
"""No setting is larger: what follows from it is finite."""
_MOST_ITEMS = 100


@dataclass(frozen=True, slots=True)
class Within:
    """Limits of a number, which belong to it: ``Annotated[float, Within(0.0, 1.0)]``.

    A number without limits of its own is within these.
    """

    low: float = 0.0
    high: float = MOST

    def holds(self, number: float) -> bool:
        """Tell whether a number is within the limits."""
        return self.low <= number <= self.high

    def __str__(self) -> str:
        """Return them in words."""
        return f"from {self.low:g} to {self.high:g}"


@dataclass(frozen=True, slots=True)
class Above(Within):
    """Limits of a number of which the lower one does not belong to it, such as that of a divisor."""

    def holds(self, number: float) -> bool:
        """Tell whether a number is within the limits."""
        return self.low < number <= self.high

    def __str__(self) -> str:
        """Return them in words."""
        return f"more than {self.low:g}, at most {self.high:g}"


@dataclass(frozen=True, slots=True)
class Settings:
    """Base of all settings: each is of its type, and within the limits that are declared with it.

    Numbers of other libraries become those of Python, and lists become tuples.

    Raises
    ------
    ConfigError
        If one is not.
    """

    def __post_init__(self) -> None:
        own: Any = type(self)
        kinds = types_of(own)
        for item in fields(self):
            value = getattr(self, item.name)
            kept = _kept(kinds[item.name], value)
            if kept is None:
                raise ConfigError(f"{item.name} is {shown(value)}; expected {_words(kinds[item.name])}")
            if kept is not value:
                object.__setattr__(self, item.name, kept)


@cache
def types_of(kind: type[Any]) -> Mapping[str, Any]:
    """Return the type of each field, with its limits."""
    return get_type_hints(kind, include_extras=True)


def _kept(kind: Any, value: Any) -> Any:  # noqa: ANN401 - of any of the fields' types
    """Return a value as it is kept; None if it is none of its type, or beyond its limits."""
    if get_origin(kind) is tuple:
        return _kept_items(get_args(kind), value)
    base, limits = _parts(kind)
    if get_origin(base) is Literal:
        return value if isinstance(value, str) and value in get_args(base) else None
    if base not in (int, float):
        return value if isinstance(value, base) else None
    if not is_number(value) or (base is int and not isinstance(value, Integral)):
        return None
    if not is_finite(value):
        return None
    if type(value) not in (int, float):
        value = int(value) if isinstance(value, Integral) else float(value)
    return value if limits.holds(value) else None


def _kept_items(kinds: tuple[Any, ...], value: object) -> tuple[Any, ...] | None:
    least, most = (1, _MOST_ITEMS) if kinds[-1] is Ellipsis else (len(kinds), len(kinds))
    if not isinstance(value, (tuple, list)) or not least <= len(value) <= most:
        return None
    items = tuple(_kept(kinds[0], item) for item in value)
    return None if any(item is None for item in items) else items


def _parts(kind: Any) -> tuple[Any, Within]:  # noqa: ANN401 - any of the fields' types
    """Return a type and its limits."""
    if get_origin(kind) is Annotated:
        base, limits = get_args(kind)
        return base, limits
    return kind, Within()


def _words(kind: Any) -> str:  # noqa: ANN401 - any of the fields' types
    """Return what is expected of a type, in words."""
    if get_origin(kind) is tuple:
        kinds = get_args(kind)
        count = f"1 to {_MOST_ITEMS}" if kinds[-1] is Ellipsis else str(len(kinds))
        whole = "whole numbers" if _parts(kinds[0])[0] is int else "numbers"
        return f"{count} {whole}, each {_parts(kinds[0])[1]}"
    base, limits = _parts(kind)
    if get_origin(base) is Literal:
        return " or ".join(get_args(base))
    if base in (int, float):
        return f"a {'whole number' if base is int else 'number'} {limits}"
    return {bool: "True or False", str: "a text"}.get(base) or f"a {base.__name__}"
