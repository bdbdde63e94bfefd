"""The fields of `mapmerge.config.MergeConfig` as settings: their names, types, words, and how they are put together."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from decimal import Decimal
from functools import cache
from typing import Any, Literal, get_args, get_origin, get_type_hints

from mapmerge.config import MergeConfig
from mapmerge.errors import ConfigError
from mapmerge.settings import Settings
from replay.arguments import none_of
from replay.errors import UsageError

ROOT = "merge"
_NAMES = re.compile(r"^(\w+(?:, \w+)*)$")
_WORDS: Mapping[type, str] = {float: "a number", int: "a whole number", bool: "true or false", str: "text"}


@cache
def leaves() -> Mapping[str, Any]:
    """Return the type of each field that holds a value, by its name in a file: ``merge.verify.min_overlap_m2``."""
    return dict(_leaves(MergeConfig, ROOT))


def values_of(config: Settings, prefix: str = ROOT) -> Iterator[tuple[str, Any]]:
    """Yield what each field holds, by its name in a file."""
    for item in fields(config):
        value, key = getattr(config, item.name), f"{prefix}.{item.name}"
        if isinstance(value, Settings):
            yield from values_of(value, key)
        else:
            yield key, value


def read(key: str, value: object, origin: str) -> Any:  # noqa: ANN401 - of the field's type
    """Return a value from a file as that of a field.

    Raises
    ------
    UsageError
        If it is none of its type.
    """
    found = _read(leaves()[key], value)
    if found is None:
        raise UsageError(f"{origin} is {said(value)}; expected {_expected(leaves()[key], value)}")
    return found


def put_together(values: Mapping[str, Any]) -> MergeConfig:
    """Return the settings of the merger; of fields that are not named, the defaults.

    Parameters
    ----------
    values
        By their names in a file, of the fields' types.

    Raises
    ------
    UsageError
        If values do not fit together; its text begins with the section.
    """
    nested: dict[str, Any] = {}
    for key, value in values.items():
        *path, name = key.removeprefix(f"{ROOT}.").split(".")
        section = nested
        for part in path:
            section = section.setdefault(part, {})
        section[name] = value
    built = _built(MergeConfig(), nested, ROOT)
    if not isinstance(built, MergeConfig):
        raise TypeError(type(built))
    return built


@cache
def words() -> Mapping[str, str]:
    """Return what the docstrings say of each section and each field, in one line, by its name in a file."""
    return dict(_described(MergeConfig, ROOT))


def said(value: object) -> str:
    """Return a value as it is written in a file, about."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return "a section"
    return f'"{value}"' if isinstance(value, str) else str(value) if not isinstance(value, list) else _listed(value)


def _listed(value: list[object]) -> str:
    return f"[{', '.join(said(item) for item in value)}]"


def _leaves(kind: type[Settings], prefix: str) -> Iterator[tuple[str, Any]]:
    hints = get_type_hints(kind)
    for item in fields(kind):
        hint, key = hints[item.name], f"{prefix}.{item.name}"
        if is_dataclass(hint):
            yield from _leaves(hint, key)  # type: ignore[arg-type]
        else:
            yield key, hint


def _read(hint: Any, value: object) -> Any:  # noqa: ANN401 - any of the fields' types
    """Return a value of a type; None if it is none."""
    if get_origin(hint) is tuple:
        kinds = get_args(hint)
        if not isinstance(value, list) or (kinds[-1] is not Ellipsis and len(value) != len(kinds)):
            return None
        items = [_read(kinds[0], item) for item in value]
        return None if None in items else tuple(items)
    if get_origin(hint) is Literal:
        return value if value in get_args(hint) else None
    if hint is float and isinstance(value, (int, float, Decimal)) and not isinstance(value, bool):
        return _float(value)
    if hint is int and isinstance(value, bool):
        return None
    return value if hint in (int, bool, str) and isinstance(value, hint) else None


def _float(value: float | Decimal) -> float | None:
    try:
        return float(value)
    except OverflowError:
        return None


def _expected(hint: Any, value: object) -> str:  # noqa: ANN401 - any of the fields' types
    if get_origin(hint) is Literal:
        return none_of(str(value), [str(each) for each in get_args(hint)]).partition(" is none of ")[2]
    if get_origin(hint) is tuple:
        kinds = get_args(hint)
        number = "" if kinds[-1] is Ellipsis else f"{len(kinds)} "
        whole = "whole numbers" if kinds[0] is int else "numbers"
        return f"a list of {number}{whole}"
    return _WORDS[hint]


def _built(default: Settings, given: Mapping[str, Any], prefix: str) -> Settings:
    """Return settings with some values in place of the defaults."""
    values = {
        item.name: _built(value, given[item.name], f"{prefix}.{item.name}")
        if isinstance(value := getattr(default, item.name), Settings) and item.name in given
        else given.get(item.name, value)
        for item in fields(default)
    }
    try:
        return type(default)(**values)
    except ConfigError as error:
        raise UsageError(f"{prefix}: {error}") from error


def _described(kind: type[Settings], prefix: str) -> Iterator[tuple[str, str]]:
    doc = inspect.getdoc(kind) or ""
    yield prefix, _bare(doc.partition("\n\n")[0])
    hints, told = get_type_hints(kind), dict(_parameters(doc))
    for item in fields(kind):
        key = f"{prefix}.{item.name}"
        if is_dataclass(hints[item.name]):
            yield from _described(hints[item.name], key)
        elif item.name in told:
            yield key, told[item.name]


def _parameters(doc: str) -> Iterator[tuple[str, str]]:
    """Yield what a docstring in numpydoc's form says of each parameter, in one line."""
    section = doc.partition("Parameters\n----------\n")[2].partition("\n\nRaises\n")[0]
    names: list[str] = []
    told: dict[str, list[str]] = {}
    for line in section.splitlines():
        if found := _NAMES.match(line):
            names = found[1].split(", ")
        elif line.startswith(" "):
            for name in names:
                told.setdefault(name, []).append(line.strip())
    for name, lines in told.items():
        yield name, _bare(" ".join(lines))


def _bare(text: str) -> str:
    """Return text without the marks of reStructuredText."""
    return re.sub(r"`+", "", text.replace("\n", " "))
