"""Findings to read: as lines for a log, and as Markdown for a job's summary."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from replay.checks.findings import Finding
from replay.markdown import inline
from replay.plain_text import plain
from replay.words import counted

HOLDS, FAILS = "✓", "✗"
PLAIN_HOLDS, PLAIN_FAILS = "ok  ", "FAIL"


def lines(found: Sequence[Finding], *, is_ascii: bool = False) -> Iterator[str]:
    """Yield a line for each finding, and how many hold."""
    marks = (PLAIN_FAILS, PLAIN_HOLDS) if is_ascii else (FAILS, HOLDS)
    for item in found:
        yield plain(f"{marks[item.holds]} {item.subject}: {item.expected}{'' if item.holds else f'; {item.found}'}")
    yield count(found)


def failing(found: Sequence[Finding]) -> Iterator[str]:
    """Yield a line for each finding that is not as expected, without a mark."""
    yield from (plain(f"{item.subject}: {item.expected}; {item.found}") for item in found if not item.holds)


def count(found: Sequence[Finding]) -> str:
    """Return how many expectations hold."""
    failed = sum(not item.holds for item in found)
    if not failed:
        return "1 expectation holds" if len(found) == 1 else f"all {len(found)} expectations hold"
    return f"{failed} of {counted(len(found), 'expectation')} {'does' if failed == 1 else 'do'} not hold"


def summary(found: Sequence[Finding], title: str) -> str:
    """Return a section of Markdown: how many hold, and a table, what fails first."""
    rows = sorted(found, key=lambda item: item.holds)
    table = [
        f"| {FAILS if not item.holds else HOLDS} | {inline(item.subject)} | {inline(item.expected)} | "
        f"{inline(item.found)} |"
        for item in rows
    ]
    head = ["", "| | robot | expected | found |", "|---|---|---|---|"]
    return "\n".join([f"### replay check: {inline(title)}", "", inline(count(found)), *head, *table, ""]) + "\n"


def error_summary(message: str, title: str) -> str:
    """Return a section of Markdown that says why nothing could be checked."""
    return f"### replay check: {inline(title)}\n\n{inline(FAILS)} nothing was checked: {inline(message)}\n\n"
