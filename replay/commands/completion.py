"""`replay completion`: what a shell needs to complete commands, flags and files."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from replay.exit_status import EXIT_DONE
from replay.standard_streams import printing

SHELLS = ("bash", "zsh", "fish", "tcsh")

USAGE = "{bash,zsh,fish,tcsh}"
DESCRIPTION = """\
Print a script that lets a shell complete commands, flags, their values and files of replay. It is static:
completing starts no Python. After an update of replay, write it anew.
"""
EPILOG = """\
examples:
  eval "$(replay completion bash)"                                               in ~/.bashrc, or
  replay completion bash > ~/.local/share/bash-completion/completions/replay
  replay completion zsh > "${fpath[1]}/_replay"
  replay completion fish > ~/.config/fish/completions/replay.fish

exit status: 0 printed; 2 bad usage; 3 standard output cannot be written, or a bug
"""

_FILES = frozenset({"runs", "file"})
"""Arguments that are paths, though their text says more."""


def add_flags(parser: argparse.ArgumentParser) -> None:
    """Add the shell."""
    parser.add_argument("shell", choices=SHELLS, metavar="SHELL", help="bash, zsh, fish or tcsh")


def run(options: argparse.Namespace) -> int:
    """Print the script."""
    import shtab

    from mapmerge.match import MATCHERS
    from replay.arguments import whole_parser

    program, commands = whole_parser()
    for command in commands:
        for _, action in command.grouped():
            if action.type is Path or action.dest in _FILES:
                action.complete = shtab.FILE  # type: ignore[attr-defined]  # as the library asks for
            elif action.dest == "method":
                action.choices = tuple(MATCHERS)
    with printing():
        sys.stdout.write(shtab.complete(program, options.shell) + "\n")
    return EXIT_DONE
