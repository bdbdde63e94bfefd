"""How far robots' maps are from where they truly lie."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

from replay.errors import InputError
from replay.evaluation.truth import RobotTruth, Truth
from replay.placement_error import ELSEWHERE_DEG, ELSEWHERE_M, PlacementError, error_of
from replay.run_result import RobotResult, RunResult


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
    """Not merged, or not even there, and rightly so."""
    ABSENT = "absent"
    """The run has no such robot, though its map is of the same place."""


@dataclass(frozen=True, slots=True)
class Limits:
    """How large errors may be; what is not said is that within which a placement is at the right place."""

    distance_m: float = ELSEWHERE_M
    angle_deg: float = ELSEWHERE_DEG


@dataclass(frozen=True, slots=True)
class RobotError:
    """How one robot fared.

    Parameters
    ----------
    error
        How far its map is off; None unless it is merged and belongs there.
    reason
        What the run says of it.
    """

    robot: str
    verdict: Verdict
    error: PlacementError | None
    reason: str

    def beyond(self, limits: Limits) -> str:
        """Return in words what is more than the limits allow; empty if nothing is.

        Whoever is missed or absent, or merged though it does not belong, is beyond any.
        """
        if self.verdict is Verdict.REFUSED:
            return ""
        if self.error is None:
            return str(self.verdict)
        off = []
        if self.error.distance_m > limits.distance_m:
            off.append(f"{self.error.distance_m:.3f} m off, at most {limits.distance_m:g} allowed")
        if self.error.angle_deg > limits.angle_deg:
            off.append(f"turned by {self.error.angle_deg:.2f}°, at most {limits.angle_deg:g} allowed")
        return "; ".join(off)


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
        return _rms([item.error.distance_m for item in self.robots if item.error])

    @property
    def rmse_deg(self) -> float | None:
        """The same of the errors in direction."""
        return _rms([item.error.angle_deg for item in self.robots if item.error])

    def beyond(self, limits: Limits) -> dict[str, str]:
        """Return, of each robot for which that is so, what is more than the limits allow."""
        said = {item.robot: item.beyond(limits) for item in self.robots}
        return {robot: what for robot, what in said.items() if what}


def pose_errors(result: RunResult, truth: Truth) -> PoseErrors:
    """Hold a run against the truth, which is in the frame of the run's reference.

    Raises
    ------
    InputError
        If the truth says nothing of any robot of the run.
    """
    known = {name: item for name, item in truth.robots.items() if name != result.reference}
    if not known.keys() & result.robots.keys():
        there = ", ".join(name for name in result.robots if name != result.reference)
        raise InputError(f"{result.name}: there is no truth of any of its robots; expected that of {there or 'some'}")
    robots = tuple(_error(name, result.robots.get(name), item) for name, item in known.items())
    unknown = tuple(name for name in result.robots if name not in known and name != result.reference)
    return PoseErrors(robots, unknown)


def _error(name: str, robot: RobotResult | None, truth: RobotTruth) -> RobotError:
    true = truth.reference_from_map
    if robot is None:
        return RobotError(name, Verdict.REFUSED if true is None else Verdict.ABSENT, None, "")
    found = robot.merged_from_map
    if found is None:
        return RobotError(name, Verdict.REFUSED if true is None else Verdict.MISSED, None, robot.reason)
    if true is None:
        return RobotError(name, Verdict.FALSE_MERGE, None, robot.reason)
    error = error_of(found, true, truth.at_m)
    return RobotError(name, Verdict.ELSEWHERE if error.is_elsewhere else Verdict.PLACED, error, robot.reason)


def _rms(values: Sequence[float]) -> float | None:
    return math.sqrt(sum(value**2 for value in values) / len(values)) if values else None
