"""How far robots' maps are from where they truly lie."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from mapmerge.sim2 import Sim2, wrap_angle
from replay.evaluation.truth import RobotTruth, Truth
from replay.run_result import RobotResult, RunResult

ELSEWHERE_M, ELSEWHERE_DEG = 1.0, 5.0
"""A placement that is farther off is at another place: no merger would mend it."""


class Verdict(StrEnum):
    """What became of a robot, in the light of the truth."""

    PLACED = "placed"
    """Merged, and near the truth."""
    ELSEWHERE = "elsewhere"
    """Merged at another place."""
    MISSED = "missed"
    """Not merged, though its map is of the same place."""
    FALSE_MERGE = "false merge"
    """Merged, though its map is of another place."""
    REFUSED = "refused"
    """Not merged, and rightly so."""
    ABSENT = "absent"
    """The run has no such robot."""


@dataclass(frozen=True, slots=True)
class RobotError:
    """How one robot fared.

    Parameters
    ----------
    distance_m
        How far its map is off amid what it shares with others; None unless it is merged and belongs there.
    angle_deg
        By how much it is turned wrongly.
    reason
        What the run says of it.
    """

    robot: str
    verdict: Verdict
    distance_m: float | None
    angle_deg: float | None
    reason: str


@dataclass(frozen=True, slots=True)
class PoseErrors:
    """How all robots fared.

    Parameters
    ----------
    robots
        Each of which there is truth.
    unknown
        Robots of the run of which there is none.
    """

    robots: tuple[RobotError, ...]
    unknown: tuple[str, ...]

    def count(self, verdict: Verdict) -> int:
        """Return how many robots fared like that."""
        return sum(item.verdict is verdict for item in self.robots)

    @property
    def rmse_m(self) -> float | None:
        """Root mean square of the errors in position, of all that are merged and belong there."""
        return _rms([item.distance_m for item in self.robots])

    @property
    def rmse_deg(self) -> float | None:
        """The same of the errors in direction."""
        return _rms([item.angle_deg for item in self.robots])

    def within(self, distance_m: float, angle_deg: float) -> bool:
        """Tell whether all that belong are placed within these errors, and nobody else is."""
        return all(
            item.verdict is Verdict.REFUSED
            or (
                item.distance_m is not None
                and item.distance_m <= distance_m
                and item.angle_deg is not None
                and item.angle_deg <= angle_deg
            )
            for item in self.robots
        )


def pose_errors(result: RunResult, truth: Truth) -> PoseErrors:
    """Hold a run against the truth, which is in the frame of the run's reference."""
    robots = tuple(_error(name, result.robots.get(name), known) for name, known in truth.robots.items())
    unknown = tuple(name for name in result.robots if name not in truth.robots and name != result.reference)
    return PoseErrors(robots, unknown)


def _error(name: str, robot: RobotResult | None, truth: RobotTruth) -> RobotError:
    if robot is None:
        return RobotError(name, Verdict.ABSENT, None, None, "")
    true, found = truth.reference_from_map, robot.merged_from_map
    if found is None:
        verdict = Verdict.REFUSED if true is None else Verdict.MISSED
    elif true is None:
        verdict = Verdict.FALSE_MERGE
    else:
        distance_m, angle_deg = error_of(found, true, truth.at_m)
        is_near = distance_m <= ELSEWHERE_M and angle_deg <= ELSEWHERE_DEG
        return RobotError(name, Verdict.PLACED if is_near else Verdict.ELSEWHERE, distance_m, angle_deg, robot.reason)
    return RobotError(name, verdict, None, None, robot.reason)


def error_of(found: Sim2, true: Sim2, at_m: tuple[float, float]) -> tuple[float, float]:
    """Return how far a placement is off: in metres at a point of the map's frame, and in degrees."""
    (x_m, y_m), (true_x_m, true_y_m) = found.apply_point(*at_m), true.apply_point(*at_m)
    return math.hypot(x_m - true_x_m, y_m - true_y_m), abs(math.degrees(wrap_angle(found.yaw_rad - true.yaw_rad)))


def _rms(values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return math.sqrt(sum(value**2 for value in known) / len(known)) if known else None
