"""`replay info`: what recordings hold, and what would be merged."""

from __future__ import annotations

import argparse

from replay.exit_status import EXIT_DIFFERS, EXIT_DONE
from replay.flags import inputs
from replay.plain_text import plain
from replay.standard_streams import printing, write_json

USAGE = "RUN [RUN ...] [options]"
DESCRIPTION = """\
List format, duration, map topics, messages, sizes and resolutions of recordings,
and what would be merged.
"""
EPILOG = """\
examples:
  replay info run.mcap
  replay info alpha=alpha.bag bravo=bravo/ --robots bravo,alpha
  replay info run.mcap --json --strict               in CI: is the recording whole, and would it be merged?

exit status: 0 listed, also where nothing would be merged or something is lost; 1 that, if --strict was given; 2 bad
usage, or an input that cannot be read at all; 3 the list could not be written, or a bug; 130 interrupted
"""


def add_flags(parser: argparse.ArgumentParser) -> None:
    """Add recordings, and the flags of what is read of them."""
    inputs.add(parser)
    parser.add_argument("--json", action="store_true", help="print it as JSON")
    group = parser.add_argument_group("rules")
    group.add_argument(
        "--max-memory",
        metavar="SIZE",
        help="leave out what of a recording is larger to read at once, such as 500MB (default: 1 GiB)",
    )
    group.add_argument(
        "--strict",
        action="store_true",
        help="exit with 1 if something is lost, a map cannot be used, or fewer than two maps would be merged",
    )


def run(options: argparse.Namespace) -> int:
    """Print the list."""
    from replay.info import lines, summarise
    from replay.info_json import info_text

    summary = summarise(inputs.run_options(options))
    with printing():
        if options.json:
            write_json(info_text(summary))
        else:
            for line in lines(summary):
                print(plain(line))
    return EXIT_DIFFERS if options.strict and not summary.is_whole else EXIT_DONE
