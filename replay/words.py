"""Sentences that are said in several places."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime, timedelta
from typing import Any

from replay.plain_text import listed
from replay.robot_names import namespace

STATUS_WORDS: Mapping[str, str] = {
    "reference": "reference",
    "merged": "merged",
    "unmerged": "not merged",
    "no_map": "no map",
}
"""What became of a robot's map, by the status in the report."""

JUMPED = "the map of {} jumped in its own frame"
WITHDRAWN = "{} was withdrawn for some time"
"""What may have gone wrong with the map of a robot that is merged after all."""

_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def counted(number: int, what: str) -> str:
    """Return a number of things: 1 message, 2 messages."""
    return f"{number} {what}{'' if number == 1 else 's'}"


def merged_of(robots: Mapping[str, Mapping[str, Any]]) -> str:
    """Return how many robots' maps are merged, of a report's ``robots``; the reference alone is not."""
    placed = sum(values["merged_from_map"] is not None for values in robots.values())
    if len(robots) == 1:
        return "there is only one map"
    if placed == len(robots):
        return "both maps are merged" if placed == 2 else f"all {placed} maps are merged"
    return f"{placed} of {len(robots)} maps are merged" if placed > 1 else "no maps are merged"


def capitalised(words: str) -> str:
    """Return words as they begin a sentence."""
    return words[:1].upper() + words[1:]


def intention(robots: Sequence[str], form: str) -> str:
    """Return which maps are merged into which; ``form`` has a place for each."""
    reference, *others = robots
    if not others:
        return f"there is only one map, {reference}: nothing to merge it with"
    return form.format(listed(others), f"{reference}, the reference")


def unused(topics: Sequence[str]) -> str:
    """Return which map topics are left out, and how to use one."""
    robot = "/".join(namespace(topics[0])) or "other"
    return f"not used: {listed(topics)}; to use one, say whose it is, as --topic {robot}={topics[0]}"


def lost(messages: int | None) -> str:
    """Return how many messages are lost, if that is known."""
    if messages is None:
        return "lost messages"
    return f"lost {counted(messages, 'message') if messages else 'no message'}"


def recovered(name: str, messages: int, until_ns: int | None, parts: Sequence[str] = ()) -> str:
    """Return what was read of a recording that ends early, or of which these parts do: there may be more after them."""
    until = f" up to {moment(until_ns)}" if until_ns is not None else ""
    ending = f"{listed(parts)} {'ends' if len(parts) == 1 else 'end'}" if parts else "the file ends"
    return f"{name}: recovered {counted(messages, 'message')}{until}; {ending} early"


def moment(time_ns: int) -> str:
    """Return a time in words; as a number where no calendar has it."""
    try:
        return f"{_EPOCH + timedelta(microseconds=time_ns // 1000):%Y-%m-%d %H:%M:%S.%f}"[:-3] + " UTC"
    except OverflowError:
        return f"{time_ns} ns"
