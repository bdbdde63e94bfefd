"""``--init-pose``: where a robot's map is said to lie, with how sure that is."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

from mapmerge.prior import Prior
from mapmerge.sim2 import Sim2
from replay.errors import UsageError
from replay.pose3 import MAX_PLACE_M

FORM = "R=X,Y,YAW[±SX,±SY,±SYAW]"
DEFAULT_SIGMA_M = 1.0
DEFAULT_SIGMA_YAW_RAD = math.radians(10.0)

_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_ANGLE = rf"({_NUMBER})(deg|°|)"
_VALUES = re.compile(rf"({_NUMBER}),({_NUMBER}),{_ANGLE}(?:,?±({_NUMBER})(?:,±?|±)({_NUMBER})(?:,±?|±){_ANGLE})?")
_EXPECTED = (
    f"expected {FORM} in metres and radians, such as r2=4.5,-1.2,1.57, or with degrees and standard deviations "
    "r2=4.5,-1.2,90deg+-0.5,+-0.5,+-5deg"
)


@dataclass(frozen=True, slots=True)
class InitPose:
    """Where a robot's map frame is said to lie in the reference's.

    Parameters
    ----------
    robot
        Whose.
    x_m, y_m, yaw_rad
        Its origin, and the direction of its x axis.
    sigma_x_m, sigma_y_m, sigma_yaw_rad
        Standard deviations along the reference's axes, and of the turn.

    Raises
    ------
    UsageError
        If a number is not finite, the place farther away than anything is, a deviation not positive, or the turn more
        than a full one.
    """

    robot: str
    x_m: float
    y_m: float
    yaw_rad: float
    sigma_x_m: float = DEFAULT_SIGMA_M
    sigma_y_m: float = DEFAULT_SIGMA_M
    sigma_yaw_rad: float = DEFAULT_SIGMA_YAW_RAD

    def __post_init__(self) -> None:
        sigmas = (self.sigma_x_m, self.sigma_y_m, self.sigma_yaw_rad)
        if not all(map(math.isfinite, (self.x_m, self.y_m, self.yaw_rad, *sigmas))):
            raise UsageError(f"--init-pose {self}: expected finite numbers")
        if max(abs(self.x_m), abs(self.y_m)) > MAX_PLACE_M:
            raise UsageError(
                f"--init-pose {self}: its shift is ({self.x_m}, {self.y_m}); at most {MAX_PLACE_M:g} m were expected"
            )
        if min(sigmas) <= 0.0:
            raise UsageError(f"--init-pose {self}: expected standard deviations that are more than 0")
        if abs(self.yaw_rad) > math.tau:
            raise UsageError(
                f"--init-pose {self}: a yaw of {self.yaw_rad:g} rad is more than a full turn; "
                f"if it is in degrees, give {self.yaw_rad:g}deg"
            )

    def __str__(self) -> str:
        """Return it as it is typed; a spread that is the default is left out."""
        pose = f"{self.robot}={self.x_m!r},{self.y_m!r},{self.yaw_rad!r}"
        sigmas = (self.sigma_x_m, self.sigma_y_m, self.sigma_yaw_rad)
        if sigmas == (DEFAULT_SIGMA_M, DEFAULT_SIGMA_M, DEFAULT_SIGMA_YAW_RAD):
            return pose
        return f"{pose}±{self.sigma_x_m!r},±{self.sigma_y_m!r},±{self.sigma_yaw_rad!r}"

    @staticmethod
    def parse(text: str) -> InitPose:
        """Read ``r2=1,2,0.5``, ``r2=1,2,30deg`` or ``r2=1,2,0.5±0.3,±0.3,±0.1``; ``+-`` does for ``±``.

        A spread of the turn that names no unit has that of the turn.
        """
        robot, sign, values = text.partition("=")
        found = _VALUES.fullmatch(re.sub(r"\s+", "", values).replace("+-", "±"))
        if not sign or not robot.strip() or found is None:
            raise UsageError(f"--init-pose {text}: {_EXPECTED}")
        x, y, yaw, unit, sigma_x, sigma_y, sigma_yaw, sigma_unit = found.groups()
        pose = (robot.strip(), float(x), float(y), _radians(yaw, unit))
        if sigma_x is None:
            return InitPose(*pose)
        return InitPose(*pose, float(sigma_x), float(sigma_y), _radians(sigma_yaw, sigma_unit or unit))

    def prior(self) -> Prior:
        """Return it as the merger takes it."""
        return Prior(
            Sim2(self.x_m, self.y_m, self.yaw_rad),
            self.sigma_x_m,
            self.sigma_y_m,
            self.sigma_yaw_rad,
            f"given for {self.robot}",
        )


def refuse_unfit(robots: Sequence[str], poses: Sequence[InitPose]) -> None:
    """Refuse poses of robots that are not merged, two poses of one robot, and one of the reference.

    Parameters
    ----------
    robots
        Those that are merged, the reference first.
    """
    reference, *others = robots
    taken: set[str] = set()
    for item in poses:
        if item.robot == reference:
            raise UsageError(
                f"--init-pose {item.robot}: {reference} is the reference, whose map frame is the merged frame; give "
                "poses of the other robots, or another reference, first in --robots"
            )
        if item.robot not in others:
            there = ", ".join(others) or f"none but the reference {reference}"
            raise UsageError(f"--init-pose {item.robot}: no such robot is merged; there are: {there}")
        if item.robot in taken:
            raise UsageError(f"--init-pose {item.robot}: given twice; give one pose for each robot")
        taken.add(item.robot)


def _radians(number: str, unit: str) -> float:
    return math.radians(float(number)) if unit else float(number)
