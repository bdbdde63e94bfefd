"""What the default method must reach, and whether it does."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from benchmarks.merged_sets import SetOutcome
from benchmarks.recordings import Course
from benchmarks.simulated import Result
from benchmarks.tables import median_errors
from benchmarks.verdicts import Verdict

_SHARES = (("overlap of 0.5 and more", 0.5, 1.01, 0.95), ("overlap of 0.3 to 0.5", 0.3, 0.5, 0.85))
_MEDIAN_CELLS, _MEDIAN_DEG = 0.5, 0.1


@dataclass(frozen=True, slots=True)
class Criterion:
    """One thing that must hold."""

    name: str
    holds: bool
    found: str


def of_recordings(courses: Sequence[Course]) -> list[Criterion]:
    """Return what must hold of real recordings, part (a)."""
    late = [f"{item.recording} {item.robot}" for item in courses if item.late]
    wrong = [f"{item.recording} {item.robot}" for item in courses if item.wrong]
    return [
        Criterion("(a) each robot placed rightly once half of its overlap is there", not late, _listed(late)),
        Criterion("(a) nobody placed elsewhere, no stranger merged, at any tick", not wrong, _listed(wrong)),
    ]


def of_simulation(results: Sequence[Result]) -> list[Criterion]:
    """Return what must hold of simulated pairs, part (b)."""
    plain = [item for item in results if item.related == "same place" and not item.ambiguous]
    found: list[Criterion] = []
    for name, lo, hi, needed in _SHARES:
        inside = [item for item in plain if lo <= item.overlap < hi]
        placed = sum(item.verdict is Verdict.PLACED for item in inside)
        share = placed / len(inside) if inside else 0.0
        text = f"{placed} of {len(inside)}, {share:.0%}"
        found.append(Criterion(f"(b) at least {needed:.0%} placed at an {name}", share >= needed, text))
    clear = [item for item in results if not item.ambiguous]
    wrong = [item.name for item in clear if item.verdict in (Verdict.WRONG, Verdict.FALSE_MERGE)]
    found.append(Criterion(f"(b) no wrong or false merge in {len(clear)} clear pairs", not wrong, _listed(wrong)))
    unclear = [item for item in results if item.ambiguous]
    called = sum(item.reason == "ambiguous" for item in unclear)
    right = sum(item.verdict is Verdict.PLACED for item in unclear)
    astray = sum(item.verdict in (Verdict.WRONG, Verdict.INEXACT, Verdict.FALSE_MERGE) for item in unclear)
    text = f"{right} right, {called} called ambiguous, {astray} wrong, of {len(unclear)}"
    found.append(Criterion("(b) what is ambiguous by construction placed rightly or refused", astray == 0, text))
    medians = median_errors(plain)
    text = "nothing placed" if medians is None else f"{medians[2]:.3f}°, {medians[1]:.2f} cells"
    holds = medians is not None and medians[1] <= _MEDIAN_CELLS and medians[2] <= _MEDIAN_DEG
    return [*found, Criterion("(b) median errors of at most 0.1° and 0.5 cell", holds, text)]


def of_sets(outcomes: Sequence[SetOutcome]) -> list[Criterion]:
    """Return what must hold of published maps, part (c)."""
    return [
        Criterion(
            f"(c) {item.set_name}: {item.least} of {item.size} together and right",
            item.is_right,
            f"{item.together} together" if item.is_right or item.together < item.least else "not all of them right",
        )
        for item in outcomes
        if not item.is_extra
    ]


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names[:8]) + (f" and {len(names) - 8} more" if len(names) > 8 else "") if names else "none"


def lines(criteria: Sequence[Criterion]) -> list[str]:
    """Return a line for each criterion."""
    return [f"{'holds' if item.holds else 'FAILS'}  {item.name}: {item.found}" for item in criteria]
