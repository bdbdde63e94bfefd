"""How much is said, and in which colours: of one call, and no setting."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from replay.errors import UsageError

if TYPE_CHECKING:
    from replay.console import Talk

COLOURS = ("auto", "always", "never")


def add(parser: argparse.ArgumentParser) -> None:
    """Add the flags of what is said."""
    group = parser.add_argument_group("what is said")
    add_quiet(group)
    group.add_argument(
        "-v",
        "--verbose",
        action="store_true",
        help="say at each time which maps came, which pairs were searched and why, and how long it took",
    )
    group.add_argument(
        "--color",
        choices=COLOURS,
        default="auto",
        help="when there are colours; auto: on a terminal, unless NO_COLOR is set or TERM is dumb, and wherever "
        "FORCE_COLOR is set (default: %(default)s)",
    )


def add_quiet(parser: argparse._ActionsContainer) -> None:
    """Add the flag for those that have no other of these."""
    parser.add_argument(
        "-q",
        "--quiet",
        action="store_true",
        help="say nothing but errors, and print only what is asked for, as by --json",
    )


def of(options: argparse.Namespace) -> Talk:
    """Return how much is said.

    Raises
    ------
    UsageError
        If it is to be nothing, and all.
    """
    from replay.console import Talk

    if options.quiet and options.verbose:
        raise UsageError("--quiet and --verbose: expected one of them")
    return Talk.QUIET if options.quiet else Talk.VERBOSE if options.verbose else Talk.USUAL
