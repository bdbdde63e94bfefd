"""Words in the Rerun recording: what is said of the robots, and of the run."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from replay.decisions import INFO, WARN, Entry, linked_otherwise
from replay.events import Merged, Noted, Report, Skipped
from replay.figures import NO_FIGURE, area, degrees, fixed, percent, share
from replay.plain_text import plain, plain_json
from replay.words import lost, merged_of

_MARKS = re.compile(r"[\\`*_\[\]<>#]")
_COLUMNS = ("robot", "status", "x, m", "y, m", "yaw, °", "acceptance", "overlap", "confidence")


def skipped(event: Skipped) -> Entry:
    """Say which message, or part of a recording, was not used, and why."""
    if event.place:
        return WARN, f"{event.input}: {lost(event.messages)} ({event.place}): {event.detail}"
    whose = f"{event.robot}: " if event.robot else ""
    return WARN, f"{whose}a message of {event.topic} was skipped: {event.detail}"


def noted(event: Noted) -> Entry:
    """Say what a reader should know."""
    return WARN, f"{event.robot}: {event.message}" if event.robot else event.message


def remarks(event: Merged) -> Iterator[Entry]:
    """Say what is only for who looks on."""
    yield from ((WARN, remark) for remark in event.remarks)


def outcome(report: Report) -> Iterator[Entry]:
    """Say what became of the robots in the end."""
    robots = report["robots"]
    merged = sum(values["merged_from_map"] is not None for values in robots.values())
    yield (INFO if merged == len(robots) else WARN), f"end: {merged_of(robots)}"
    for robot, values in robots.items():
        if values["merged_from_map"] is None:
            yield WARN, f"{robot} is not merged: {values['reason']['message']}"
    if (otherwise := linked_otherwise(report)) is not None:
        yield INFO, f"end: {otherwise}"


def robots_table(report: Report) -> str:
    """Return the robots as a table in Markdown, and why each is where it is."""
    robots = report["robots"].items()
    reasons = [f"- **{cell(robot)}**: {paragraph(values['reason']['message'])}" for robot, values in robots]
    return "\n\n".join([table(_COLUMNS, [_row(robot, values) for robot, values in robots]), "\n".join(reasons)]) + "\n"


def skipped_table(report: Report) -> str:
    """Return what was not used as a table in Markdown."""
    places = report["skipped_at"]
    if not places:
        return "Nothing was skipped: all messages with maps were used.\n"
    rows = [
        (cell(item["cause"]), _count(item["messages"]), cell(item["topic"] or item["place"]), cell(item["input"]))
        for item in places
    ]
    details = [f"- {cell(item['topic'] or item['place'])}: {paragraph(item['detail'])}" for item in places]
    return "\n\n".join([table(("cause", "messages", "where", "input"), rows), "\n".join(details)]) + "\n"


def about(report: Report) -> str:
    """Return inputs and settings in Markdown."""
    parts = [f"# replay {report['version']}", f"Reference: **{plain(report['reference'])}**", "## Inputs"]
    parts += [_block(item) for item in report["inputs"]]
    parts += ["## Settings", _block(report["settings"])]
    return "\n\n".join(parts) + "\n"


def _row(robot: str, values: Mapping[str, Any]) -> tuple[str, ...]:
    pose = values["merged_from_map"]
    place = (fixed(pose["x_m"], 2), fixed(pose["y_m"], 2), degrees(pose["yaw_rad"])) if pose else (NO_FIGURE,) * 3
    agreement = share(values["acceptance"]), area(values["overlap_m2"]), percent(values["confidence"])
    return (cell(robot), cell(values["status"]), *place, *agreement)


def table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table in Markdown, of text that stays in its cells."""
    return "\n".join("| " + " | ".join(row) + " |" for row in (columns, ("---",) * len(columns), *rows))


def cell(text: str) -> str:
    """Return text that stays in its cell of a table."""
    return paragraph(text).replace("|", "\\|")


def paragraph(text: str) -> str:
    """Return text that is read as it is, and on one line."""
    return _MARKS.sub(r"\\\g<0>", plain(text).replace("\n", " "))


def _count(messages: int | None) -> str:
    return "?" if messages is None else str(messages)


def _block(value: Any) -> str:  # noqa: ANN401 - any JSON value
    return f"```json\n{plain_json(json.dumps(value, indent=2, ensure_ascii=False))}\n```"
