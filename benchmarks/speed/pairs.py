"""The simulated pairs of `benchmarks.truth` matched from nothing, and what a second look at all rotations costs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from statistics import median
from unittest.mock import patch

from benchmarks.cases import cases
from benchmarks.methods import DEFAULT, load_method
from benchmarks.speed.cold import sift_once
from benchmarks.speed.options import Options
from benchmarks.speed.printed import Table, at_most, ratio, seconds
from benchmarks.speed.timing import once
from mapmerge.grid import Grid
from mapmerge.match.candidates import by_sweep

MOST_OF_A_SECOND_LOOK = 3.0
TABLE = Table(24, ("pairs", "number", "match", "to one SIFT", "90% below", "second look"))


@dataclass(frozen=True, slots=True)
class Timed:
    """One pair: processor times in seconds, and whether it took a second look."""

    related: str
    match_s: float
    sift_s: float
    looked_twice: bool

    @property
    def sifts(self) -> float:
        """Time of the match in those of one SIFT."""
        return self.match_s / self.sift_s


def lines(options: Options) -> Iterator[str]:
    """Yield the lines of the section."""
    found = list(measured(options))
    yield TABLE.header
    groups = {
        "all": found,
        "of one place": [item for item in found if item.related == "same place"],
        "strangers": [item for item in found if item.related != "same place"],
        "clear at first": [item for item in found if not item.looked_twice],
        "with a second look": [item for item in found if item.looked_twice],
    }
    yield from (row(name, items) for name, items in groups.items() if items)
    twice, clear = groups["with a second look"], groups["clear at first"]
    if twice and clear:
        more = median(item.sifts for item in twice) / median(item.sifts for item in clear)
        yield at_most("a second look, to a match that is clear at first", more, MOST_OF_A_SECOND_LOOK)


def measured(options: Options) -> Iterator[Timed]:
    """Yield what the pairs take: each is matched once before it counts."""
    match = load_method(DEFAULT)
    for case in cases(options.share):
        pair = case.made()
        looked_twice = takes_a_second_look(pair.target, pair.source)
        larger = max((pair.target, pair.source), key=lambda grid: grid.cells.size)
        match_s = once(partial(match, pair.target, pair.source))
        sift_s = once(partial(sift_once, larger))
        yield Timed(pair.related, match_s, sift_s, looked_twice)


def takes_a_second_look(target: Grid, source: Grid) -> bool:
    """Tell whether the default method looks at all rotations: nothing that it returns says so."""
    with patch("mapmerge.match.correlation.by_sweep", wraps=by_sweep) as sweep:
        load_method(DEFAULT)(target, source)
    return bool(sweep.called)


def row(name: str, items: Sequence[Timed]) -> str:
    """Return one line of the table."""
    ordered = sorted(item.sifts for item in items)
    return TABLE.row(
        name,
        str(len(items)),
        seconds(median(item.match_s for item in items)),
        ratio(median(ordered)),
        ratio(ordered[int(0.9 * (len(ordered) - 1))]),
        f"{sum(item.looked_twice for item in items) / len(items):.0%}",
    )
