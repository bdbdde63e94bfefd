"""`replay merge`: the main job."""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from typing import TYPE_CHECKING

from replay.errors import UsageError
from replay.exit_status import EXIT_DIFFERS, EXIT_DONE, interrupted_late
from replay.flags import inputs, outputs, placing, rules
from replay.standard_streams import printing, takes

if TYPE_CHECKING:
    from replay.events import Report
    from replay.options import OutputOptions
    from replay.sinks.terminal import Narrator

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

exit status: 0 done; 1 a robot was not merged and --require-all was given; 2 bad usage or input;
3 an output could not be written, or a bug; 130 interrupted
"""


def add_flags(parser: argparse.ArgumentParser) -> None:
    """Add recordings, and all flags of a run."""
    inputs.add(parser)
    placing.add(parser)
    outputs.add(parser)
    strictness = rules.add(parser)
    strictness.add_argument(
        "--require-all", action="store_true", help="exit with 1 unless two robots or more were merged, all"
    )


def run(options: argparse.Namespace) -> int:
    """Merge, write the outputs, and print what came of it."""
    run = inputs.run_options(options)
    written = outputs.output_options(options, run)

    from replay.outputs import refuse_outputs

    refuse_outputs(written, [item.path for item in run.runs])
    if options.view and options.no_rrd:
        raise UsageError("--view shows the Rerun recording, which --no-rrd leaves out; give one of them")
    if options.view:
        from replay import viewer

        viewer.refuse_without_screen(viewer.INSTEAD_OF_LIVE)

    import cv2

    from replay.pipeline import drain, events
    from replay.plan import open_plan
    from replay.sinks import open_sinks
    from replay.sinks.terminal import Narrator, ProgressSink, open_notes

    cv2.setNumThreads(1)  # the threads are our own, see --jobs
    notes = open_notes()
    narrator = Narrator(notes, announce=run.robots is None)
    try:
        with open_plan(run) as plan:
            refuse_outputs(written, plan.files())
            narrator.unused_topics = plan.unused_topics()
            if options.view:
                written = replace(written, live_url=viewer.open_live())
            with open_sinks(written, (ProgressSink(notes), narrator), say=narrator.say) as sinks:
                report = drain(events(plan, run), sinks, run.jobs).report
        status = EXIT_DIFFERS if options.require_all and not _all_merged(report) else EXIT_DONE
        _tell(report, written, narrator, as_json=options.json)
    except KeyboardInterrupt:
        if not narrator.is_published:
            raise
        return interrupted_late()
    return status


def _tell(report: Report, written: OutputOptions, narrator: Narrator, *, as_json: bool) -> None:
    """Print what came of it, once it is all written."""
    from replay.sinks import output_paths
    from replay.sinks.json_file import report_text
    from replay.sinks.terminal import table_text

    with printing():
        text = report_text(report) if as_json else table_text(report)
        if as_json and not takes(text):
            text = report_text(report, is_ascii=True)
        sys.stdout.write(text)
    narrator.sum_up(report, [str(path) for path in output_paths(written).values()])


def _all_merged(report: Report) -> bool:
    """Tell whether there was something to merge and all of it was."""
    statuses = [robot["status"] for robot in report["robots"].values()]
    return len(statuses) > 1 and all(status in ("reference", "merged") for status in statuses)
