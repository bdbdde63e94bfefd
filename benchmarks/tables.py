"""Results of simulated pairs as tables of text."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from statistics import median

from benchmarks.simulated import Result
from benchmarks.verdicts import Verdict

OVERLAPS = ((0.0, 0.3), (0.3, 0.5), (0.5, 1.01))
_COUNTED = (Verdict.PLACED, Verdict.INEXACT, Verdict.MISSED, Verdict.WRONG, Verdict.FALSE_MERGE)


def by_overlap(results: Sequence[Result]) -> list[str]:
    """Return a table of kinds and overlaps, of pairs that are not ambiguous by construction."""
    plain = [result for result in results if not result.ambiguous]
    kinds = list(dict.fromkeys(result.kind for result in plain))
    lines = [_header("kind and overlap")]
    for kind in kinds:
        lines += _overlap_lines(kind, [result for result in plain if result.kind == kind])
    return lines + _overlap_lines("all", plain)


def _overlap_lines(title: str, results: Sequence[Result]) -> list[str]:
    lines: list[str] = []
    for lo, hi in OVERLAPS:
        inside = [item for item in results if item.related == "same place" and lo <= item.overlap < hi]
        lines += [_line(f"{title} {lo:.1f}–{min(hi, 1.0):.1f}", inside)] if inside else []
    strangers = [item for item in results if item.related != "same place"]
    return lines + ([_line(f"{title} strangers", strangers)] if strangers else [])


def by_relation(results: Sequence[Result]) -> list[str]:
    """Return a table of strangers by what they are to each other, and of ambiguous pairs."""
    lines = [_header("relation")]
    for related in dict.fromkeys(item.related for item in results):
        for ambiguous, note in ((False, ""), (True, ", ambiguous")):
            inside = [item for item in results if item.related == related and item.ambiguous == ambiguous]
            lines += [_line(f"{related}{note}", inside)] if inside else []
    return lines


def by_method(results: Sequence[Result]) -> list[str]:
    """Return a table of methods side by side."""
    groups: list[tuple[str, Callable[[Result], bool]]] = [
        ("≥ 0.5", lambda item: item.related == "same place" and not item.ambiguous and item.overlap >= 0.5),
        ("0.3–0.5", lambda item: item.related == "same place" and not item.ambiguous and 0.3 <= item.overlap < 0.5),
        ("< 0.3", lambda item: item.related == "same place" and not item.ambiguous and item.overlap < 0.3),
        ("strangers", lambda item: item.related != "same place" and not item.ambiguous),
        ("ambiguous", lambda item: item.ambiguous),
    ]
    lines = [_header("method")]
    for title, belongs in groups:
        for method in dict.fromkeys(item.method for item in results):
            inside = [item for item in results if item.method == method and belongs(item)]
            lines += [_line(f"{title}: {method}", inside)] if inside else []
    return lines


def reasons(results: Iterable[Result]) -> list[str]:
    """Return why pairs were missed, the most frequent reason first."""
    counts: dict[str, int] = {}
    for item in results:
        if item.verdict is Verdict.MISSED and not item.ambiguous:
            counts[item.reason] = counts.get(item.reason, 0) + 1
    ordered = sorted(counts.items(), key=lambda entry: (-entry[1], entry[0]))
    return [f"{reason:<24}{count:>5}" for reason, count in ordered]


def _header(title: str) -> str:
    return (
        f"{title:<26}{'pairs':>6}{'placed':>8}{'inexact':>9}{'missed':>8}{'wrong':>7}{'false':>7}"
        f"{'median error':>24}{'time':>9}{'SIFTs':>7}"
    )


def _line(title: str, results: Sequence[Result]) -> str:
    counts = {verdict: sum(item.verdict is verdict for item in results) for verdict in _COUNTED}
    numbers = "".join(f"{counts[verdict]:>{width}}" for verdict, width in zip(_COUNTED, (8, 9, 8, 7, 7), strict=True))
    time_ms = 1000.0 * median(item.seconds for item in results)
    ratio = median(item.seconds / item.sift_seconds for item in results)
    return f"{title:<26}{len(results):>6}{numbers}{_errors(results):>24}{time_ms:>6.0f} ms{ratio:>7.2f}"


def _errors(results: Iterable[Result]) -> str:
    """Return the median errors of what was placed: metres, cells, degrees."""
    errors = median_errors(results)
    if errors is None:
        return "–"
    return f"{errors[0]:.3f} m {errors[1]:.2f} c {errors[2]:.2f}°"


def median_errors(results: Iterable[Result]) -> tuple[float, float, float] | None:
    """Return the median errors of what was placed, in metres, in cells of the coarser map and in degrees."""
    placed = [
        (item.error_m, item.error_m / item.cell_m, item.error_deg)
        for item in results
        if item.verdict is Verdict.PLACED and item.error_m is not None and item.error_deg is not None
    ]
    if not placed:
        return None
    metres, cells, degrees = (median(column) for column in zip(*placed, strict=True))
    return metres, cells, degrees
