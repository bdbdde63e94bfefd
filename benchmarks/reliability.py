"""Whether a stated confidence is what it says: the observed share of right placements, by stated confidence."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

BINS = (0.0, 0.1, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 0.99, 0.999, 1.0)
_Z = 1.96
_BAR = 40


@dataclass(frozen=True, slots=True)
class Bin:
    """Placements of about the same stated confidence.

    Parameters
    ----------
    lo, hi
        Stated from ``lo`` to below ``hi``; the last bin holds 1 as well.
    count, right
        How many, and how many of them are right.
    stated
        Mean stated confidence.
    """

    lo: float
    hi: float
    count: int
    right: int
    stated: float

    @property
    def bounds(self) -> tuple[float, float]:
        """Wilson's bounds of the share that is right, at 95%."""
        return wilson(self.right, self.count)


def wilson(right: int, count: int) -> tuple[float, float]:
    """Return Wilson's bounds of a share, at 95%."""
    if count == 0:
        return 0.0, 1.0
    share, square = right / count, _Z**2 / count
    middle = share + 0.5 * square
    half = _Z * math.sqrt((share * (1.0 - share) + 0.25 * square) / count)
    return max(0.0, (middle - half) / (1.0 + square)), min(1.0, (middle + half) / (1.0 + square))


def binned(stated: Iterable[tuple[float, bool]]) -> list[Bin]:
    """Return the bins of placements, each with its stated confidence and whether it is right."""
    items = list(stated)
    bins: list[Bin] = []
    for lo, hi in pairwise(BINS):
        inside = [item for item in items if lo <= item[0] < hi or item[0] == hi == 1.0]
        mean = sum(item[0] for item in inside) / len(inside) if inside else 0.5 * (lo + hi)
        bins.append(Bin(lo, hi, len(inside), sum(item[1] for item in inside), mean))
    return bins


def diagram(bins: Sequence[Bin]) -> list[str]:
    """Return the lines of the diagram: a bar is what was observed, ``|`` what was stated."""
    if not any(item.count for item in bins):
        return ["the method states no confidence"]
    lines = [f"{'stated':<13}{'mean':>6}{'right of':>12}{'observed':>10}  {'95% bounds':<13}"]
    for item in bins:
        if not item.count:
            continue
        low, high = item.bounds
        share = item.right / item.count
        bar = ["█" if place < round(share * _BAR) else "·" for place in range(_BAR + 1)]
        bar[round(item.stated * _BAR)] = "|"
        lines.append(
            f"{item.lo:.2f} to {item.hi:.2f} {item.stated:>6.3f}{item.right:>5} of {item.count:<4}{share:>9.3f}  "
            f"{low:.3f}–{high:.3f}  {''.join(bar)}"
        )
    return lines
