"""What is printed of each part."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from benchmarks import tables
from benchmarks.cases import FIRST_SEED
from benchmarks.merged_sets import PairOutcome, SetOutcome
from benchmarks.recordings import HELD_OUT, Course
from benchmarks.reliability import binned, diagram
from benchmarks.simulated import Result
from benchmarks.verdicts import Verdict


def show(title: str, lines: Sequence[str]) -> None:
    """Print a table."""
    print("\n".join(["", title, "", *lines]), flush=True)


def held_out() -> list[str]:
    """Return lines that say what the confidence was not fitted to."""
    return [
        f"recordings: {', '.join(HELD_OUT)} (fitted to: intel_*, fr101_*)",
        f"simulated pairs: all, for their seeds are {FIRST_SEED} and up",
        "published maps: all",
        "Rules and limits were chosen with results on simulated pairs and Halmstad's maps in view: docs/benchmarks.md",
    ]


def course_table(courses: Sequence[Course]) -> list[str]:
    """Return a line for each robot of each recording."""
    header = (
        f"{'recording':<18}{'robot':<7}{'method':<13}{'should be':<11}{'is':<10}{'error or reason':<24}{'ω':>7}"
        f"{'overlap':>10}{'first':>8}{'due':>8}{'late':>6}{'wrong':>7}"
    )
    return [header, *(_course_line(course) for course in courses)]


def _course_line(course: Course) -> str:
    last = course.moments[-1]
    found = course.reason if last.error is None else f"{last.error.distance_m:.3f} m {last.error.angle_deg:.2f}°"
    times = [
        "–" if number is None or number >= len(course.moments) else f"{course.moments[number].time_s:.0f} s"
        for number in (course.first, course.due)
    ]
    held_out = " held out" if course.recording.partition(".")[0] in HELD_OUT else ""
    return (
        f"{course.recording:<18}{course.robot:<7}{course.method:<13}{'merged' if course.belongs else 'unmerged':<11}"
        f"{'merged' if last.error is not None else 'unmerged':<10}{found:<24}{course.acceptance or 0.0:>7.3f}"
        f"{last.overlap_m2:>7.0f} m²{times[0]:>8}{times[1]:>8}{course.late:>6}{course.wrong:>7}"
        f"{held_out}{'' if course.is_right else '   NOT AS IT SHOULD BE'}"
    )


def show_simulated(first: Sequence[Result], everything: Sequence[Result], methods: Sequence[str]) -> None:
    """Print the tables of simulated pairs: in detail for one method, side by side for several."""
    show(f"(b) Simulated pairs, {methods[0]}, by kind and overlap", tables.by_overlap(first))
    show("(b) By relation, ambiguous pairs apart", tables.by_relation(first))
    show("(b) Why pairs were missed", tables.reasons(first))
    for title, is_right in (("at the right place", _is_there), ("within the tolerance", _is_right)):
        stated = [(item.confidence, is_right(item)) for item in first if item.confidence is not None]
        show(f"(b) Confidence of the best placement, taken or not, against the share {title}", diagram(binned(stated)))
    if len(methods) > 1:
        show("(b) Methods side by side", tables.by_method(everything))


def _is_there(item: Result) -> bool:
    return bool(item.is_there)


def _is_right(item: Result) -> bool:
    return bool(item.is_right)


def set_table(outcomes: Sequence[SetOutcome]) -> list[str]:
    """Return the lines of all sets."""
    lines = [f"{'set':<24}{'method':<14}{'together':>10}{'needed':>8}   largest error"]
    for item in outcomes:
        worst = "–" if item.worst is None else f"{item.worst.distance_m:.3f} m {item.worst.angle_deg:.2f}°"
        mark = "" if item.is_right else "   NOT AS IT SHOULD BE"
        together = f"{item.together} of {item.size}"
        lines.append(f"{item.set_name:<24}{item.method:<14}{together:>10}{item.least:>8}   {worst}{mark}")
    return lines


def pair_table(outcomes: Sequence[PairOutcome]) -> list[str]:
    """Return, for each set and method, how many of its pairs were placed."""
    groups: dict[tuple[str, str], list[PairOutcome]] = {}
    for item in outcomes:
        groups.setdefault((item.set_name, item.method), []).append(item)
    lines = [f"{'set':<24}{'method':<14}{'pairs':>6}{'placed':>8}{'inexact':>9}{'missed':>8}{'wrong':>7}{'time':>10}"]
    for (name, method), items in groups.items():
        counts: Mapping[Verdict, int] = {became: sum(item.verdict is became for item in items) for became in Verdict}
        time_ms = 1000.0 * sum(item.seconds for item in items) / len(items)
        lines.append(
            f"{name:<24}{method:<14}{len(items):>6}{counts[Verdict.PLACED]:>8}{counts[Verdict.INEXACT]:>9}"
            f"{counts[Verdict.MISSED]:>8}{counts[Verdict.WRONG]:>7}{time_ms:>7.0f} ms"
        )
    return lines
