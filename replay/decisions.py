"""What happened to robots' maps, in words: for the terminal and for the log of the Rerun recording."""

from __future__ import annotations

from collections.abc import Iterator

from mapmerge.outcome import Change, ChangeKind
from mapmerge.result import MergeResult
from mapmerge.sim2 import Sim2
from replay.events import Report
from replay.plain_text import brief, listed
from replay.words import JUMPED

INFO, WARN = "INFO", "WARN"
Entry = tuple[str, str]
"""Level and text of an entry of the log."""


def decisions(result: MergeResult) -> Iterator[Entry]:
    """Say what jumped, or was placed, moved or withdrawn in a step."""
    for change in result.changes:
        yield _decision(change, result.robots[change.robot].merged_from_map)


def linked_otherwise(report: Report) -> str | None:
    """Say which robots are placed by other matches in the end than when that was decided; None if nobody is.

    Of matches that agree the strongest ones hold the maps together. Which these are changes often, and nothing else
    with it: that is no decision, but the reasons of the end name other robots than those of the log.
    """
    said = {
        item["robot"]: item["placed_via"]
        for item in report["history"]
        if item["event"] in (ChangeKind.PLACED, ChangeKind.MOVED)
    }
    via = {robot: values["placed_via"] for robot, values in report["robots"].items() if values["status"] == "merged"}
    others = [f"{brief(robot)} on {brief(other)}" for robot, other in via.items() if said.get(robot, other) != other]
    if not others:
        return None
    return f"placed by other matches in the end than when that was decided, at the same places: {listed(others)}"


def _decision(change: Change, pose: Sim2 | None) -> Entry:
    why = f" (searched, as {change.trigger.words})" if change.trigger else ""
    if change.kind is ChangeKind.JUMPED:
        return WARN, f"{JUMPED.format(change.robot)}: {change.reason.message}"
    if change.kind is ChangeKind.WITHDRAWN or pose is None:
        return WARN, f"{change.robot} is withdrawn: {change.reason.message}{why}"
    if change.kind is ChangeKind.MOVED:
        return INFO, f"{change.robot} moved to {pose}: {change.reason.message}{why}"
    return INFO, f"{change.robot} {change.reason.message}; at {pose}"
