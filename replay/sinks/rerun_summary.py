"""The page to read first in the Rerun recording: what is merged, how sure that is, and what went wrong."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mapmerge.outcome import ChangeKind, Status
from mapmerge.reasons import ReasonCode
from replay.advice import ADVICE
from replay.events import Report
from replay.figures import NO_FIGURE, area, percent, share
from replay.markdown import inline, table
from replay.sinks.rerun_entities import RobotEntities
from replay.words import JUMPED, STATUS_WORDS, WITHDRAWN, capitalised, counted, merged_of

_MOST_SAID = 8
_MOST_WRONG = 6
_EVENTS = {ChangeKind.JUMPED: JUMPED, ChangeKind.WITHDRAWN: WITHDRAWN}

_LEGEND = """\
- **Walls** are in the colour of the robot that mapped them{ways}.
- **Green** is what two maps or more know, stronger where they agree; **red** where a wall of one stands in free space \
of another; **grey** what one map alone knows.
"""


@dataclass(frozen=True, slots=True)
class Said:
    """An entry of the log, and how long after the first tick it was said."""

    since_s: float
    words: str

    @property
    def since(self) -> str:
        """When it was said, in words."""
        return f"+{self.since_s:.1f} s"


class Setbacks:
    """Whose map jumped or was withdrawn: the first ones in words, and how many there were."""

    def __init__(self) -> None:
        self.first: list[str] = []
        self.count = 0

    def take(self, report: Report) -> None:
        """Take in what changed at a time, as the report of that time says."""
        for item in report["history"]:
            if item["event"] in _EVENTS:
                self.count += 1
                if len(self.first) < _MOST_WRONG:
                    what = _EVENTS[item["event"]].format(_bold(item["robot"]))
                    self.first.append(f"{what}: {inline(item['reason']['message'])}")


def legend(*, has_ways: bool) -> str:
    """Return how to read the map, in Markdown; with ``has_ways``, where robots drove is on it."""
    return _LEGEND.format(ways=", and **thin lines** show where it drove" if has_ways else "")


def summary(
    report: Report,
    robots: Sequence[RobotEntities],
    said: Sequence[Said],
    setbacks: Setbacks,
    *,
    is_last: bool = False,
) -> str:
    """Return the page as of now, in Markdown.

    It does not say when that is, which the time line shows: so it stays the same while nothing happens.

    Parameters
    ----------
    report
        As of now.
    robots
        The robots, the reference first.
    said
        The log so far.
    setbacks
        What jumped or was withdrawn so far.
    is_last
        Whether the run has ended: before that, a map that is not merged may be yet.
    """
    parts = [
        f"# {capitalised(merged_of(report['robots']))}",
        f"in the map frame of **{inline(robots[0].robot)}**, the reference",
    ]
    parts.append(_table(report, robots))
    nothing = (
        "Nothing: no map was refused, nothing was skipped." if is_last else "All maps are, and nothing was skipped."
    )
    heading = "What went wrong" if is_last else "Not merged yet, or skipped"
    parts += [f"### {heading}", *_items(_wrong(report, setbacks, is_last=is_last), nothing)]
    parts += ["### Decisions", *_items(_lately(said), "None yet.")]
    return "\n\n".join(parts) + "\n"


def _table(report: Report, robots: Sequence[RobotEntities]) -> str:
    """Return one row for each robot; of few and short columns, as tables do not wrap."""
    rows = []
    for entities in robots:
        values = report["robots"][entities.robot]
        rows.append(
            (f"**{inline(entities.robot)}**", entities.colour_name, _is(values), _sure(values), _overlap(values))
        )
    return table(("robot", "colour", "is", "how sure", "overlap"), rows)


def _is(values: Mapping[str, Any]) -> str:
    if values["placed_via"] is not None and values["merged_from_map"] is not None:
        return f"merged, on {inline(values['placed_via'])}"
    words = STATUS_WORDS[values["status"]]
    return words if values["merged_from_map"] is not None else f"**{words}**"


def _sure(values: Mapping[str, Any]) -> str:
    if values["status"] == Status.REFERENCE:
        return NO_FIGURE
    if values["confidence"] is not None:
        return percent(values["confidence"])
    return NO_FIGURE if values["acceptance"] is None else f"acceptance {share(values['acceptance'])}"


def _overlap(values: Mapping[str, Any]) -> str:
    return NO_FIGURE if values["overlap_m2"] is None else area(values["overlap_m2"])


def _wrong(report: Report, setbacks: Setbacks, *, is_last: bool) -> list[str]:
    """Say which robots are not merged and why, what jumped or was withdrawn, and how much was skipped."""
    found = [
        f"**{inline(robot)}** is not merged: {_reason(values['reason'], is_last=is_last)}"
        for robot, values in report["robots"].items()
        if values["merged_from_map"] is None
    ]
    if skipped := sum(report["skipped"].values()):
        causes = ", ".join(f"{count} {inline(cause)}" for cause, count in report["skipped"].items())
        found.append(f"{counted(skipped, 'message')} skipped: {causes}; see *Decisions*")
    more = len(found) + setbacks.count - _MOST_WRONG
    found = [*found, *setbacks.first][:_MOST_WRONG]
    if more > 0:
        found.append(f"and {more} more: see *Decisions*")
    return found


def _reason(reason: Mapping[str, str], *, is_last: bool) -> str:
    """Return a reason in words, its code, and what may be done, in which commands are in backquotes."""
    code = ReasonCode(reason["code"])
    said = f"{inline(reason['message'])} (`{code}`)."
    return f"{said} *What to do:* {ADVICE[code]}" if is_last and ADVICE[code] else said


def _bold(robot: str) -> str:
    return f"**{inline(robot)}**"


def _lately(said: Sequence[Said]) -> Iterator[str]:
    if len(said) > _MOST_SAID:
        yield f"*{len(said) - _MOST_SAID} earlier ones: see* Decisions"
    for item in said[-_MOST_SAID:]:
        yield f"**{item.since}** {inline(item.words)}"


def _items(items: Sequence[str] | Iterator[str], otherwise: str) -> list[str]:
    lines = [f"- {item}" for item in items]
    return ["\n".join(lines)] if lines else [otherwise]
