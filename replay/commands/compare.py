"""`replay compare`: what differs between two runs."""

from __future__ import annotations

import argparse
from pathlib import Path

from replay.exit_status import EXIT_DIFFERS, EXIT_DONE
from replay.flags.numbers import at_least_0
from replay.plain_text import plain
from replay.standard_streams import printing, write_json

USAGE = "A B [options]"
DESCRIPTION = """\
Say what differs between the outcomes of two runs, beyond tolerances: robots that appeared or vanished, were placed
or lost, or moved; their acceptance, confidence, overlap and time; reasons of refusals; skipped messages.
A and B are reports, OUT.json, or MCAPs with reports in them, OUT.mcap. They are only read.
"""
EPILOG = """\
Poses are compared in A's merged frame, by where the middle of what the robot's map knows lies, and how it is turned.
Where the runs were made by other versions, of other inputs or with other settings, a note says so; that is no
difference.

examples:
  replay compare yesterday.json today.json
  replay compare expected.json out/floor.mcap --tolerance-m 0.1 --tolerance-deg 1

exit status: 0 no difference; 1 something differs; 2 bad usage, or a report that cannot be read; 3 the list could not be
written, or a bug; 130 interrupted
"""

_TOLERANCES = (
    ("--tolerance-m", "METRES", "0.05", "of positions"),
    ("--tolerance-deg", "DEGREES", "0.5", "of turns"),
    ("--tolerance-share", "SHARE", "0.02", "of acceptance, confidence and scale"),
    ("--tolerance-area", "SHARE", "0.05", "of overlaps, as a share of the larger one"),
    ("--tolerance-s", "SECONDS", "1", "of when a robot was merged first, since the first map"),
)


def add_flags(parser: argparse.ArgumentParser) -> None:
    """Add both runs, and the tolerances."""
    parser.add_argument("before", metavar="A", type=Path, help="the run to compare with: OUT.json or OUT.mcap")
    parser.add_argument("after", metavar="B", type=Path, help="the run to look at: OUT.json or OUT.mcap")
    group = parser.add_argument_group("what may differ")
    for flag, metavar, default, what in _TOLERANCES:
        group.add_argument(flag, metavar=metavar, default=default, help=f"{what} (default: %(default)s)")
    parser.add_argument("--json", action="store_true", help="print the differences as JSON")


def run(options: argparse.Namespace) -> int:
    """Compare, and say what differs."""
    tolerances = [at_least_0(flag, getattr(options, _name(flag))) for flag, *_ in _TOLERANCES]

    from replay.comparison.differences import Tolerance, compare
    from replay.comparison.words import json_text, lines
    from replay.report_file import read_report
    from replay.run_result import RunResult

    before, after = (RunResult.of(read_report(path), path) for path in (options.before, options.after))
    comparison = compare(before, after, Tolerance(*tolerances))
    with printing():
        if options.json:
            write_json(json_text(comparison))
        else:
            for line in lines(comparison, options.before, options.after):
                print(plain(line))
    return EXIT_DIFFERS if comparison.differences else EXIT_DONE


def _name(flag: str) -> str:
    return flag.removeprefix("--").replace("-", "_")
