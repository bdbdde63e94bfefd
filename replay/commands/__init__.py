"""Commands: a new one is a file here and a row in `COMMANDS`."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from dataclasses import dataclass
from importlib import import_module
from typing import Protocol, cast

__all__ = ["COMMANDS", "Command", "CommandModule", "load"]


@dataclass(frozen=True, slots=True)
class Command:
    """A row of the table: where a command is, and what a list of commands says of it.

    Parameters
    ----------
    module
        A module that is a `CommandModule`, imported when the command is given.
    group
        The heading that it is listed under.
    summary
        What it does, in a line.
    """

    module: str
    group: str
    summary: str


class CommandModule(Protocol):
    """What the module of a command offers; importing it imports nothing heavy."""

    USAGE: str
    DESCRIPTION: str
    EPILOG: str

    def add_flags(self, parser: ArgumentParser) -> None:
        """Say which arguments there are."""

    def run(self, options: Namespace) -> int:
        """Do it, and return the exit status.

        Raises
        ------
        ReplayError
            Of what a user can mend.
        """


COMMANDS: dict[str, Command] = {
    "merge": Command("replay.commands.merge", "main job", "merge the maps of a recording and write what came of it"),
    "info": Command("replay.commands.info", "main job", "list what recordings hold and what would be merged"),
    "view": Command("replay.commands.view", "main job", "look at what came of a run, in Rerun's viewer"),
    "recover": Command(
        "replay.commands.recover", "main job", "make a readable MCAP of one that was cut off, such as OUT.mcap.partial"
    ),
    "export": Command(
        "replay.commands.export", "after a run", "write maps as map_server loads them, pictures, or transforms"
    ),
    "evaluate": Command("replay.commands.evaluate", "after a run", "hold a run against known truth"),
    "check": Command("replay.commands.check", "in CI", "merge, and hold the outcome against what is expected"),
    "compare": Command("replay.commands.compare", "in CI", "list what differs between two runs"),
    "config": Command("replay.commands.config", "about replay", "print the settings that a run would have, as a file"),
    "completion": Command(
        "replay.commands.completion", "about replay", "print what a shell needs to complete commands and flags"
    ),
}
"""In the order in which they are listed."""


def load(name: str) -> CommandModule:
    """Return the module of a command."""
    return cast("CommandModule", import_module(COMMANDS[name].module))
