"""What happened to robots' maps, in words: for the terminal and for the log of the Rerun recording."""

from __future__ import annotations

from collections.abc import Iterator

from mapmerge.outcome import Change, ChangeKind
from mapmerge.result import MergeResult
from mapmerge.sim2 import Sim2
from replay.words import JUMPED

INFO, WARN = "INFO", "WARN"
Entry = tuple[str, str]
"""Level and text of an entry of the log."""


def decisions(result: MergeResult) -> Iterator[Entry]:
    """Say what jumped, or was placed, moved or withdrawn in a step."""
    for change in result.changes:
        yield _decision(change, result.robots[change.robot].merged_from_map)


def _decision(change: Change, pose: Sim2 | None) -> Entry:
    why = f" (searched, as {change.trigger.words})" if change.trigger else ""
    if change.kind is ChangeKind.JUMPED:
        return WARN, f"{JUMPED.format(change.robot)}: {change.reason.message}"
    if change.kind is ChangeKind.WITHDRAWN or pose is None:
        return WARN, f"{change.robot} is withdrawn: {change.reason.message}{why}"
    if change.kind is ChangeKind.MOVED:
        return INFO, f"{change.robot} moved to {pose}: {change.reason.message}{why}"
    return INFO, f"{change.robot} {change.reason.message}; at {pose}"
