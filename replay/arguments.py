"""The parser of a command line: which command, and its arguments; help, and errors that say what to type instead."""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterable, Iterator, Sequence
from difflib import get_close_matches
from itertools import groupby
from textwrap import wrap
from typing import NoReturn

from replay import __version__
from replay.commands import COMMANDS, load
from replay.errors import UsageError
from replay.synonyms import COMMANDS as OTHER_COMMANDS
from replay.synonyms import FLAGS as SYNONYMS

_DESCRIPTION = "Merge the occupancy grid maps that several robots recorded, offline, at each timestamp."
_EXAMPLES = """\
examples:
  replay info run.mcap
  replay merge run.mcap --robots r1,r2
  replay merge alpha=alpha_bag/ bravo=bravo_bag/ -o out/floor.mcap
  replay merge today.mcap old=map.yaml --robots r1,old --require-all
  replay config run.mcap --robots r1,r2 --changed > mission.toml && replay merge --config mission.toml
  replay recover out/floor.mcap.partial

`replay COMMAND --help` lists the arguments of a command.
"""
_HEADING_COLUMNS = 12
_UNSAID = object()
"""Stands for what a command line does not say."""


class _Help(argparse.RawDescriptionHelpFormatter):
    """Help that reads the same in every version of Python: docs/cli.md is checked against it."""

    def _format_action_invocation(self, action: argparse.Action) -> str:
        if not action.option_strings or action.nargs == 0:
            return super()._format_action_invocation(action)
        value = self._format_args(action, self._get_default_metavar_for_optional(action))
        return f"{', '.join(action.option_strings)} {value}"

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        """Return paragraphs that fit the terminal; lines that are indented, as of examples, stay as they are."""
        lines: list[str] = []
        for is_prose, group in groupby(text.splitlines(), key=lambda line: line[:1].strip() != ""):
            together = list(group)
            lines += wrap(" ".join(together), width, break_on_hyphens=False) if is_prose else together
        return "".join(f"{indent}{line}\n" for line in lines)


class Parser(argparse.ArgumentParser):
    """A parser whose errors are those of the program: a line each, with what may have been meant."""

    def __init__(self, **options: object) -> None:
        # no flag is taken for another that it is the beginning of: scripts would break when one is added
        super().__init__(**{"formatter_class": _Help, "allow_abbrev": False, **options})  # type: ignore[arg-type]

    def error(self, message: str) -> NoReturn:
        """Raise what is wrong as `UsageError`."""
        message = message.removeprefix("argument ")
        meant = self._meant(message)
        raise UsageError(f"{message}{meant or ';'} `{self.prog} --help` lists what there is")

    def _check_value(self, action: argparse.Action, value: object) -> None:
        """Refuse a value that is none of the choices, in the same words whatever the version of Python."""
        if action.choices is not None and value not in action.choices:
            raise argparse.ArgumentError(action, none_of(str(value), [str(each) for each in action.choices]))

    @property
    def takes_settings(self) -> bool:
        """Whether the command takes a file of settings."""
        return any(action.dest == "config" for action in self._actions)

    def grouped(self) -> Iterator[tuple[str, argparse.Action]]:
        """Yield all arguments, each with the heading that it is listed under."""
        for group in self._action_groups:
            for action in group._group_actions:  # noqa: SLF001 - nothing else tells it
                yield str(group.title), action

    def parsed(self, arguments: Sequence[str]) -> argparse.Namespace:
        """Return what a command line says, and for the rest what a file of settings says that it names, or the default.

        ``given`` is what the command line itself says, of commands that take settings.

        Raises
        ------
        UsageError
            If either cannot be understood.
        """
        if not self.takes_settings:
            return self.parse_args(arguments)
        flags = [action for action in self._actions if action.option_strings and action.dest != "help"]
        unsaid = {action.dest: _unsaid(action) for action in flags}
        # recordings may stand before, after and between flags; where some begin with a dash, after a double one
        parse = self.parse_args if "--" in arguments else self.parse_intermixed_args
        said = vars(parse(arguments, argparse.Namespace(**unsaid)))
        given = {name: value for name, value in said.items() if value is not _UNSAID and value not in ([], None)}
        chosen: dict[str, object] = {}
        if "config" in given or "set" in given:
            from replay.settings.choice import chosen_by

            chosen = chosen_by(self, given)
        defaults = {name: self.get_default(name) for name in said}
        return argparse.Namespace(**{**defaults, **chosen, **given}, given=frozenset(given))

    def _meant(self, message: str) -> str:
        """Return which flags may have been meant instead of those that there are not."""
        unknown = re.findall(r"(?<!\S)--?[a-zA-Z][^\s=]*", message.partition("unrecognized arguments: ")[2])
        flags = [flag for action in self._actions for flag in action.option_strings]
        found = [close for flag in unknown for close in self._like(flag, flags)]
        return f"; did you mean {' or '.join(dict.fromkeys(found))}?" if found else ""

    def _like(self, unknown: str, flags: Sequence[str]) -> list[str]:
        """Return the flag that another program calls like this, one like it, or a setting that has no flag."""
        if SYNONYMS.get(unknown) in flags:
            return [SYNONYMS[unknown]]
        found = closest(unknown, flags)
        if found or not self.takes_settings:
            return found
        from replay.settings.fields import leaves

        names = {key.rpartition(".")[2]: key for key in reversed(list(leaves()))}
        return [f"--set {names[name]}=…" for name in closest(unknown.replace("-", "_").lstrip("_"), names)]


def none_of(value: str, choices: Sequence[str]) -> str:
    """Return that a value is none of some, and which may have been meant."""
    meant = closest(value, choices)
    return f"{value!r} is none of {', '.join(choices)}{f'; did you mean {meant[0]}?' if meant else ''}"


def closest(word: str, known: Iterable[str], most: int = 1) -> list[str]:
    """Return which of the known words are most like a word, whatever dashes they begin with."""
    bare = {each.lstrip("-"): each for each in known}
    return [bare[each] for each in get_close_matches(word.lstrip("-"), list(bare), n=most, cutoff=0.6)]


def parsed(arguments: Sequence[str] | None) -> argparse.Namespace:
    """Return what a command line says; ``command`` is which command.

    Raises
    ------
    UsageError
        If it cannot be understood.
    SystemExit
        If help or the version was asked for, which is printed.
    """
    given = list(sys.argv[1:] if arguments is None else arguments)
    if given[:1] == ["help"]:
        given = [*given[1:2], "--help"]
    if given and given[0] in COMMANDS:
        options = command_parser(given[0]).parsed(given[1:])
        options.command = given[0]
        return options
    program = _program()
    program.add_argument("command", nargs="?", help=argparse.SUPPRESS)
    program.parse_args(given[:1])
    raise UsageError(_no_command(given))


def command_parser(name: str) -> Parser:
    """Return the parser of one command; it imports nothing heavy."""
    module = load(name)
    parser = Parser(
        prog=f"replay {name}",
        usage=f"replay {name} {module.USAGE}",
        description=module.DESCRIPTION.strip(),
        epilog=module.EPILOG,
    )
    module.add_flags(parser)
    return parser


def whole_parser() -> tuple[Parser, list[Parser]]:
    """Return the parser of all commands together, for what looks at all of them, and that of each."""
    program = _program()
    commands = program.add_subparsers(dest="command", parser_class=Parser)
    parsers = []
    for name, row in COMMANDS.items():
        parser = commands.add_parser(name, help=row.summary, prog=f"replay {name}", description=row.summary)
        load(name).add_flags(parser)
        parsers.append(parser)
    return program, parsers


def _program() -> Parser:
    """Return the parser of what stands before a command."""
    program = Parser(prog="replay", usage="replay COMMAND ...", description=_listing(), epilog=_EXAMPLES)
    program.add_argument("--version", action="version", version=f"replay {__version__}", help="print the version")
    return program


def _listing() -> str:
    """Return what the program does, and the commands by groups."""
    lines = [_DESCRIPTION]
    for group, rows in groupby(COMMANDS.items(), key=lambda row: row[1].group):
        lines += ["", f"{group}:", *(f"  {name:{_HEADING_COLUMNS}}{row.summary}" for name, row in rows)]
    return "\n".join(lines)


def _unsaid(action: argparse.Action) -> object:
    """Return what an argument has before it is said: what those that add to it can add to."""
    if isinstance(action.default, list):
        return []
    return None if action.nargs == 0 and isinstance(action.default, int) and action.default is not False else _UNSAID


def _no_command(given: Sequence[str]) -> str:
    commands = ", ".join(COMMANDS)
    if not given:
        return f"a command is missing; expected one of {commands}, such as `replay merge run.mcap`"
    meant = OTHER_COMMANDS.get(given[0]) or next(iter(closest(given[0], COMMANDS)), None)
    if meant:
        return f"{given[0]}: there is no such command; did you mean {meant}?"
    return f"{given[0]}: there is no such command; expected one of {commands}; to merge: replay merge {given[0]}"
