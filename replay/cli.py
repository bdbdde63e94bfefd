"""The command line: thin over the library, and the one place that turns errors into a line and an exit status."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from replay import __version__, interrupts, standard_streams
from replay.arguments import output_options, parser, recovery_paths, run_options
from replay.errors import ReplayError
from replay.plain_text import plain
from replay.standard_streams import printing, quiet_stderr, say, takes

if TYPE_CHECKING:
    from replay.events import Report
    from replay.options import OutputOptions
    from replay.sinks.terminal import Narrator

EXIT_DONE = 0
EXIT_NOT_ALL_MERGED = 1
EXIT_BAD_INPUT = 2
EXIT_FAILED = 3
EXIT_INTERRUPTED = 130


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the program and return its exit status."""
    interrupts.listen()
    standard_streams.prepare()
    try:
        options = _parsed(arguments)
        return _COMMANDS[options.command](options)
    except ReplayError as error:
        say(f"replay: error: {plain(str(error))}")
        return error.exit_code
    except KeyboardInterrupt:
        say("replay: interrupted; nothing was written")
        return EXIT_INTERRUPTED
    except MemoryError:
        say(
            "replay: error: there is not enough memory; close other programs, or leave out what needs too much with "
            "--max-memory SIZE (of merge and info)"
        )
        return EXIT_BAD_INPUT
    except SystemExit:
        raise
    except BaseException:  # noqa: BLE001 - a bug, or a panic of Rust below, must still end with a status and a word
        import traceback

        traceback.print_exc(file=quiet_stderr())
        say(f"replay: this is a bug in replay {__version__}; please report it with the lines above")
        return EXIT_FAILED


def _parsed(arguments: Sequence[str] | None) -> argparse.Namespace:
    try:
        return parser().parse_args(arguments)
    except SystemExit:
        quiet_stderr().flush()  # what was printed may wait still, and could not be written at exit
        with printing():
            pass
        raise


def _merge(options: argparse.Namespace) -> int:
    run = run_options(options)
    outputs = output_options(options, run)

    from replay.outputs import refuse_outputs

    refuse_outputs(outputs, [item.path for item in run.runs])

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
            refuse_outputs(outputs, plan.files())
            narrator.unused_topics = plan.unused_topics()
            with open_sinks(outputs, (ProgressSink(notes), narrator), say=narrator.say) as sinks:
                report = drain(events(plan, run), sinks, run.jobs).report
        status = EXIT_NOT_ALL_MERGED if options.require_all and not _all_merged(report) else EXIT_DONE
        _tell(report, outputs, narrator, as_json=options.json)
    except KeyboardInterrupt:
        if not narrator.is_published:
            raise
        return _interrupted_late()
    return status


def _tell(report: Report, outputs: OutputOptions, narrator: Narrator, *, as_json: bool) -> None:
    """Print what came of it, once it is all written."""
    from replay.sinks import output_paths
    from replay.sinks.json_file import report_text
    from replay.sinks.terminal import table_text

    with printing():
        text = report_text(report) if as_json else table_text(report)
        if as_json and not takes(text):
            text = report_text(report, is_ascii=True)
        sys.stdout.write(text)
    narrator.sum_up(report, [str(path) for path in output_paths(outputs).values()])


def _all_merged(report: Report) -> bool:
    """Tell whether there was something to merge and all of it was."""
    statuses = [robot["status"] for robot in report["robots"].values()]
    return len(statuses) > 1 and all(status in ("reference", "merged") for status in statuses)


def _info(options: argparse.Namespace) -> int:
    from replay.info import lines, summarise

    summary = summarise(run_options(options))
    with printing():
        for line in lines(summary):
            print(plain(line))
    return EXIT_DONE


def _recover(options: argparse.Namespace) -> int:
    from replay.recover import recover

    damaged, output = recovery_paths(options)
    found = recover(damaged, output, force=options.force)
    try:
        for line in found.lines():
            say(f"replay: {plain(line)}")
    except KeyboardInterrupt:
        return _interrupted_late()
    return EXIT_DONE


def _interrupted_late() -> int:
    say("replay: interrupted; the outputs are written")
    return EXIT_INTERRUPTED


_COMMANDS: dict[str, Callable[[argparse.Namespace], int]] = {"merge": _merge, "info": _info, "recover": _recover}


if __name__ == "__main__":
    sys.exit(main())
