"""The table, in Markdown: how often each fault ended how."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence

from benchmarks.faults.cases import Case
from benchmarks.faults.formats import FORMATS
from benchmarks.faults.oracle import FAILURES, Verdict
from benchmarks.faults.table import FAULTS

_FIRST_WIDTH = 32
_TITLES = ("tries", *Verdict)


class Counts:
    """Verdicts, counted by format and fault, and how long they took."""

    def __init__(self) -> None:
        self._counts: Counter[tuple[str, str, Verdict]] = Counter()
        self._took_s: dict[str, float] = defaultdict(float)

    def add(self, case: Case, verdict: Verdict, took_s: float = 0.0) -> None:
        """Count a verdict."""
        self._counts[case.format, case.fault, verdict] += 1
        self._took_s[case.format] += took_s

    @property
    def tries(self) -> int:
        """How many there are."""
        return self._counts.total()

    @property
    def failures(self) -> int:
        """How many of them must not be."""
        return sum(count for (_, _, verdict), count in self._counts.items() if verdict in FAILURES)

    def lines(self) -> Iterator[str]:
        """Yield the table of faults, in the order of theirs; what is none of them follows."""
        yield from _head("fault", _TITLES)
        tried = {fault for _, fault, _ in self._counts}
        for name in (*(each for each in FAULTS if each in tried), *sorted(tried - set(FAULTS))):
            yield _row(name, self._cells(fault=name))
        yield _row("all", self._cells())

    def lines_of_formats(self) -> Iterator[str]:
        """Yield the table of formats, with how long a try took in each."""
        yield from _head("format", (*_TITLES, "ms a try"))
        tried = {kind for kind, _, _ in self._counts}
        for name in (*(each for each in FORMATS if each in tried), *sorted(tried - set(FORMATS))):
            cells = self._cells(kind=name)
            yield _row(name, [*cells, f"{self._took_s[name] / int(cells[0]) * 1e3:.0f}"])
        mean_ms = sum(self._took_s.values()) / max(1, self.tries) * 1e3
        yield _row("all", [*self._cells(), f"{mean_ms:.0f}"])

    def _cells(self, kind: str | None = None, fault: str | None = None) -> list[str]:
        counts: Counter[Verdict] = Counter()
        for (own_kind, own_fault, verdict), count in self._counts.items():
            if kind in {None, own_kind} and fault in {None, own_fault}:
                counts[verdict] += count
        return [str(number) for number in (counts.total(), *(counts[each] for each in Verdict))]


def _head(first: str, titles: Sequence[str]) -> Iterator[str]:
    yield _row(first, titles)
    yield _row("---", ["--:"] * len(titles))


def _row(first: str, cells: Sequence[str]) -> str:
    """Return a line that can be read as it is, too: cells as wide as the widest title."""
    return f"| {first:<{_FIRST_WIDTH}} | {' | '.join(f'{each:>12}' for each in cells)} |"
