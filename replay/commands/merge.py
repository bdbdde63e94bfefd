"""`replay merge`: the main job."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING

from replay.exit_status import EXIT_DIFFERS, EXIT_DONE, interrupted_late
from replay.flags import inputs, outputs, placing, rules, talk
from replay.plain_text import listed, plain
from replay.standard_streams import printing, say, takes

if TYPE_CHECKING:
    from replay.events import Report

USAGE = "RUN [RUN ...] [options]"
DESCRIPTION = """\
Merge the maps of one or more recordings at each timestamp, and write the outcome to a new MCAP,
a Rerun recording and a JSON report.
"""
EPILOG = """\
examples:
  replay merge run.mcap --robots r1,r2       r1 is the reference: its map frame becomes the merged frame
  replay merge a=alpha.bag b=bravo/          one recording a robot, whatever its map topic is called
  replay merge run.mcap --topic '/{robot}/slam/map'
  replay merge run.mcap --start 60 --stop 300 --no-rrd --json
  replay merge run.mcap --init-pose r2=4.5,-1.2,90deg+-0.5,+-0.5,+-5deg
  replay merge --config mission.toml --start 120         all settings from a file, see `replay config`; flags win

exit status: 0 done; 1 a robot was not merged and --require-all was given; 2 bad usage or input;
3 an output could not be written, or a bug; 130 interrupted
"""


def add_flags(parser: argparse.ArgumentParser) -> None:
    """Add recordings, and all flags of a run."""
    inputs.add(parser)
    placing.add(parser)
    outputs.add(parser)
    rules.add_all(parser)
    talk.add(parser)


def run(options: argparse.Namespace) -> int:
    """Merge, write the outputs, and print what came of it."""
    run = inputs.run_options(options)
    written = outputs.output_options(options, run)

    from replay.run_merge import Run
    from replay.sinks import output_paths

    merging = Run(run, written, talk.of(options), options.color, is_shown=options.view)
    narrator = merging.narrator
    try:
        report = merging.merge()
        status = EXIT_DIFFERS if options.require_all and not _all_merged(report) else EXIT_DONE
        _print(report, options)
        narrator.sum_up(report, [str(path) for path in output_paths(written).values()])
        if status == EXIT_DIFFERS:
            say(f"replay: {_missing(report)}; --require-all makes that a failure")
    except KeyboardInterrupt:
        if not narrator.is_published:
            raise
        return interrupted_late()
    return status


def _print(report: Report, options: argparse.Namespace) -> None:
    """Print what was asked for of what came of it, once it is all written."""
    from replay.sinks.json_file import report_text
    from replay.sinks.terminal_table import table_text

    if options.quiet and not options.json:
        return
    with printing():
        text = report_text(report) if options.json else table_text(report, options.color)
        if options.json and not takes(text):
            text = report_text(report, is_ascii=True)
        sys.stdout.write(text)


def _missing(report: Report) -> str:
    """Return who is not merged."""
    left = [robot for robot, row in report["robots"].items() if row["merged_from_map"] is None]
    return f"not merged: {listed([plain(robot) for robot in left])}" if left else "there is only one map"


def _all_merged(report: Report) -> bool:
    """Tell whether there was something to merge and all of it was."""
    poses = [robot["merged_from_map"] for robot in report["robots"].values()]
    return len(poses) > 1 and None not in poses
