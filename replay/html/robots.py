"""The table of robots."""

from __future__ import annotations

from dataclasses import dataclass

from mapmerge.outcome import Status
from replay.figures import NO_FIGURE, area, degrees, fixed, init_pose, percent, seconds, share
from replay.html.roster import Member
from replay.html.story import Story
from replay.words import STATUS_WORDS


@dataclass(frozen=True, slots=True)
class Row:
    """One robot's figures, as they are read."""

    member: Member
    status: str
    status_words: str
    x: str
    y: str
    yaw: str
    scale: str
    init_pose: str | None
    acceptance: str
    overlap: str
    confidence: str
    first_merged: str
    updates: int
    reason: str
    is_placed: bool


def rows(story: Story) -> list[Row]:
    """Return a row for each robot."""
    found = []
    for robot, values in story.report["robots"].items():
        member, status, pose = story.member(robot), Status(values["status"]), values["merged_from_map"]
        first_ns = values["first_merged_stamp_ns"]
        found.append(
            Row(
                member,
                str(status),
                STATUS_WORDS[status],
                NO_FIGURE if pose is None else fixed(pose["x_m"], 2),
                NO_FIGURE if pose is None else fixed(pose["y_m"], 2),
                NO_FIGURE if pose is None else degrees(pose["yaw_rad"]),
                NO_FIGURE if pose is None else fixed(pose["scale"], 3),
                init_pose(robot, pose) if pose is not None and status is Status.MERGED else None,
                share(values["acceptance"]),
                area(values["overlap_m2"]),
                percent(values["confidence"]),
                NO_FIGURE if first_ns is None else seconds(first_ns - story.first_ns),
                values["updates"],
                values["reason"]["message"],
                pose is not None,
            )
        )
    return found
