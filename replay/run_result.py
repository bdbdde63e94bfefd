"""What came of a run, as values: the part of a report that is compared, checked and evaluated.

Only what is used is read, so that reports of other versions of this program with the same schema serve as well.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mapmerge.reasons import ReasonCode
from mapmerge.sim2 import Sim2
from replay.documents import Node
from replay.events import Report

STATUSES = ("reference", "merged", "unmerged", "no_map")
_REASONS = tuple(str(code) for code in ReasonCode)
_PLACED = ("reference", "merged")
MOST_SCALE = 1e6


@dataclass(frozen=True, slots=True)
class RobotResult:
    """What became of one robot's map.

    Parameters
    ----------
    status, reason, message
        What, and why: the code, and in words.
    merged_from_map
        Where its map frame lies; None unless placed.
    acceptance, confidence, overlap_m2
        How sure that is; None where nothing tells.
    merged_after_s
        When it was placed first, in seconds since the run's first map; None if it never was, or nothing tells.
    map_frame
        What its map is called.
    centre_m
        The middle of what its map knows, in its map frame; None where nothing tells.
    recorded_frame
        What its map frame was called in the recording; None where nothing tells.
    """

    robot: str
    status: str
    reason: str
    message: str
    merged_from_map: Sim2 | None
    acceptance: float | None
    confidence: float | None
    overlap_m2: float | None
    merged_after_s: float | None
    map_frame: str
    centre_m: tuple[float, float] | None = None
    recorded_frame: str | None = None

    @property
    def is_placed(self) -> bool:
        """Whether its map is in the merged one."""
        return self.status in _PLACED


@dataclass(frozen=True, slots=True)
class RunInput:
    """A recording that was read.

    Parameters
    ----------
    name
        Of the file or folder; several may have the same.
    size_bytes
        None where nothing tells.
    robots
        Whose maps it holds, in order of name.
    sha256
        Digest of what was used of it; "" where not all was read.
    """

    name: str
    size_bytes: int | None
    robots: tuple[str, ...]
    sha256: str


@dataclass(frozen=True, slots=True)
class RunResult:
    """What came of a run.

    Parameters
    ----------
    name
        What the report was read from.
    reference
        The robot whose map frame is the merged frame.
    robots
        By name, the reference first.
    skipped
        Messages that were not used, by cause.
    version, settings
        What made the report, and with which settings.
    inputs
        The recordings, in the order in which they were given.
    stamp_ns
        As of when this is; None if there was no map at all.
    """

    name: Path
    reference: str
    robots: Mapping[str, RobotResult]
    skipped: Mapping[str, int]
    version: str
    settings: Mapping[str, Any]
    inputs: tuple[RunInput, ...]
    stamp_ns: int | None = None

    def is_joined(self, robot: str) -> bool:
        """Tell whether a robot's map is in the merged one, and not alone there, as is that of any reference."""
        placed = {name for name, found in self.robots.items() if found.is_placed}
        return robot in placed and len(placed) > 1

    @staticmethod
    def of(report: Report, name: Path) -> RunResult:
        """Read a report.

        Raises
        ------
        InputError
            If what is used of it is missing or of another kind.
        """
        node = Node(name, report)
        first_ns = node.maybe("first_stamp_ns", Node.whole)
        return RunResult(
            name,
            node.need("reference").text(),
            {robot: _robot(robot, item, first_ns) for robot, item in node.need("robots").items()},
            {cause: item.whole() for cause, item in node.need("skipped").items()},
            node.need("version").text(),
            {key: item.value for key, item in node.need("settings").items()},
            _inputs(node),
            node.maybe("stamp_ns", Node.whole),
        )


def pose_of(node: Node) -> Sim2:
    """Read a pose as reports have it: ``x_m``, ``y_m``, ``yaw_rad`` and, if it is not 1, ``scale``."""
    scale = node.maybe("scale", lambda item: item.number(1.0 / MOST_SCALE, MOST_SCALE))
    return Sim2(
        node.need("x_m").number(),
        node.need("y_m").number(),
        node.need("yaw_rad").number(),
        1.0 if scale is None else scale,
    )


def _robot(robot: str, node: Node, first_ns: int | None) -> RobotResult:
    status = node.need("status")
    if status.value not in STATUSES:
        status.refuse(f"one of {', '.join(STATUSES)}")
    merged_ns = node.maybe("first_merged_stamp_ns", Node.whole)
    pose = node.maybe("merged_from_map", pose_of)
    if (pose is None) == (status.value in _PLACED):
        node.need("status").refuse("a placed robot to have a pose (merged_from_map), and no other")
    return RobotResult(
        robot,
        status.text(),
        _reason(node.need("reason").need("code")),
        node.need("reason").need("message").text(),
        pose,
        node.maybe("acceptance", Node.number),
        node.maybe("confidence", Node.number),
        node.maybe("overlap_m2", Node.number),
        None if merged_ns is None or first_ns is None else (merged_ns - first_ns) / 1e9,
        node.need("map_frame").text(),
        node.maybe("centre_m", Node.place_m),
        node.maybe("recorded_frame", Node.text),
    )


def _reason(node: Node) -> str:
    if node.value not in _REASONS:
        node.refuse(f"one of {', '.join(_REASONS)}")
    return node.text()


def _inputs(node: Node) -> tuple[RunInput, ...]:
    inputs = node.need("inputs").value
    if not isinstance(inputs, list):
        node.need("inputs").refuse("a list")
    items = [Node(node.file, item, ("inputs", at)) for at, item in enumerate(inputs)]
    return tuple(
        RunInput(
            item.need("name").text(),
            item.maybe("size_bytes", Node.whole),
            item.maybe("robots", Node.texts) or (),
            item.maybe("sha256", Node.text) or "",
        )
        for item in items
    )
