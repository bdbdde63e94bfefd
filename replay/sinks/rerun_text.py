"""Words in the Rerun recording: what is said of the robots, and of the run."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from typing import Any

from replay.decisions import INFO, WARN, Entry
from replay.events import Noted, Report, Skipped
from replay.plain_text import plain, plain_json
from replay.words import lost

_COLUMNS = ("robot", "status", "x, m", "y, m", "yaw, °", "acceptance", "overlap, m²", "confidence", "reason")


def skipped(event: Skipped) -> Entry:
    """Say which message, or part of a recording, was not used, and why."""
    if event.place:
        return WARN, f"{event.input}: {lost(event.messages)} ({event.place}): {event.detail}"
    whose = f"{event.robot}: " if event.robot else ""
    return WARN, f"{whose}a message of {event.topic} was skipped: {event.detail}"


def noted(event: Noted) -> Entry:
    """Say what a reader should know."""
    return WARN, f"{event.robot}: {event.message}" if event.robot else event.message


def outcome(report: Report) -> Iterator[Entry]:
    """Say what became of the robots in the end."""
    robots = report["robots"]
    merged = sum(values["merged_from_map"] is not None for values in robots.values())
    yield (INFO if merged == len(robots) else WARN), f"end: {merged} of {len(robots)} robots are in the merged map"
    for robot, values in robots.items():
        if values["merged_from_map"] is None:
            yield WARN, f"{robot} is not merged: {values['reason']['message']}"


def robots_table(report: Report) -> str:
    """Return the robots as a table in Markdown."""
    rows = [_COLUMNS, ("---",) * len(_COLUMNS)]
    rows += [_row(robot, values) for robot, values in report["robots"].items()]
    return "\n".join("| " + " | ".join(row) + " |" for row in rows)


def about(report: Report) -> str:
    """Return inputs and settings in Markdown."""
    parts = [f"# replay {report['version']}", f"Reference: **{plain(report['reference'])}**", "## Inputs"]
    parts += [_block(item) for item in report["inputs"]]
    parts += ["## Settings", _block(report["settings"])]
    return "\n\n".join(parts) + "\n"


def _row(robot: str, values: Mapping[str, Any]) -> tuple[str, ...]:
    pose = values["merged_from_map"] or {}
    yaw_rad = pose.get("yaw_rad")
    return (
        _plain(robot),
        _plain(values["status"]),
        _number(pose.get("x_m"), 2),
        _number(pose.get("y_m"), 2),
        _number(None if yaw_rad is None else math.degrees(yaw_rad), 1),
        _number(values["acceptance"], 3),
        _number(values["overlap_m2"], 1),
        _number(values["confidence"], 4),
        _plain(values["reason"]["message"]),
    )


def _number(value: float | None, digits: int) -> str:
    return "" if value is None else f"{value:.{digits}f}"


def _plain(text: str) -> str:
    """Return text that stays in its cell."""
    return plain(text).replace("|", "\\|").replace("_", "\\_").replace("\n", " ")


def _block(value: Any) -> str:  # noqa: ANN401 - any JSON value
    return f"```json\n{plain_json(json.dumps(value, indent=2, ensure_ascii=False))}\n```"
