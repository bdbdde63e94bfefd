"""`replay info`: what recordings hold, and what would be merged."""

from __future__ import annotations

import argparse

from replay.exit_status import EXIT_DONE
from replay.flags import inputs
from replay.plain_text import plain
from replay.standard_streams import printing

USAGE = "RUN [RUN ...] [options]"
DESCRIPTION = """\
List format, duration, map topics, messages, sizes and resolutions of recordings,
and what would be merged.
"""
EPILOG = """\
examples:
  replay info run.mcap
  replay info alpha=alpha.bag bravo=bravo/ --robots bravo,alpha

exit status: 0 listed, also where nothing would be merged or something is lost; 2 bad usage, or an input that cannot be
read at all; 3 the list could not be written, or a bug; 130 interrupted
"""


def add_flags(parser: argparse.ArgumentParser) -> None:
    """Add recordings, and the flags of what is read of them."""
    inputs.add(parser)
    parser.add_argument_group("rules").add_argument(
        "--max-memory",
        metavar="SIZE",
        help="leave out what of a recording is larger to read at once, such as 500MB (default: 1 GiB)",
    )


def run(options: argparse.Namespace) -> int:
    """Print the list."""
    from replay.info import lines, summarise

    summary = summarise(inputs.run_options(options))
    with printing():
        for line in lines(summary):
            print(plain(line))
    return EXIT_DONE
