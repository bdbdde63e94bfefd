"""What of the recordings could not be used, and what else a reader should know of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from replay.html.story import Story
from replay.skip_cause import SkipCause
from replay.words import counted, lost

MOST_PLACES = 200

MEANINGS: Mapping[SkipCause, str] = {
    SkipCause.UNDECODABLE: "its bytes are not those of its type",
    SkipCause.SIZE_MISMATCH: "its data does not have width × height cells",
    SkipCause.BAD_RESOLUTION: "its resolution is not one that a cell of a map can have",
    SkipCause.BAD_ORIGIN: "its origin is not a pose in the plane, or is too far away",
    SkipCause.TOO_LARGE: "a side has more than 100 000 cells",
    SkipCause.EMPTY: "it has no cells",
    SkipCause.UPDATE_BEFORE_GRID: "an update of a part, without the full map that it is of",
    SkipCause.UPDATE_OUTSIDE_GRID: "an update of a part that is not within the last full map",
    SkipCause.BAD_TIME: "nothing tells when it was",
    SkipCause.BAD_TRANSFORM: "a transform in it is none",
    SkipCause.OVER_MEMORY: "it would need more memory than is allowed",
    SkipCause.ENDS_EARLY: "the file ends before the recording does",
    SkipCause.DAMAGED: "a part of the file cannot be read",
    SkipCause.WRONG_CHECKSUM: "a part of the file is not what was written",
    SkipCause.MISSING_PART: "a file of the recording is not there",
    SkipCause.UNKNOWN_TYPE: "its topic's type is not known, or says something else than the standard",
}


@dataclass(frozen=True, slots=True)
class Cause:
    """How much was lost by one cause."""

    cause: str
    count: str
    meaning: str


@dataclass(frozen=True, slots=True)
class Place:
    """What was lost at one place."""

    cause: str
    count: str
    where: str
    detail: str


@dataclass(frozen=True, slots=True)
class Losses:
    """All that was lost, and the notes; `more` places are not listed."""

    causes: tuple[Cause, ...]
    places: tuple[Place, ...]
    more: int
    notes: tuple[tuple[str, str], ...]
    counts: tuple[str, ...]


def losses(story: Story) -> Losses:
    """Return what was lost."""
    report = story.report
    at_least = {item["cause"] for item in report["skipped_at"] if item["messages"] is None}
    causes = [
        Cause(cause, f"{'at least ' if cause in at_least else ''}{counted(number, 'message')}", _meaning(cause))
        for cause, number in report["skipped"].items()
    ]
    free = dict.fromkeys(item["cause"] for item in report["skipped_at"] if item["cause"] not in report["skipped"])
    causes += [Cause(cause, "no message", _meaning(cause)) for cause in free]
    places = [
        Place(item["cause"], lost(item["messages"]), _where(item), item["detail"]) for item in report["skipped_at"]
    ]
    notes = [(item["robot"], item["message"]) for item in report["notes"]]
    more = max(0, len(places) - MOST_PLACES)
    return Losses(tuple(causes), tuple(places[:MOST_PLACES]), more, tuple(notes), tuple(_counts(story)))


def _meaning(cause: str) -> str:
    return MEANINGS[SkipCause(cause)]


def _where(item: Mapping[str, Any]) -> str:
    return ", ".join(part for part in (item["input"], item["topic"], item["place"]) if part)


def _counts(story: Story) -> list[str]:
    late, bad = (sum(item[key] for item in story.report["inputs"]) for key in ("late", "bad_stamps"))
    said = []
    if late:
        said.append(f"{counted(late, 'message')} came too late to be put in order of time, and was taken in on arrival")
    if bad:
        said.append(f"{counted(bad, 'message')} had a time far from those around, and that of recording was used")
    return said
