"""`replay check`: whether a run comes out as expected."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from replay.exit_status import EXIT_DIFFERS, EXIT_DONE, interrupted_late
from replay.flags import expected, inputs, outputs, placing, rules, talk
from replay.standard_streams import printing, say, takes, write_json

if TYPE_CHECKING:
    from collections.abc import Sequence

    from replay.checks.findings import Finding
    from replay.events import Report
    from replay.run_merge import Run
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


def add_flags(parser: argparse.ArgumentParser) -> None:
    """Add recordings, all flags of a run, and those of what is expected."""
    inputs.add(parser)
    expected.add(parser)
    placing.add(parser)
    outputs.add(parser)
    rules.add(parser)
    talk.add(parser)


def run(options: argparse.Namespace) -> int:
    """Merge, and say what is not as expected."""
    inputs.refuse_no_runs(options)
    expected.refuse_unfit(options)
    checked = _Checked(options)
    try:
        return _write_expectation(checked) if options.write_expect is not None else _check(checked)
    except KeyboardInterrupt:
        if not checked.is_written:
            raise
        return interrupted_late()


class _Checked:
    """The run that is checked: one that is made now, or was made before."""

    def __init__(self, options: argparse.Namespace) -> None:
        self.options = options
        self._merging: Run | None = None

    @property
    def is_written(self) -> bool:
        """Whether all outputs of a run that was made now have their names."""
        return self._merging is not None and self._merging.narrator.is_published

    def result(self) -> tuple[RunResult, Report]:
        """Return what came of the run."""
        from replay.report_file import read_report
        from replay.run_result import RunResult

        path = Path(self.options.runs[0])
        report = read_report(path) if expected.is_made_before(self.options) else self._merged()
        return RunResult.of(report, path), report

    def _merged(self) -> Report:
        from replay.run_merge import Run
        from replay.sinks import output_paths

        options = self.options
        if options.output is None:
            options.images = options.trajectories = "none"
        run_options = inputs.run_options(options)
        written = None if options.output is None else outputs.output_options(options, run_options)
        merging = Run(run_options, written, talk.of(options), options.color, is_shown=options.view)
        self._merging = merging
        report = merging.merge()
        paths = output_paths(written).values() if written is not None else ()
        merging.narrator.sum_up(report, [str(path) for path in paths])
        return report


def _check(checked: _Checked) -> int:
    from replay.checks.expectation import load_expectation
    from replay.checks.findings import findings

    told = expected.told_files(checked.options)
    with told.telling_errors():
        expectation = load_expectation(checked.options.expect)  # before anything long begins
        result, report = checked.result()
        found = findings(expectation, result)
    try:
        told.write(found)
    finally:
        _print(found, report, checked.options)
    return EXIT_DONE if all(item.holds for item in found) else EXIT_DIFFERS


def _write_expectation(checked: _Checked) -> int:
    from replay.checks.write_expectation import expectation_text
    from replay.written_files import write_files

    path: Path = checked.options.write_expect
    expected.told_files(checked.options)
    result, _ = checked.result()
    write_files({path: expectation_text(result).encode()}, force=checked.options.force)
    say(f"replay: wrote {path}; look at it, and give it with --expect")
    return EXIT_DONE


def _print(found: Sequence[Finding], report: Report, options: argparse.Namespace) -> None:
    from replay.checks.words import FAILS, HOLDS, failing, lines
    from replay.sinks.json_file import report_text

    with printing():
        if options.json or options.quiet:
            if options.json:
                write_json(report_text(report))
            for line in failing(found):
                say(f"replay: {line}")
            return
        for line in lines(found, is_ascii=not takes(HOLDS + FAILS)):
            print(line)
