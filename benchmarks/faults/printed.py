"""The table: how often each fault ended how."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator

from benchmarks.faults.cases import Case
from benchmarks.faults.oracle import FAILURES, Verdict
from benchmarks.speed.printed import Table

_TABLE = Table(32, ("", "tries", *Verdict))


class Counts:
    """Verdicts, counted by format and fault."""

    def __init__(self) -> None:
        self._counts: Counter[tuple[str, str, Verdict]] = Counter()

    def add(self, case: Case, verdict: Verdict) -> None:
        """Count a verdict."""
        self._counts[case.format, case.fault, verdict] += 1

    @property
    def tries(self) -> int:
        """How many there are."""
        return self._counts.total()

    @property
    def failures(self) -> int:
        """How many of them must not be."""
        return sum(count for (_, _, verdict), count in self._counts.items() if verdict in FAILURES)

    def lines(self, *, by_format: bool = False) -> Iterator[str]:
        """Yield the table, of faults in the order of their table, or of formats."""
        yield _TABLE.row("format" if by_format else "fault", *_TABLE.titles[1:])
        key: Callable[[tuple[str, str, Verdict]], str] = (lambda row: row[0]) if by_format else (lambda row: row[1])
        names = dict.fromkeys(sorted(map(key, self._counts)))
        for name in names:
            yield self._row(name, lambda row, name=name: key(row) == name)  # type: ignore[misc]
        yield self._row("all", lambda _: True)

    def _row(self, name: str, takes: Callable[[tuple[str, str, Verdict]], bool]) -> str:
        counts: Counter[Verdict] = Counter()
        for row, count in self._counts.items():
            if takes(row):
                counts[row[2]] += count
        return _TABLE.row(name, *(str(number) for number in (counts.total(), *(counts[each] for each in Verdict))))
