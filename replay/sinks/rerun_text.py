"""Words in the Rerun recording: what is said of the robots, and of the run."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

from replay.decisions import INFO, WARN, Entry, linked_otherwise
from replay.events import Merged, Noted, Report, Skipped
from replay.figures import NO_FIGURE, area, degrees, fixed, percent, share
from replay.markdown import inline, table
from replay.plain_text import plain_json
from replay.words import lost, merged_of

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
    reasons = [f"- **{inline(robot)}**: {inline(values['reason']['message'])}" for robot, values in robots]
    return "\n\n".join([table(_COLUMNS, [_row(robot, values) for robot, values in robots]), "\n".join(reasons)]) + "\n"


def skipped_table(report: Report) -> str:
    """Return what was not used as a table in Markdown."""
    places = report["skipped_at"]
    if not places:
        return "Nothing was skipped: all messages with maps were used.\n"
    rows = [
        (inline(item["cause"]), _count(item["messages"]), inline(item["topic"] or item["place"]), inline(item["input"]))
        for item in places
    ]
    details = [f"- {inline(item['topic'] or item['place'])}: {inline(item['detail'])}" for item in places]
    return "\n\n".join([table(("cause", "messages", "where", "input"), rows), "\n".join(details)]) + "\n"


def about(report: Report) -> str:
    """Return inputs and settings in Markdown."""
    parts = [f"# replay {report['version']}", f"Reference: **{inline(report['reference'])}**", "## Inputs"]
    parts += [_block(item) for item in report["inputs"]]
    parts += ["## Settings", _block(report["settings"])]
    return "\n\n".join(parts) + "\n"


def _row(robot: str, values: Mapping[str, Any]) -> tuple[str, ...]:
    pose = values["merged_from_map"]
    place = (fixed(pose["x_m"], 2), fixed(pose["y_m"], 2), degrees(pose["yaw_rad"])) if pose else (NO_FIGURE,) * 3
    agreement = share(values["acceptance"]), area(values["overlap_m2"]), percent(values["confidence"])
    return (inline(robot), inline(values["status"]), *place, *agreement)


def _count(messages: int | None) -> str:
    return "?" if messages is None else str(messages)


def _block(value: Any) -> str:  # noqa: ANN401 - any JSON value
    return f"```json\n{plain_json(json.dumps(value, indent=2, ensure_ascii=False))}\n```"
