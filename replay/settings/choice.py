"""What a file and ``--set`` say of a command's flags: flags win over ``--set``, and that over the file."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from datetime import date, datetime, time
from decimal import Decimal
from pathlib import Path
from typing import Any

from replay.arguments import Parser, none_of
from replay.errors import UsageError
from replay.options import MOST_DIGITS
from replay.settings import fields
from replay.settings.documents import Said, read_assignment, read_settings
from replay.settings.keys import all_settings, known_keys, settings_of

_WITH_COMMAS = frozenset({"robots"})
"""Flags whose text is a list."""


def chosen_by(parser: Parser, given: Mapping[str, Any]) -> dict[str, object]:
    """Return what the file and ``--set`` say, as a command line would have said it.

    Parameters
    ----------
    parser
        Of the command; what it has no flag for, others have, and it is left out.
    given
        What the command line says; of that, ``config`` and ``set`` are used.

    Returns
    -------
    chosen
        By the flags' names; ``merge_fields``, by the names of settings, those that no flag stands for; ``origins``, by
        flags, where each was said.

    Raises
    ------
    UsageError
        If a setting is unknown or its value of a wrong type.
    """
    flags = all_settings()
    known = known_keys(flags)
    said = read_settings(given["config"], known) if "config" in given else {}
    for text in given.get("set", ()):
        said |= read_assignment(text, known)
    chosen: dict[str, object] = {}
    origins: dict[str, str] = {}
    own = settings_of(parser)
    for key, item in said.items():
        if key not in flags:
            continue
        action = own.get(key, flags[key])
        value = _as_flag(action, item)
        if key in own and action.dest not in given:
            chosen[action.dest] = value
            origins[_flag(action)] = item.origin
    chosen["merge_fields"] = {
        key: (fields.read(key, item.value, item.origin), item.origin) for key, item in said.items() if key not in flags
    }
    return {**chosen, "origins": origins}


def _flag(action: argparse.Action) -> str:
    """Return what errors call an argument."""
    return action.option_strings[-1] if action.option_strings else str(action.metavar)


def _as_flag(action: argparse.Action, said: Said) -> object:
    """Return a value as the command line would have it.

    Raises
    ------
    UsageError
        If it is of a wrong type.
    """
    value = said.value
    if action.nargs == 0:
        if not isinstance(value, bool):
            raise UsageError(f"{said.origin} is {fields.said(value)}; expected true or false")
        return value
    if isinstance(action.default, list) or action.dest in _WITH_COMMAS:
        texts = _texts(said)
        if action.dest == "runs":
            return [_placed(text, said.folder) for text in texts]
        # no names are all of them
        return (",".join(texts) or None) if action.dest in _WITH_COMMAS else texts
    text = _text(said)
    if action.type is Path:
        return said.folder / text
    if action.choices is not None and text not in action.choices:
        raise UsageError(f"{said.origin}: {none_of(text, [str(each) for each in action.choices])}")
    return text


def _texts(said: Said) -> list[str]:
    if isinstance(said.value, list) and all(isinstance(item, str) for item in said.value):
        return said.value
    if isinstance(said.value, str):
        return [said.value]
    raise UsageError(f'{said.origin} is {fields.said(said.value)}; expected a list of texts, such as ["a", "b"]')


def _text(said: Said) -> str:
    """Return one value as it would be typed."""
    value = said.value
    if isinstance(value, (dict, list)):
        raise UsageError(f"{said.origin} is {fields.said(value)}; expected one value")
    if isinstance(value, str):
        return value
    if isinstance(value, Decimal) and value.is_finite() and abs(value.adjusted()) < MOST_DIGITS:
        # of more, 1E+999 is said, which no flag takes: written out it may fill the memory
        return f"{value:f}"
    return value.isoformat() if isinstance(value, (datetime, date, time)) else fields.said(value)


def _placed(run: str, folder: Path) -> str:
    """Return a RUN whose path is relative to a folder as one that is relative to the current one."""
    name, sign, path = run.partition("=")
    return f"{name}={folder / path}" if sign and not (folder / run).exists() else str(folder / run)
