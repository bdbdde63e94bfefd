"""The command line: thin over the library, and the one place that turns errors into a line and an exit status."""

from __future__ import annotations

import argparse
import os
import signal
import sys
import threading
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NoReturn

from replay import __version__
from replay.arguments import output_options, parser, run_options
from replay.errors import OutputError, ReplayError, UsageError
from replay.plain_text import plain

if TYPE_CHECKING:
    from replay.events import Report
    from replay.options import OutputOptions, RunOptions

EXIT_DONE = 0
EXIT_NOT_ALL_MERGED = 1
EXIT_BAD_INPUT = 2
EXIT_FAILED = 3
EXIT_INTERRUPTED = 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program and return its exit status."""
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, _terminate)
    try:
        status = _dispatch(parser().parse_args(arguments))
        sys.stdout.flush()
        return status
    except ReplayError as error:
        print(f"replay: error: {plain(str(error))}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        print("replay: interrupted; nothing was written", file=sys.stderr)
        return EXIT_INTERRUPTED
    except BrokenPipeError:
        # Whoever read our output has gone, and the files were written before any of it was printed; this keeps Python
        # from complaining at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return EXIT_DONE
    except Exception:  # noqa: BLE001 - a bug of ours must still end with a status and a word
        import traceback

        traceback.print_exc()
        print(f"replay: this is a bug in replay {__version__}; please report it with the lines above", file=sys.stderr)
        return EXIT_FAILED


def _terminate(_number: int, _frame: object) -> NoReturn:
    raise KeyboardInterrupt


def _dispatch(options: argparse.Namespace) -> int:
    return _info(options) if options.command == "info" else _merge(options)


def _refuse_outputs(outputs: OutputOptions, run: RunOptions) -> None:
    """Refuse outputs that exist, that are inputs, or that have no folder."""
    from replay.sinks import output_paths
    from replay.sinks.partial_file import PartialFile

    paths = output_paths(outputs).values()
    inputs = {item.path.resolve() for item in run.runs}
    for path in (name for final in paths for name in (final, PartialFile(final).partial)):
        if {path.resolve(), path.resolve().parent} & inputs:
            raise UsageError(f"{path} is an input, or would be written into one; give another name with --output")
    existing = [str(path) for path in output_paths(replace(outputs, rrd=True)).values() if path.exists()]
    if existing and not outputs.force:
        raise UsageError(f"there is already {', '.join(existing)}; give --force to replace, or another --output")
    for path in paths:
        if path.is_dir():
            raise OutputError(f"{path}: a folder has this name; remove it, or give another --output")
    if not outputs.mcap.absolute().parent.is_dir():
        raise OutputError(f"{outputs.mcap.absolute().parent}: there is no such folder; make it, or choose another")


def _merge(options: argparse.Namespace) -> int:
    run = run_options(options)
    outputs = output_options(options, run)
    _refuse_outputs(outputs, run)

    import cv2

    from replay.pipeline import drain, events
    from replay.plan import open_plan
    from replay.sinks import open_sinks, output_paths
    from replay.sinks.json_file import report_text
    from replay.sinks.partial_file import output_errors
    from replay.sinks.terminal import Narrator, ProgressSink, open_console, print_table

    cv2.setNumThreads(1)  # the threads are our own, see --jobs
    notes = open_console(stderr=True)
    with open_plan(run) as plan:
        narrator = Narrator(notes, announce=run.robots is None, unused_topics=plan.unused_topics())
        with open_sinks(outputs, extra=(ProgressSink(notes), narrator)) as sinks:
            report = drain(events(plan, run), sinks, run.jobs).report
    if not outputs.rrd:
        # one of an earlier run, which --force replaces, must not stand beside these outputs
        stale = outputs.mcap.with_suffix(".rrd")
        with output_errors(stale):
            stale.unlink(missing_ok=True)
    if options.json:
        sys.stdout.write(report_text(report))
    else:
        print_table(open_console(), report)
    narrator.sum_up(report, [str(path) for path in output_paths(outputs).values()])
    return EXIT_NOT_ALL_MERGED if options.require_all and not _all_merged(report) else EXIT_DONE


def _all_merged(report: Report) -> bool:
    """Tell whether there was something to merge and all of it was."""
    statuses = [robot["status"] for robot in report["robots"].values()]
    return len(statuses) > 1 and all(status in ("reference", "merged") for status in statuses)


def _info(options: argparse.Namespace) -> int:
    from replay.info import lines, summarise

    summary = summarise(run_options(options))
    for line in lines(summary):
        print(plain(line))
    return EXIT_DONE


if __name__ == "__main__":
    sys.exit(main())
