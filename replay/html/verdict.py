"""What comes first: what was merged, how sure that is, and what to do about the rest."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from mapmerge.outcome import ChangeKind, Status
from mapmerge.reasons import ReasonCode
from replay.advice import ADVICE
from replay.events import Report
from replay.figures import percent, share
from replay.html.roster import Member
from replay.html.story import Story
from replay.plain_text import brief, listed
from replay.words import JUMPED, WITHDRAWN, capitalised, counted, merged_of

Level = Literal["good", "partly", "bad"]


MOST_BY_THEMSELVES = 3
"""Of so many robots that are not merged, each is told of by itself; of more, those with one reason together."""


@dataclass(frozen=True, slots=True)
class Refusal:
    """Robots that are not merged, for one reason: why, and what may be done.

    Parameters
    ----------
    members
        The robots.
    reason, code
        The reason in words, that of the first one, and its code.
    is_example
        Whether others have it in other words.
    advice
        What to do.
    """

    members: tuple[Member, ...]
    reason: str
    code: str
    is_example: bool
    advice: str


@dataclass(frozen=True, slots=True)
class Verdict:
    """The verdict.

    Parameters
    ----------
    level
        Whether all, some or none of the other robots' maps were merged.
    sentence
        What was merged.
    sure
        How sure that is.
    refusals
        Robots that are not merged.
    troubles
        What else went wrong: words, and where on the page it is.
    """

    level: Level
    sentence: str
    sure: str
    refusals: tuple[Refusal, ...]
    troubles: tuple[tuple[str, str], ...]


def verdict(story: Story) -> Verdict:
    """Return what there is to say first."""
    robots = story.report["robots"]
    placed = [robot for robot, values in robots.items() if values["merged_from_map"] is not None]
    merged = [robot for robot in placed if robots[robot]["status"] == Status.MERGED]
    return Verdict(
        _level(len(robots), len(placed), len(merged)),
        _sentence(story, len(placed), len(merged)),
        _sure(story, merged),
        tuple(_refusals(story)),
        tuple(_troubles(story)),
    )


def _refusals(story: Story) -> Iterator[Refusal]:
    robots = story.report["robots"]
    refused = {robot: values["reason"] for robot, values in robots.items() if values["merged_from_map"] is None}
    together: dict[str, list[str]] = {}
    for robot, reason in refused.items():
        together.setdefault(reason["code"] if len(refused) > MOST_BY_THEMSELVES else robot, []).append(robot)
    for group in together.values():
        first = refused[group[0]]
        is_example = any(refused[robot]["message"] != first["message"] for robot in group)
        members = tuple(story.member(robot) for robot in group)
        yield Refusal(members, first["message"], first["code"], is_example, ADVICE[ReasonCode(first["code"])])


def _level(robots: int, placed: int, merged: int) -> Level:
    if placed == robots:
        return "good"
    return "partly" if merged else "bad"


def _sentence(story: Story, placed: int, merged: int) -> str:
    robots = len(story.robots)
    if robots == 1:
        return "There is only one map: nothing to merge it with." if placed else "No map could be used."
    if merged:
        return f"{capitalised(merged_of(story.report['robots']))}."
    reference = story.member(story.report["reference"])
    if not placed:
        return f"Nothing is merged: the reference {reference.name} has no usable map."
    if robots == 2:
        other = next(member for member in story.roster.values() if member is not reference)
        return f"Nothing is merged: the map of {other.name} was not placed on that of {reference.name}."
    return f"Nothing is merged: none of the other {robots - 1} maps was placed on that of {reference.name}."


def _sure(story: Story, merged: list[str]) -> str:
    if not merged:
        return ""
    robots, merge = story.report["robots"], story.settings["merge"]
    known = {robot: robots[robot]["confidence"] for robot in merged if robots[robot]["confidence"] is not None}
    if known:
        least = min(known, key=lambda robot: float(known[robot]))
        need = percent(merge["verify"]["min_confidence"])
        name, sure = story.member(least).name, percent(known[least])
        if len(merged) == 1:
            return f"The placement of {name} is right with a probability of {sure}; {need} is required."
        return f"The least sure placement, that of {name}, is right with a probability of {sure}; {need} is required."
    agreeing = {robot: robots[robot]["acceptance"] for robot in merged if robots[robot]["acceptance"] is not None}
    least_index = f" The least acceptance index is {share(min(agreeing.values()))}." if agreeing else ""
    return f"The method {merge['method']} does not tell how sure a placement is.{least_index}"


def _losses(report: Report) -> Iterator[tuple[str, str]]:
    """Say of each recording what of it could not be used."""
    for name in dict.fromkeys(item["input"] for item in report["skipped_at"]):
        places = [item for item in report["skipped_at"] if item["input"] == name]
        causes = listed(list(dict.fromkeys(str(item["cause"]).replace("_", " ") for item in places)))
        is_least = any(item["messages"] is None for item in places)
        number = sum(1 if item["messages"] is None else item["messages"] for item in places)
        what = f"{'at least ' if is_least else ''}{counted(number, 'message')} could not be used"
        yield f"{brief(name)}: {what if number else 'damaged, at no cost of messages'} ({causes})", "losses"


def _troubles(story: Story) -> Iterator[tuple[str, str]]:
    report = story.report
    yield from _losses(report)
    for kind, words in (
        (ChangeKind.JUMPED, JUMPED),
        (ChangeKind.WITHDRAWN, WITHDRAWN),
    ):
        robots = dict.fromkeys(item["robot"] for item in report["history"] if item["event"] == kind)
        for robot in robots:
            is_back = report["robots"][robot]["merged_from_map"] is not None
            if kind is ChangeKind.JUMPED or is_back:
                yield words.format(story.member(robot).name), "decisions"
    if report["notes"]:
        yield f"there {'is a note' if len(report['notes']) == 1 else 'are notes'} on the input", "losses"
