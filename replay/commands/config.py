"""`replay config`: the settings that a command line comes to, as a file that can be given to a run."""

from __future__ import annotations

import argparse

from replay.exit_status import EXIT_DONE
from replay.flags import inputs, outputs, placing, rules
from replay.standard_streams import printing, write_toml

USAGE = "[RUN ...] [options]"
DESCRIPTION = """\
Print all settings as a run with these arguments would have them, in TOML, each with what it is for
and whether it is the default. Save them as a file, and give that to a run with --config.
"""
EPILOG = """\
examples:
  replay config > replay.toml                        all defaults, to be changed
  replay config run.mcap --robots r1,r2 --images none > mission.toml && replay merge --config mission.toml
  replay config --from out/floor.json --changed      what a run was told
  replay config --set merge.verify.min_overlap_m2=4 --changed

exit status: 0 printed; 2 bad usage, or a setting that there is not; 3 standard output cannot be written, or a bug
"""


def add_flags(parser: argparse.ArgumentParser) -> None:
    """Add all that are settings of some command."""
    from replay.flags import expected

    inputs.add(parser, "--from")
    parser.add_argument("--changed", action="store_true", help="print only those that are not the default")
    placing.add(parser)
    outputs.add(parser)
    rules.add_all(parser)
    expected.add(parser)


def run(options: argparse.Namespace) -> int:
    """Print the settings."""
    from replay.arguments import command_parser
    from replay.settings.show import as_toml, shown_settings

    merge = inputs.run_options(options, needs_runs=False).merge
    shown = shown_settings(command_parser("config"), options, merge)
    text = as_toml([item for item in shown if item.is_changed or not options.changed])
    with printing():
        write_toml(text)
    return EXIT_DONE
