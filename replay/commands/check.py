"""`replay check`: whether a run comes out as expected."""

from __future__ import annotations

import argparse
import sys
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from replay.errors import InputError, OutputError, ReplayError, UsageError
from replay.exit_status import EXIT_DIFFERS, EXIT_DONE, interrupted_late
from replay.flags import inputs, outputs, placing, rules, talk
from replay.standard_streams import printing, say, takes

if TYPE_CHECKING:
    from collections.abc import Sequence

    from replay.checks.findings import Finding
    from replay.events import Report
    from replay.options import OutputOptions
    from replay.run_result import RunResult

USAGE = "RUN [RUN ...] --expect EXPECT.yaml [options]"
DESCRIPTION = """\
Merge recordings as `replay merge` does, and hold the outcome against what is expected: who is merged, where,
how surely and how soon. Nothing is merged if RUN is an OUT.json or OUT.mcap of a run that was made before.
Of a run, only what is asked for is written: with --output what `replay merge` writes.
"""
EPILOG = """\
An expectation says for each robot what is to become of it, and of what is to be merged where and how surely:

  robots:
    r1: reference
    r2:
      status: merged
      pose: {x_m: 28.16, y_m: 0.9, yaw_deg: 124.9}
      min_acceptance: 0.95
      merged_within_s: 240

--write-expect writes one from a run. All keys are in docs/ci.md, with an example for GitHub Actions.

examples:
  replay check run.mcap --robots r1,r2 --write-expect expect.yaml
  replay check run.mcap --robots r1,r2 --expect expect.yaml
  replay check run.mcap --expect expect.yaml --junit replay.xml --summary "$GITHUB_STEP_SUMMARY"
  replay check out/floor.json --expect expect.yaml

exit status: 0 all is as expected, or the expectation is written; 1 something is not; 2 bad usage or input;
3 an output could not be written, or a bug; 130 interrupted
"""

_SAVED_MAPS = (".yaml", ".yml")
_OF_NO_MERGE = ("positional arguments", "what is expected", "what is said")
"""The groups of flags that say something of a run that was made before."""


def add_flags(parser: argparse.ArgumentParser) -> None:
    """Add recordings, all flags of a run, and those of what is expected."""
    inputs.add(parser)
    add_expected(parser)
    placing.add(parser)
    outputs.add(parser)
    rules.add(parser)
    talk.add(parser)


def add_expected(parser: argparse.ArgumentParser) -> None:
    """Add the flags of what is expected."""
    group = parser.add_argument_group("what is expected")
    group.add_argument("--expect", metavar="EXPECT.yaml", type=Path, help="hold the outcome against this")
    group.add_argument(
        "--write-expect", metavar="EXPECT.yaml", type=Path, help="write what this run meets, with some leeway"
    )
    group.add_argument("--junit", metavar="OUT.xml", type=Path, help="write the findings as JUnit XML; replaces it")
    group.add_argument("--summary", metavar="FILE", help="append the findings to this file as Markdown")


def run(options: argparse.Namespace) -> int:
    """Merge, and say what is not as expected."""
    inputs.refuse_no_runs(options)
    if (options.expect is None) == (options.write_expect is None):
        raise UsageError("give either --expect EXPECT.yaml or --write-expect EXPECT.yaml")
    if options.write_expect is not None and (options.junit or options.summary or options.json):
        raise UsageError("--junit, --summary and --json tell what was found: give them with --expect")
    _refuse_useless(options)
    try:
        return _write_expectation(options) if options.write_expect is not None else _check(options)
    except KeyboardInterrupt:
        if not getattr(options, "is_published", lambda: False)():
            raise
        return interrupted_late()


def _check(options: argparse.Namespace) -> int:
    from replay.checks.expectation import load_expectation
    from replay.checks.findings import findings

    _refuse_files(options)
    try:
        expectation = load_expectation(options.expect)  # before anything long begins
        result, report = _result(options)
        found = findings(expectation, result)
        _write_findings(found, options)
    except ReplayError as error:
        if not isinstance(error, OutputError):
            _write_error(str(error), options)
        raise
    _tell(found, report, options)
    return EXIT_DONE if all(item.holds for item in found) else EXIT_DIFFERS


def _write_expectation(options: argparse.Namespace) -> int:
    from replay.checks.write_expectation import expectation_text
    from replay.written_files import write_files

    path: Path = options.write_expect
    _refuse_files(options)
    result, _ = _result(options)
    write_files({path: expectation_text(result).encode()}, force=options.force)
    say(f"replay: wrote {path}; look at it, and give it with --expect")
    return EXIT_DONE


def _result(options: argparse.Namespace) -> tuple[RunResult, Report]:
    """Return what came of the run, made now or before."""
    from replay.report_file import holds_report, read_report
    from replay.run_result import RunResult

    path = Path(options.runs[0]) if options.runs else Path()  # without one, the error is that of any command
    if len(options.runs) == 1 and holds_report(path):
        report = read_report(path)
        return RunResult.of(report, path), report
    report = _merged(options)
    return RunResult.of(report, path), report


def _refuse_useless(options: argparse.Namespace) -> None:
    """Refuse flags that say how to merge, or what to write of that, where nothing is merged."""
    from replay.arguments import command_parser
    from replay.report_file import holds_report

    try:
        if len(options.runs) != 1 or not holds_report(Path(options.runs[0])):
            return
    except InputError:  # what cannot be read is refused where it is read
        return
    served = "json" if options.write_expect is None else "force"
    useless = [
        action.option_strings[-1]
        for title, action in command_parser("check").grouped()
        if title not in _OF_NO_MERGE and action.dest in options.given and action.dest != served
    ]
    if useless:
        run = options.runs[0]
        raise UsageError(f"{', '.join(useless)}: {run} is a run that was made before: nothing is merged")


def _merged(options: argparse.Namespace) -> Report:
    from replay.run_merge import Run
    from replay.sinks import output_paths

    written = _written(options)
    if written is None:
        options.images = options.trajectories = "none"
    run_options = inputs.run_options(options)
    merging = Run(run_options, written, talk.of(options), options.color, is_shown=options.view)
    options.is_published = lambda: written is not None and merging.narrator.is_published
    report = merging.merge()
    paths = output_paths(written).values() if written is not None else ()
    merging.narrator.sum_up(report, [str(path) for path in paths])
    return report


def _written(options: argparse.Namespace) -> OutputOptions | None:
    """Return what is written of the run; None for nothing."""
    if options.output is None:
        if options.report is not None:
            raise UsageError("--report stands beside what else a run writes: give --output OUT.mcap as well")
        return None
    return outputs.output_options(options, inputs.run_options(options))


def _inputs(options: argparse.Namespace) -> list[Path]:
    """Return what is read, with the images of saved maps."""
    from replay.runs import RunPath
    from replay.sources import open_source

    paths = [RunPath.parse(text).path for text in options.runs]
    for path in [each for each in paths if each.suffix in _SAVED_MAPS]:
        with suppress(ReplayError), open_source(path) as source:  # what cannot be read is refused when it is merged
            paths += source.files
    return [*paths, *(path for path in (options.expect, options.config) if path is not None)]


def _refuse_files(options: argparse.Namespace) -> None:
    """Refuse files that could not be written in the end, or would replace what is read or what else is written."""
    from replay.outputs import refuse_alike, refuse_inputs
    from replay.sinks import reserved_paths
    from replay.written_files import refuse_files, reserved_names

    if options.summary == "":
        raise UsageError('--summary: the name is empty; is the variable set, as "$GITHUB_STEP_SUMMARY" is in a job?')
    summary = Path(options.summary) if options.summary else None
    paths = [path for path in (options.write_expect, options.junit) if path is not None]
    appended = [summary] if summary is not None else []
    refuse_files([*paths, *appended], _inputs(options), force=options.force or options.write_expect is None)
    written = _written(options)
    if written is not None:
        if options.expect is not None:
            refuse_inputs(reserved_paths(written), [options.expect])
        refuse_alike([reserved_paths(written), *map(reserved_names, paths), appended])


def _write_findings(found: Sequence[Finding], options: argparse.Namespace) -> None:
    from replay.checks.junit import junit_xml
    from replay.checks.words import summary
    from replay.written_files import write_files

    title = ", ".join(Path(text).name for text in options.runs)
    if options.junit is not None:
        write_files({options.junit: junit_xml(found, title)}, force=True)
    _append_summary(summary(found, title), options)


def _write_error(message: str, options: argparse.Namespace) -> None:
    """Say where the findings would stand why there are none: a job that ends red is to tell why."""
    from replay.checks.junit import junit_error_xml
    from replay.checks.words import error_summary
    from replay.written_files import write_files

    title = ", ".join(Path(text).name for text in options.runs)
    if options.junit is not None:
        write_files({options.junit: junit_error_xml(message, title)}, force=True)
    _append_summary(error_summary(message, title), options)


def _append_summary(text: str, options: argparse.Namespace) -> None:
    from replay.sinks.partial_file import output_errors

    if options.summary:
        path = Path(options.summary)
        with output_errors(path), path.open("a", encoding="utf-8") as file:
            file.write(text)


def _tell(found: Sequence[Finding], report: Report, options: argparse.Namespace) -> None:
    from replay.checks.words import FAILS, HOLDS, failing, lines
    from replay.sinks.json_file import report_text

    with printing():
        if options.json or options.quiet:
            text = report_text(report) if options.json else ""
            sys.stdout.write(text if takes(text) else report_text(report, is_ascii=True))
            for line in failing(found):
                say(f"replay: {line}")
            return
        for line in lines(found, is_ascii=not takes(HOLDS + FAILS)):
            print(line)
