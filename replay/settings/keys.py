"""Which settings there are, and what they are called in a file."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Mapping

from replay.arguments import Parser, closest, command_parser
from replay.commands import COMMANDS
from replay.errors import UsageError
from replay.settings import fields

SECTIONS: Mapping[str, str] = {
    "positional arguments": "",
    "which maps": "",
    "time": "time.",
    "how maps are placed": "placing.",
    "outputs": "outputs.",
    "rules": "rules.",
    "what is expected": "check.",
}
"""Groups of flags that are settings → the section that they are in; "" for the top of the file."""

OF_ONE_CALL = frozenset(
    {
        *("help", "config", "set", "changed", "force", "write_expect"),
        *("json", "view", "quiet", "verbose", "color", "summary"),
    }
)
"""Flags within these groups, and others, that say what to do this time, and are nobody's setting.

What replaces files must be asked for each time, and what is shown is for whoever looks.
"""

ELSEWHERE: Mapping[str, str] = {
    "method": "merge.method",
    "scale": "merge.scale",
    "min_confidence": "merge.verify.min_confidence",
}
"""Flags that are fields of the settings of the merger, and are found there."""


def settings_of(parser: Parser) -> dict[str, argparse.Action]:
    """Return the flags of a command that are settings, by their names in a file, in the order of its help."""
    return {
        _key(SECTIONS[title], action): action
        for title, action in parser.grouped()
        if title in SECTIONS and action.dest not in OF_ONE_CALL
    }


def all_settings() -> dict[str, argparse.Action]:
    """Return the flags of all commands that take a file of settings: one file serves them all."""
    found: dict[str, argparse.Action] = {}
    for name in COMMANDS:
        parser = command_parser(name)
        if parser.takes_settings:
            found = {**settings_of(parser), **found}
    return found


def refuse_unknown(key: str, known: Iterable[str], origin: str) -> None:
    """Refuse a name that is no setting's.

    Raises
    ------
    UsageError
        With the name that may have been meant.
    """
    name = key.rpartition(".")[2]
    if name in OF_ONE_CALL:
        raise UsageError(f"{origin}: is said for each run anew; give --{name.replace('_', '-')} on the command line")
    meant = _meant(key, list(known))
    hint = f"did you mean {meant}? " if meant else ""
    raise UsageError(f"{origin}: there is no such setting; {hint}`replay config` lists all")


def known_keys(flags: Iterable[str]) -> list[str]:
    """Return the names of all settings."""
    return list(dict.fromkeys([*flags, *fields.leaves()]))


def _key(section: str, action: argparse.Action) -> str:
    if action.dest in ELSEWHERE:
        return ELSEWHERE[action.dest]
    several = "s" if isinstance(action.default, list) and action.option_strings else ""
    unit = "_s" if action.metavar == "SECONDS" else ""
    return f"{section}{action.dest}{several}{unit}"


def _meant(key: str, known: list[str]) -> str | None:
    """Return the setting, or the section, that may have been meant: in its section, or of this name in another."""
    typed = key.replace("-", "_")
    section, _, name = typed.rpartition(".")
    places = [*known, *dict.fromkeys(each.rpartition(".")[0] for each in known)]
    here = {each.rpartition(".")[2]: each for each in places if each.rpartition(".")[0] == section}
    anywhere = {each.rpartition(".")[2]: each for each in reversed(places) if each}
    if name in anywhere and not closest(name, here):
        return anywhere[name]
    for names in (here, anywhere):
        if found := closest(name, names):
            return names[found[0]]
    return None
