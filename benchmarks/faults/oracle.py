"""Judges what came of a damaged recording against what is in the undamaged one."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from benchmarks.faults.runner import Ran, Used
from replay.plain_text import plain


class Verdict(StrEnum):
    """What came of a variant: a closed list, the columns of the table."""

    RIGHT = "right result"
    """All messages were used, and maps lie where they lie."""
    NAMED = "named loss"
    """Some messages were not used, which was said, and all that were used are as they were recorded."""
    ERROR = "clear error"
    """One line that names the file."""
    UNPROTECTED = "unprotected"
    """Bytes that no checksum protects were changed and believed, and yet no map was placed wrongly."""
    CRASHED = "crashed"
    """A traceback, or the process died."""
    HUNG = "hung"
    """It was not done in time."""
    WRONG = "wrong"
    """A map placed where it does not lie, a checksum not minded, a loss without a word, an error that says nothing."""


FAILURES = (Verdict.CRASHED, Verdict.HUNG, Verdict.WRONG)


@dataclass(frozen=True, slots=True)
class Expected:
    """What is right.

    Parameters
    ----------
    messages
        What is in the recording: maps and updates of maps.
    merged
        What came of the undamaged recording, if it holds just these messages; None if it does not.
    main
        Name of the recording, which an error must mention.
    robots
        Names of the robots, which an error that is about them must mention.
    is_checked
        Whether checksums protect the messages.
    are_names_checked
        Whether checksums protect what names topics and types.
    topics
        The topics that are in it, by name and type.
    leaves_no_trace
        Whether nothing in the recording tells that something is missing or another.
    """

    messages: frozenset[Used]
    merged: tuple[str, ...] | None
    main: str
    robots: tuple[str, ...]
    is_checked: bool
    are_names_checked: bool = True
    topics: frozenset[tuple[str, str]] = frozenset()
    leaves_no_trace: bool = False


@dataclass(frozen=True, slots=True)
class Judged:
    """The verdict, and why."""

    verdict: Verdict
    why: str = ""


def judge(ran: Ran, expected: Expected) -> Judged:
    """Return what is to be said of a run."""
    if ran.hung:
        return Judged(Verdict.HUNG, "it was stopped")
    if ran.crash:
        return Judged(Verdict.CRASHED, ran.crash)
    if ran.program:
        return Judged(Verdict.WRONG, f"the command line: {ran.program}")
    if ran.error:
        return _judge_error(ran, expected)
    if ran.misplaced:
        return Judged(Verdict.WRONG, "; ".join(ran.misplaced))
    return _judge_messages(ran, expected)


def _judge_error(ran: Ran, expected: Expected) -> Judged:
    line = plain(ran.error)
    if not ran.error.strip() or len(ran.error.splitlines()) != 1:
        return Judged(Verdict.WRONG, f"the error is not one line of text: {line!r}")
    # What is about robots names them: the recording can be read, and it is they that do not fit.
    if expected.main not in line and not (ran.is_usage and any(name in line for name in expected.robots)):
        return Judged(Verdict.WRONG, f"the error does not name the recording: {line}")
    return Judged(Verdict.ERROR, line)


def _judge_messages(ran: Ran, expected: Expected) -> Judged:
    used = set(ran.used)
    foreign, missing = sorted(used - expected.messages), sorted(expected.messages - used)
    said = f"; it said {ran.named}" if ran.named else ""
    said += f"; {ran.unused} are of no robot" if ran.unused else ""
    if foreign and expected.is_checked:
        return Judged(Verdict.WRONG, f"used and not recorded so, though a checksum tells: {foreign}{said}")
    silent = len(missing) - len(foreign) - _most_named(ran)
    if silent > 0:
        what = f"{len(missing)} messages are missing, of {silent} nothing was said: {missing}{said}"
        is_renamed = not expected.are_names_checked and silent <= _renamed(ran, expected)
        return Judged(Verdict.UNPROTECTED if expected.leaves_no_trace or is_renamed else Verdict.WRONG, what)
    if foreign:
        return Judged(Verdict.UNPROTECTED, f"used and not recorded so: {foreign}{said}")
    if missing:
        return Judged(Verdict.NAMED, said)
    if expected.merged is not None and ran.merged != expected.merged:
        return Judged(Verdict.WRONG, f"the same messages gave {ran.merged}, not {expected.merged}{said}")
    return Judged(Verdict.RIGHT, said)


def _renamed(ran: Ran, expected: Expected) -> int:
    """Return how many messages are on topics whose name or type damage has changed to another one."""
    return sum(count for topic, count in ran.topics.items() if topic not in expected.topics)


def _most_named(ran: Ran) -> float:
    """Return how many messages may be among what was named: any number where that cannot be told."""
    counts = [ran.unused, *(each.messages for each in ran.named)]
    return float("inf") if None in counts else sum(count for count in counts if count is not None)
