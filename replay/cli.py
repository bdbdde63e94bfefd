"""The command line: thin over the library, and the one place that turns errors into a line and an exit status."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

from replay import __version__, interrupts
from replay.arguments import output_options, parser, recovery_paths, run_options
from replay.errors import OutputError, ReplayError
from replay.plain_text import plain

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
    try:
        options = parser().parse_args(arguments)
        return _COMMANDS[options.command](options)
    except ReplayError as error:
        print(f"replay: error: {plain(str(error))}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        print("replay: interrupted; nothing was written", file=sys.stderr)
        return EXIT_INTERRUPTED
    except MemoryError:
        print(
            "replay: error: there is not enough memory; close other programs, or leave out what needs too much with "
            "--max-memory SIZE (of merge and info)",
            file=sys.stderr,
        )
        return EXIT_BAD_INPUT
    except BrokenPipeError:
        # Whoever read our output has gone, and the files were written before any of it was printed; this keeps Python
        # from complaining at exit.
        _drop_output()
        return EXIT_DONE
    except SystemExit:
        raise
    except BaseException:  # noqa: BLE001 - a bug, or a panic of Rust below, must still end with a status and a word
        import traceback

        traceback.print_exc()
        print(f"replay: this is a bug in replay {__version__}; please report it with the lines above", file=sys.stderr)
        return EXIT_FAILED


def _drop_output() -> None:
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


@contextmanager
def _printing() -> Iterator[None]:
    """Say of output that cannot be written, to a full disk say, that it is not there."""
    try:
        yield
        sys.stdout.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        _drop_output()
        raise OutputError(f"standard output: cannot be written: {error.strerror}") from error


def _merge(options: argparse.Namespace) -> int:
    run = run_options(options)
    outputs = output_options(options, run)

    from replay.outputs import refuse_outputs

    refuse_outputs(outputs, [item.path for item in run.runs])

    import cv2

    from replay.pipeline import drain, events
    from replay.plan import open_plan
    from replay.sinks import open_sinks
    from replay.sinks.terminal import Narrator, ProgressSink, open_console

    cv2.setNumThreads(1)  # the threads are our own, see --jobs
    notes = open_console(stderr=True)
    with open_plan(run) as plan:
        narrator = Narrator(notes, announce=run.robots is None, unused_topics=plan.unused_topics())
        with open_sinks(outputs, (ProgressSink(notes), narrator), say=narrator.say) as sinks:
            report = drain(events(plan, run), sinks, run.jobs).report
    try:
        _tell(report, outputs, narrator, as_json=options.json)
    except KeyboardInterrupt:
        print("replay: interrupted; the outputs are written", file=sys.stderr)
        return EXIT_INTERRUPTED
    return EXIT_NOT_ALL_MERGED if options.require_all and not _all_merged(report) else EXIT_DONE


def _tell(report: Report, outputs: OutputOptions, narrator: Narrator, *, as_json: bool) -> None:
    """Print what came of it, once it is all written."""
    from replay.sinks import output_paths
    from replay.sinks.json_file import report_text
    from replay.sinks.terminal import open_console, print_table

    with _printing():
        if as_json:
            sys.stdout.write(report_text(report))
        else:
            print_table(open_console(), report)
    narrator.sum_up(report, [str(path) for path in output_paths(outputs).values()])


def _all_merged(report: Report) -> bool:
    """Tell whether there was something to merge and all of it was."""
    statuses = [robot["status"] for robot in report["robots"].values()]
    return len(statuses) > 1 and all(status in ("reference", "merged") for status in statuses)


def _info(options: argparse.Namespace) -> int:
    from replay.info import lines, summarise

    summary = summarise(run_options(options))
    with _printing():
        for line in lines(summary):
            print(plain(line))
    return EXIT_DONE


def _recover(options: argparse.Namespace) -> int:
    from replay.recover import recover

    damaged, output = recovery_paths(options)
    found = recover(damaged, output, force=options.force)
    for line in found.lines():
        print(f"replay: {line}", file=sys.stderr)
    return EXIT_DONE


_COMMANDS: dict[str, Callable[[argparse.Namespace], int]] = {"merge": _merge, "info": _info, "recover": _recover}


if __name__ == "__main__":
    sys.exit(main())
