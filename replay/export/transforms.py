"""Where maps lie, as lines for the shell: static transforms from the merged frame to the robots' map frames."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence

from mapmerge.sim2 import Sim2
from replay.plain_text import plain
from replay.plan import MERGED_FRAME
from replay.run_result import RobotResult, RunResult


def lines(result: RunResult, robots: Sequence[str], ros: int) -> Iterator[str]:
    """Yield a command for each placed robot, and a comment for each other one.

    Each command goes on until it is stopped, so that several are run beside each other.

    Parameters
    ----------
    ros
        1 or 2: of which ROS the command is.
    """
    yield _comment(f"{result.name.name}: '{MERGED_FRAME}' is the map frame of {result.reference}, the reference")
    together = " &" if sum(_is_command(result.robots[name], ros) for name in robots) > 1 else ""
    for name in robots:
        yield from _robot(result.robots[name], ros, together)
    if together:
        yield "wait"


def _is_transform(pose: Sim2 | None) -> bool:
    return pose is not None and pose.scale == 1.0


def _is_command(robot: RobotResult, ros: int) -> bool:
    return _is_transform(robot.merged_from_map) and _untypable(robot.map_frame, ros) is None


def _untypable(frame: str, ros: int) -> str | None:
    """Return why a frame cannot be an argument of the command; None if it can."""
    if not frame:
        return "it has no name"
    if not frame.isprintable():
        return "its name has characters that are not seen"
    if frame.startswith("-"):
        return "its name begins as a flag does"
    if ros == 1 and ":=" in frame:
        return "its name would rename something, with := in it"
    return None


def _robot(robot: RobotResult, ros: int, end: str) -> Iterator[str]:
    pose = robot.merged_from_map
    if pose is None:
        yield _comment(f"{robot.robot} is not placed: {robot.reason}: {robot.message}")
    elif not _is_transform(pose):
        yield _comment(
            f"{robot.robot} is placed with a scale of {pose.scale:.6f}, which no transform can say: its map's "
            f"resolution is off by that factor; else {_place(pose)}"
        )
    else:
        if robot.recorded_frame is not None and robot.recorded_frame != robot.map_frame:
            yield _comment(f"{robot.map_frame} is what {robot.robot} recorded as '{robot.recorded_frame}'")
        if why := _untypable(robot.map_frame, ros):
            yield _comment(f"{robot.robot}: its frame {robot.map_frame} cannot be typed: {why}; else {_place(pose)}")
        else:
            yield _command(pose, robot.map_frame, ros) + end


def _comment(text: str) -> str:
    """Return a comment that stays one, whatever names are in it."""
    return f"# {plain(text)}"


def _place(pose: Sim2) -> str:
    return f"x {pose.x_m:.6f} y {pose.y_m:.6f} yaw {pose.yaw_rad:.6f}"


def _command(pose: Sim2, frame: str, ros: int) -> str:
    x, y = f"{pose.x_m + 0.0:.6f}", f"{pose.y_m + 0.0:.6f}"
    yaw = f"{pose.yaw_rad + 0.0:.9f}"  # a map may be so far from its frame's origin that a microradian is metres
    child = shlex.quote(frame)
    if ros == 1:
        return f"rosrun tf2_ros static_transform_publisher {x} {y} 0 {yaw} 0 0 {MERGED_FRAME} {child}"
    return (
        f"ros2 run tf2_ros static_transform_publisher --x {x} --y {y} --z 0 --yaw {yaw} --pitch 0 --roll 0 "
        f"--frame-id {MERGED_FRAME} --child-frame-id {child}"
    )
