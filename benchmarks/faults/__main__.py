"""The command: tries faults and prints how they ended."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from time import monotonic

from benchmarks.faults.cases import Case, Task, cases
from benchmarks.faults.formats import FORMATS
from benchmarks.faults.oracle import FAILURES
from benchmarks.faults.pool import Done, Worker, run_all
from benchmarks.faults.printed import Counts
from benchmarks.faults.table import FAULTS
from benchmarks.faults.whole_runs import tried
from benchmarks.flags import count, count_or_none, folder, size

TRIES = 10_000
WHOLE_RUNS = "whole runs"
_PROGRAM_EVERY = 20


@dataclass(frozen=True, slots=True)
class Options:
    """What is tried.

    Parameters
    ----------
    seconds
        After so long nothing new is begun; None for no limit.
    runs
        How often each misfortune of a whole run is tried.
    keep
        Folder for variants that failed; None for none.
    """

    tries: int = TRIES
    seconds: float | None = None
    seed: int = 0
    formats: Sequence[str] = tuple(FORMATS)
    faults: Sequence[str] = tuple(FAULTS)
    jobs: int = 1
    runs: int = 0
    keep: Path | None = None


def main(arguments: Sequence[str] | None = None) -> int:
    """Try what was asked for and return 1 if something failed, else 0."""
    given = vars(_parser().parse_args(arguments))
    by_format, name = given.pop("by_format"), given.pop("replay")
    options = Options(**given)
    if name is not None:
        return repeat(Case.named(name, options.seed), options.keep)
    counts = measured(options)
    for lines in (counts.lines(), *((counts.lines_of_formats(),) if by_format else ())):
        print("", *lines, sep="\n")
    print(f"\n{'FAILS' if counts.failures else 'holds'}  crashed, hung or wrong, of {counts.tries}: {counts.failures}")
    return 1 if counts.failures else 0


def measured(options: Options) -> Counts:
    """Try faults, say which failed as they do, and count."""
    counts = Counts()
    for done in run_all(_tasks(options), options.jobs):
        if done.judged is None:
            continue
        counts.add(done.task.case, done.judged.verdict, done.took_s)
        if done.judged.verdict in FAILURES:
            _say(done, options)
    for name, judged in tried(options.runs, options.seed):
        counts.add(Case(WHOLE_RUNS, name, 0), judged.verdict)
        if judged.verdict in FAILURES:
            print(f"{judged.verdict}: {name}: {judged.why}", flush=True)
    return counts


def repeat(case: Case, keep: Path | None) -> int:
    """Try one case and say all that is known of it; its recording stays in a folder if one is given."""
    folder = None if keep is None else keep / case.name.replace("/", "_")
    worker = Worker()
    judged = worker.run(Task(case, program=True, folder=folder))
    worker.close()
    print(f"{case.name}: {judged.verdict}\n{judged.why}" if judged else f"{case.name}: this fault is not to be had")
    return 1 if judged and judged.verdict in FAILURES else 0


def _tasks(options: Options) -> Iterator[Task]:
    end = None if options.seconds is None else monotonic() + options.seconds
    for index, case in enumerate(islice(cases(options.formats, options.faults, options.seed), options.tries)):
        if end is not None and monotonic() > end:
            return
        yield Task(case, program=index % _PROGRAM_EVERY == 0)


def _say(done: Done, options: Options) -> None:
    if done.judged is None:
        return
    case = done.task.case
    print(f"{done.judged.verdict}: --seed {case.seed} --replay {case.name}: {done.judged.why}", flush=True)
    variant = case.variant() if options.keep else None
    if options.keep is not None and variant is not None:
        variant.recording.write(options.keep / case.name.replace("/", "_"))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.faults", description="What becomes of damaged, hostile and unlucky input."
    )
    parser.add_argument("--tries", type=count, default=TRIES, help="how many variants; %(default)s by default")
    parser.add_argument("--seconds", type=size, help="begin nothing new after so long")
    parser.add_argument("--seed", type=int, default=0, help="the same variants for the same seed")
    parser.add_argument("--formats", nargs="+", choices=tuple(FORMATS), default=tuple(FORMATS), metavar="FORMAT")
    parser.add_argument("--faults", nargs="+", choices=tuple(FAULTS), default=tuple(FAULTS), metavar="FAULT")
    parser.add_argument("--jobs", type=count, default=os.cpu_count() or 1, help="how many processes work at once")
    parser.add_argument(
        "--runs", type=count_or_none, default=0, help="how often whole runs are killed, starved and so on"
    )
    parser.add_argument("--keep", type=folder, metavar="FOLDER", help="folder for variants that failed")
    parser.add_argument("--by-format", action="store_true", help="print a table of formats as well")
    parser.add_argument("--replay", metavar="CASE", help="try one again, such as mcap_zstd/truncated/17")
    return parser


if __name__ == "__main__":
    sys.exit(main())
