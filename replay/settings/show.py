"""The settings that a command line and its files come to, as a file of settings with comments."""

from __future__ import annotations

import argparse
import re
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.items import Table

from mapmerge.config import MergeConfig
from replay import __version__
from replay.arguments import Parser
from replay.options import MOST_DIGITS
from replay.settings import fields
from replay.settings.keys import ELSEWHERE, settings_of

_WIDTH = 100
_NUMBERS = frozenset({"SECONDS", "TIME", "P", "N", "SIZE"})
"""What flags call values that are numbers, if they look like one."""


@dataclass(frozen=True, slots=True)
class Shown:
    """A setting as it is shown.

    Parameters
    ----------
    key
        Its name.
    value, default
        What it is, and would be by itself, as TOML has them; None where nothing is said.
    words
        What it is for.
    """

    key: str
    value: Any
    default: Any
    words: str

    @property
    def is_changed(self) -> bool:
        """Whether it differs from the default."""
        return bool(self.value != self.default)


def shown_settings(parser: Parser, options: argparse.Namespace, merge: MergeConfig) -> list[Shown]:
    """Return the settings of a run in the order in which they are shown.

    Parameters
    ----------
    parser, options
        Of the command, and what was said.
    merge
        What that comes to for the merger.
    """
    flags = [
        Shown(key, _value(action, getattr(options, action.dest)), _value(action, action.default), _help(parser, action))
        for key, action in settings_of(parser).items()
        if action.dest not in ELSEWHERE
    ]
    defaults, words = dict(fields.values_of(MergeConfig())), fields.words()
    merged = [
        Shown(key, _plain(value), _plain(defaults[key]), words.get(key, "")) for key, value in fields.values_of(merge)
    ]
    merged.sort(key=lambda item: item.key.count(".") > 1)  # TOML has what is no section first
    return [*flags, *merged]


def as_toml(settings: list[Shown]) -> str:
    """Return settings as a file: each with what it is for, and whether it is the default."""
    document = tomlkit.document()
    document.add(tomlkit.comment(f"Settings of replay {__version__}; give them to a run with --config FILE."))
    tables: dict[str, Any] = {"": document}
    told = ""
    for item in settings:
        section, _, name = item.key.rpartition(".")
        table = tables[section] if section in tables else _new_table(tables, section)
        if item.words != told:
            table.add(tomlkit.nl())
            for line in _wrapped(item.words):
                table.add(tomlkit.comment(line))
        told = item.words
        if item.value is None:
            table.add(tomlkit.comment(f"{name} is not set"))
            continue
        value = tomlkit.item(item.value)
        value.comment(_mark(item))
        value.trivia.comment_ws = "  "
        table.add(name, value)
    return _tidy(tomlkit.dumps(document))


def _tidy(text: str) -> str:
    """Return text with no more than one empty line at once, and one line end at its end."""
    return re.sub(r"\n{3,}", "\n\n", text).strip() + "\n"


def _new_table(tables: dict[str, Any], section: str, *, is_heading: bool = True) -> Table:
    """Add a section, and those that it is in; of these, what has no setting of its own has no heading."""
    above, _, name = section.rpartition(".")
    parent = tables[above] if above in tables else _new_table(tables, above, is_heading=False)
    table = tomlkit.table(is_super_table=not is_heading)
    for line in _wrapped(fields.words().get(section, "") if is_heading else ""):
        table.add(tomlkit.comment(line))
    parent.add(tomlkit.nl())
    parent.add(name, table)
    tables[section] = table
    return table


def _mark(item: Shown) -> str:
    if not item.is_changed:
        return "default"
    there = (
        "by default it is not" if item.default is None else f"the default is {tomlkit.item(item.default).as_string()}"
    )
    return f"set; {there}"


def _wrapped(text: str) -> Iterator[str]:
    yield from textwrap.wrap(text, _WIDTH)


def _help(parser: Parser, action: argparse.Action) -> str:
    """Return what the help says of a flag; its default is told beside it."""
    text = str(action.help) % {**vars(action), "prog": parser.prog}
    default = "" if action.default is None else str(action.default)
    return text.replace(f" (default: {default})", "").replace("; may be repeated", "")


def _value(action: argparse.Action, said: Any) -> Any:  # noqa: ANN401 - as the parser has it
    """Return what a flag says as TOML has it."""
    if said is None or isinstance(said, bool):
        return said
    if isinstance(said, list):
        return [str(item) for item in said]
    if isinstance(said, Path):
        return said.as_posix()
    if action.dest == "robots":
        return [name.strip() for name in str(said).split(",")]
    return _number(str(said)) if action.metavar in _NUMBERS else str(said)


def _number(text: str) -> int | float | str:
    """Return text as the number that it says, if that number says all of it."""
    if len(text) > MOST_DIGITS:
        return text
    if re.fullmatch(r"[0-9]+", text):
        return int(text)
    try:
        number = Decimal(text)
    except InvalidOperation:
        return text
    return float(text) if number.is_finite() and Decimal(repr(float(text))) == number else text


def _plain(value: Any) -> Any:  # noqa: ANN401 - any field
    return list(value) if isinstance(value, tuple) else value
