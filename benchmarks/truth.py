"""Placements against known truth: ``python -m benchmarks.truth``.

(a) recordings of real buildings, tick by tick; (b) simulated pairs of many kinds; (c) maps that others published.
Exits with 1 if a criterion fails. docs/benchmarks.md says what is measured, and what is held out of tuning.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import TypeVar

import cv2

from benchmarks import criteria, reports
from benchmarks.cases import cases
from benchmarks.criteria import Criterion
from benchmarks.data import data_folder
from benchmarks.distribution import distribution
from benchmarks.flags import count, new_file, share
from benchmarks.merged_sets import PairOutcome, SetOutcome, pair_outcomes, set_outcome
from benchmarks.methods import DEFAULT, names
from benchmarks.published import MapSet, map_sets
from benchmarks.recordings import RECORDINGS, Course, courses
from benchmarks.simulated import Result, results
from mapmerge.match import MATCHERS

PARTS = ("real", "simulated", "published")

_In = TypeVar("_In")
_Out = TypeVar("_Out")
_Rows = Sequence[Course | Result | SetOutcome | PairOutcome]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command."""
    options = _parser().parse_args(arguments)
    cv2.setNumThreads(1)
    folder = data_folder()
    if options.distribution:
        reports.show("Scores at the true placement", distribution(cases(options.share), folder))
        return 0
    methods = names() if options.compare else (options.method,)
    rows: list[_Rows] = []
    found: list[Criterion] = []
    for part in options.parts:
        if part == "simulated":
            measured, held = _simulated(options, methods)
        elif folder is None:
            print(
                f"{part}: not measured, for the maps are absent; set REPLAY_DATA to the folder that holds real/",
                file=sys.stderr,
            )
            continue
        else:
            measured, held = (_real if part == "real" else _published)(options, methods, folder)
        rows += measured
        found += held
    if options.json is not None:
        plain = {type(part[0]).__name__: [asdict(row) for row in part] for part in rows if part}
        options.json.write_text(json.dumps(plain, indent=1, default=str) + "\n", encoding="utf-8")
    reports.show("Held out of the fit", reports.held_out())
    reports.show(f"What must hold of {methods[0]}", criteria.lines(found))
    return 0 if all(item.holds for item in found) else 1


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else None)
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=PARTS, help="what to measure; all by default")
    parser.add_argument("--method", choices=names(), default=DEFAULT, help="which method")
    parser.add_argument("--compare", action="store_true", help="all methods and recipes side by side")
    parser.add_argument("--share", type=share, default=1.0, help="share of the simulated pairs, for a quick look")
    parser.add_argument("--processes", type=count, default=2, help="how many work at once")
    parser.add_argument("--distribution", action="store_true", help="only compare scores of simulated and real pairs")
    parser.add_argument("--json", type=new_file, help="write all results to this file")
    return parser


def _real(options: argparse.Namespace, methods: Sequence[str], folder: Path) -> tuple[list[_Rows], list[Criterion]]:
    """Measure part (a): only matchers can be given to the pipeline."""
    jobs = [(folder / "real" / name, method) for method in methods if method in MATCHERS for name in RECORDINGS]
    found = [course for part in _mapped(_courses, jobs, options.processes) for course in part]
    reports.show("(a) Real recordings", reports.course_table(found))
    return [found], criteria.of_recordings([course for course in found if course.method == methods[0]])


def _courses(job: tuple[Path, str]) -> list[Course]:
    return courses(*job)


def _simulated(options: argparse.Namespace, methods: Sequence[str]) -> tuple[list[_Rows], list[Criterion]]:
    """Measure part (b)."""
    found = list(_mapped(partial(results, methods=methods), cases(options.share), options.processes))
    flat = [result for part in found for result in part]
    first = [result for result in flat if result.method == methods[0]]
    reports.show_simulated(first, flat, methods)
    return [flat], criteria.of_simulation(first)


def _published(
    options: argparse.Namespace, methods: Sequence[str], folder: Path
) -> tuple[list[_Rows], list[Criterion]]:
    """Measure part (c)."""
    sets = map_sets(folder)
    jobs = [(maps, method) for method in methods for maps in sets]
    outcomes = _mapped(_set_outcome, [job for job in jobs if job[1] in MATCHERS], options.processes)
    pairs = [pair for part in _mapped(_pair_outcomes, jobs, options.processes) for pair in part]
    reports.show("(c) Published maps, merged together", reports.set_table(outcomes))
    reports.show("(c) Published maps, pair by pair", reports.pair_table(pairs))
    return [outcomes, pairs], criteria.of_sets([item for item in outcomes if item.method == methods[0]])


def _set_outcome(job: tuple[MapSet, str]) -> SetOutcome:
    return set_outcome(*job)


def _pair_outcomes(job: tuple[MapSet, str]) -> list[PairOutcome]:
    return pair_outcomes(*job)


def _mapped(work: Callable[[_In], _Out], jobs: Iterable[_In], processes: int) -> list[_Out]:
    """Return what the work makes of each job, in order, done by some processes of one thread each."""
    if processes == 1:
        return [work(job) for job in jobs]
    with get_context("spawn").Pool(processes, cv2.setNumThreads, (1,)) as pool:
        return list(pool.imap(work, jobs))


if __name__ == "__main__":
    sys.exit(main())
