"""What is expected of a run: the content of ``expect.yaml``, as values."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from mapmerge.reasons import ReasonCode
from mapmerge.sim2 import Sim2
from replay.documents import MOST, Node
from replay.read_document import read_yaml
from replay.run_result import MOST_SCALE, STATUSES
from replay.skip_cause import SkipCause

WITHIN_M, WITHIN_DEG, WITHIN_SCALE = 0.1, 0.5, 0.01
"""How far off a pose may be where nothing is said."""

TOP_KEYS = ("reference", "robots", "defaults", "other_robots", "max_skipped")
LIMIT_KEYS = (
    "within_m",
    "within_deg",
    "within_scale",
    "min_acceptance",
    "min_confidence",
    "min_overlap_m2",
    "merged_within_s",
)
ROBOT_KEYS = ("status", "reason", "pose", *LIMIT_KEYS)
POSE_KEYS = ("x_m", "y_m", "yaw_deg", "yaw_rad", "scale", "at_m", "within_m", "within_deg", "within_scale")
OTHER_ROBOTS = ("allowed", "forbidden")


@dataclass(frozen=True, slots=True)
class PoseExpectation:
    """Where a robot's map is to lie.

    Parameters
    ----------
    merged_from_map
        The pose; its scale counts only if ``scaled``.
    at_m
        The point of the robot's map frame at which positions are compared.
    within_m, within_deg, within_scale
        How far off it may be.
    """

    merged_from_map: Sim2
    at_m: tuple[float, float]
    within_m: float
    within_deg: float
    within_scale: float
    scaled: bool


@dataclass(frozen=True, slots=True)
class RobotExpectation:
    """What is to become of one robot's map; None of what does not matter."""

    status: str
    reasons: tuple[str, ...] | None = None
    pose: PoseExpectation | None = None
    min_acceptance: float | None = None
    min_confidence: float | None = None
    min_overlap_m2: float | None = None
    merged_within_s: float | None = None


@dataclass(frozen=True, slots=True)
class Expectation:
    """What is to come of a run.

    Parameters
    ----------
    robots
        By name.
    reference
        The robot whose map frame is to be the merged frame; None for any.
    only_these
        Whether there may be no other robot.
    max_skipped
        The most messages that may be skipped: by cause, "" for all together.
    """

    robots: Mapping[str, RobotExpectation]
    reference: str | None = None
    only_these: bool = False
    max_skipped: Mapping[str, int] = field(default_factory=dict)


def load_expectation(path: Path) -> Expectation:
    """Read an ``expect.yaml``.

    Raises
    ------
    InputError
        Of what is wrong in it, with its line.
    """
    return expectation_of(read_yaml(path, "EXPECT.yaml, as `replay check --write-expect` writes it"))


def expectation_of(node: Node) -> Expectation:
    """Read what is expected."""
    node.only(TOP_KEYS)
    defaults = node.get("defaults") or Node(node.file, {}, ("defaults",))
    defaults.only(LIMIT_KEYS)
    others = node.get("other_robots")
    if others is not None and others.value not in OTHER_ROBOTS:
        others.refuse(f"one of {', '.join(OTHER_ROBOTS)}")
    robots = {name: _robot(item, defaults) for name, item in node.need("robots").items()}
    if not robots:
        node.need("robots").refuse("at least one robot")
    return Expectation(
        robots,
        node.maybe("reference", Node.text),
        others is not None and others.value == "forbidden",
        node.maybe("max_skipped", _skipped) or {},
    )


def _robot(node: Node, defaults: Node) -> RobotExpectation:
    if isinstance(node.value, str):
        return _robot(Node(node.file, {"status": node.value}, node.keys, node.lines), defaults)
    node.only(ROBOT_KEYS)
    status = node.need("status")
    if status.value not in STATUSES:
        status.refuse(f"one of {', '.join(STATUSES)}")
    if status.value != "merged":
        _refuse_limits(node, status.text())
        return RobotExpectation(status.text(), node.maybe("reason", _reasons))
    if node.get("reason") is not None:
        node.need("reason").refuse("no reason of a robot that is to be merged; leave it out")

    def limit(key: str, high: float = MOST) -> float | None:
        found = node.get(key) or defaults.get(key)
        return None if found is None else found.number(0.0, high)

    return RobotExpectation(
        status.text(),
        pose=node.maybe("pose", lambda pose: _pose(pose, node, defaults)),
        min_acceptance=limit("min_acceptance", 1.0),
        min_confidence=limit("min_confidence", 1.0),
        min_overlap_m2=limit("min_overlap_m2"),
        merged_within_s=limit("merged_within_s"),
    )


def _refuse_limits(node: Node, status: str) -> None:
    """Refuse what only a merged map can have, or has by itself."""
    for key, item in node.items():
        if key not in {"status", "reason"}:
            item.refuse(f"no such key of a robot whose status is to be {status}; leave it out")


def _reasons(node: Node) -> tuple[str, ...]:
    codes = [code.value for code in ReasonCode]
    for reason in node.texts():
        if reason not in codes:
            node.refuse(f"reasons out of {', '.join(codes)}")
    return node.texts()


def _pose(node: Node, robot: Node, defaults: Node) -> PoseExpectation:
    node.only(POSE_KEYS)
    if (node.get("yaw_deg") is None) == (node.get("yaw_rad") is None):
        node.refuse("either yaw_deg or yaw_rad, beside x_m and y_m")
    yaw_deg, yaw_rad = node.maybe("yaw_deg", Node.number), node.maybe("yaw_rad", Node.number)
    scale = node.maybe("scale", lambda item: item.number(1.0 / MOST_SCALE, MOST_SCALE))

    def within(key: str, otherwise: float) -> float:
        found = node.get(key) or robot.get(key) or defaults.get(key)
        return otherwise if found is None else found.number(0.0)

    return PoseExpectation(
        Sim2(
            node.need("x_m").number(),
            node.need("y_m").number(),
            math.radians(yaw_deg) if yaw_deg is not None else yaw_rad or 0.0,
            1.0 if scale is None else scale,
        ),
        node.maybe("at_m", Node.place_m) or (0.0, 0.0),
        within("within_m", WITHIN_M),
        within("within_deg", WITHIN_DEG),
        within("within_scale", WITHIN_SCALE),
        scaled=scale is not None,
    )


def _skipped(node: Node) -> dict[str, int]:
    if isinstance(node.value, dict):
        node.only([cause.value for cause in SkipCause])
        return {cause: item.whole() for cause, item in node.items()}
    return {"": node.whole()}
