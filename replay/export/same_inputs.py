"""Whether recordings are those of a run: by what its report says of each, and by the digest of what was used of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from replay.errors import UsageError
from replay.plain_text import listed, plain
from replay.run_result import RunInput


def refuse_others(merged: Sequence[RunInput], found: Sequence[Mapping[str, Any]]) -> None:
    """Refuse recordings that are not those that were merged, each of the same robots.

    Parameters
    ----------
    merged
        What the report says.
    found
        The same of the recordings; digests are compared where both are known, which is when all was read.

    Raises
    ------
    UsageError
        With the first one that is another, or was left out.
    """
    left = list(merged)
    for item in map(_input, found):
        alike = [each for each in left if (each.name, each.robots) == (item.name, item.robots)]
        if not alike:
            raise UsageError(f"--maps: {_words(item)} was not merged; what was: {listed([*map(_words, merged)], '; ')}")
        differs = [list(_differences(each, item)) for each in alike]
        best = min(range(len(alike)), key=lambda at: len(differs[at]))
        if differs[best]:
            why = ", ".join(differs[best])
            raise UsageError(f"--maps: {_words(item)} is not the recording that was merged: {why}; give that one")
        left.remove(alike[best])
    refuse_left_out(left)


def refuse_left_out(left: Sequence[RunInput]) -> None:
    """Refuse that recordings were left out."""
    if left:
        names = listed([plain(item.name) for item in left])
        raise UsageError(f"--maps: {names} was merged, and is not given; give what was merged, and nothing else")


def _input(item: Mapping[str, Any]) -> RunInput:
    return RunInput(str(item["name"]), item["size_bytes"], tuple(item["robots"]), item["sha256"] or "")


def _differences(one: RunInput, other: RunInput) -> Iterator[str]:
    if None not in (one.size_bytes, other.size_bytes) and one.size_bytes != other.size_bytes:
        yield f"it has {other.size_bytes} bytes instead of {one.size_bytes}"
    if one.sha256 and other.sha256 and one.sha256 != other.sha256:
        yield "its maps have another digest"


def _words(item: RunInput) -> str:
    return f"{plain(item.name)} with the maps of {plain(listed(item.robots)) or 'nobody'}"
