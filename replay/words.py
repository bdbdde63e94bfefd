"""Sentences that are said in several places."""

from __future__ import annotations

from collections.abc import Sequence


def counted(number: int, what: str) -> str:
    """Return a number of things: 1 message, 2 messages."""
    return f"{number} {what}{'' if number == 1 else 's'}"


def intention(robots: Sequence[str], form: str) -> str:
    """Return which maps are merged into which; ``form`` has a place for each."""
    reference, *others = robots
    if not others:
        return f"there is only one map, {reference}: nothing to merge it with"
    return form.format(", ".join(others), f"{reference}, the reference")


def unused(topics: Sequence[str]) -> str:
    """Return which map topics are left out, and how to use one."""
    return f"not used: {', '.join(topics)}; to use one, say whose it is, as --topic r1={topics[0]}"
