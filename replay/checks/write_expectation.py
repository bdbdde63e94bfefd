"""An ``expect.yaml`` for runs like one that was made, so that nobody types poses."""

from __future__ import annotations

import math
from collections.abc import Iterator

from mapmerge.sim2 import Sim2
from replay.checks.expectation import WITHIN_DEG, WITHIN_M
from replay.figures import exact
from replay.plain_text import plain
from replay.run_result import RobotResult, RunResult

_SHARE_LESS = 0.02
_AREA_SHARE = 0.9
_TIMES_LATER = 1.2
_LATER_S = 5.0
_DIGITS = 3


def expectation_text(result: RunResult) -> str:
    """Return an expectation that a run meets, with some leeway, as the text of a YAML file."""
    return "\n".join(_lines(result)) + "\n"


def _lines(result: RunResult) -> Iterator[str]:
    version = plain(result.version)
    yield f"# What `replay check` expects; written from a run of replay {version}. Change it as you need."
    yield f"reference: {_name(result.reference)}"
    yield "other_robots: forbidden"
    yield f"max_skipped: {sum(result.skipped.values())}"
    yield "defaults:  # of robots that are to be merged"
    yield f"  within_m: {WITHIN_M:g}  # of the pose, at at_m of the robot's map frame: the middle of what its map knows"
    yield f"  within_deg: {WITHIN_DEG:g}"
    yield "robots:"
    for robot in result.robots.values():
        yield from _robot(robot)


def _robot(robot: RobotResult) -> Iterator[str]:
    name, pose = _name(robot.robot), robot.merged_from_map
    if robot.status == "reference":
        yield f"  {name}: reference"
    elif robot.status != "merged" or pose is None:
        yield f"  {name}: {{status: {robot.status}, reason: {robot.reason}}}"
    else:
        yield f"  {name}:"
        yield "    status: merged"
        yield f"    pose: {{{', '.join(f'{key}: {text}' for key, text in _pose(pose, robot.centre_m).items())}}}"
        yield from _limits(robot)


def _pose(pose: Sim2, centre_m: tuple[float, float] | None) -> dict[str, str]:
    """Return a pose, and the point at which it is compared; turned and scaled so exactly that the point stays there."""
    away_m = 1.0 if centre_m is None else max(1.0, math.hypot(*centre_m))
    scale_digits = max(_DIGITS, math.ceil(math.log10(away_m)) + _DIGITS)
    numbers = {
        "x_m": _number(pose.x_m),
        "y_m": _number(pose.y_m),
        "yaw_deg": _number(math.degrees(pose.yaw_rad), max(_DIGITS, scale_digits - 1)),
    }
    if pose.scale != 1.0:
        numbers["scale"] = _number(pose.scale, scale_digits)
    if centre_m is not None:
        numbers["at_m"] = f"[{', '.join(map(_number, centre_m))}]"
    return numbers


def _number(value: float, digits: int = _DIGITS) -> str:
    return exact(round(value, digits) + 0.0)


def _limits(robot: RobotResult) -> Iterator[str]:
    """Yield the limits that are a little less than what was reached."""
    for key, value in (("min_acceptance", robot.acceptance), ("min_confidence", robot.confidence)):
        if value is not None:
            yield f"    {key}: {max(0.0, math.floor((value - _SHARE_LESS) * 100) / 100):g}"
    if robot.overlap_m2 is not None:
        yield f"    min_overlap_m2: {math.floor(robot.overlap_m2 * _AREA_SHARE)}"
    if robot.merged_after_s is not None:
        yield f"    merged_within_s: {math.ceil(max(0.0, robot.merged_after_s) * _TIMES_LATER + _LATER_S)}"


def _name(name: str) -> str:
    """Return a name in double quotes, with all that is not seen in it escaped as YAML has it."""
    return f'"{"".join(map(_character, name))}"'


def _character(character: str) -> str:
    if character in '"\\':
        return f"\\{character}"
    return character if character.isprintable() else f"\\U{ord(character):08x}"
