"""Whether a run is as expected: a finding for each expectation."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from mapmerge.rounding import rounded_down
from mapmerge.sim2 import Sim2
from replay.checks.expectation import Expectation, PoseExpectation, RobotExpectation
from replay.placement_error import error_of
from replay.run_result import RobotResult, RunResult

RUN = "run"
"""What findings are of that are no robot's."""


@dataclass(frozen=True, slots=True)
class Finding:
    """Whether one expectation holds.

    Parameters
    ----------
    subject
        Which robot, or `RUN`.
    expected
        What is expected, in words.
    holds
        Whether it is so.
    found
        What is, in words.
    """

    subject: str
    expected: str
    holds: bool
    found: str


def findings(expectation: Expectation, result: RunResult) -> tuple[Finding, ...]:
    """Hold a run against what is expected of it."""
    return (*_of_run(expectation, result), *_of_robots(expectation, result))


def _of_run(expectation: Expectation, result: RunResult) -> Iterator[Finding]:
    if expectation.reference is not None:
        is_so = result.reference == expectation.reference
        yield Finding(RUN, f"the reference is {expectation.reference}", is_so, f"it is {result.reference}")
    if expectation.only_these:
        others = [name for name in result.robots if name not in expectation.robots]
        yield Finding(RUN, "there is no other robot", not others, f"others: {', '.join(others) or 'none'}")
    for cause, most in expectation.max_skipped.items():
        count = result.skipped.get(cause, 0) if cause else sum(result.skipped.values())
        what = f"at most {most} messages are skipped{f' as {cause}' if cause else ''}"
        causes = "" if cause or not count else f": {', '.join(f'{n} {each}' for each, n in result.skipped.items())}"
        yield Finding(RUN, what, count <= most, f"{count} skipped{causes}")


def _of_robots(expectation: Expectation, result: RunResult) -> Iterator[Finding]:
    for name, expected in expectation.robots.items():
        robot = result.robots.get(name)
        if robot is None:
            there = ", ".join(result.robots)
            yield Finding(name, f"its status is {expected.status}", False, f"there is no such robot; there are {there}")
            continue
        is_so = robot.status == expected.status
        yield Finding(name, f"its status is {expected.status}", is_so, f"it is {robot.status}: {robot.message}")
        if expected.reasons is not None:
            reasons = " or ".join(expected.reasons)
            found = f"the reason is {robot.reason}: {robot.message}"
            yield Finding(name, f"the reason is {reasons}", robot.reason in expected.reasons, found)
        yield from _of_merged(expected, robot)


def _of_merged(expected: RobotExpectation, robot: RobotResult) -> Iterator[Finding]:
    if expected.pose is not None:
        yield _pose(robot.robot, expected.pose, robot.merged_from_map)
    # what a robot that is not placed has of these is that of its best refused candidate
    is_merged = robot.status == "merged"
    figures = (
        ("acceptance", expected.min_acceptance, robot.acceptance, "{:.3f}"),
        ("confidence", expected.min_confidence, robot.confidence, "{:.4f}"),
        ("overlap", expected.min_overlap_m2, robot.overlap_m2, "{:.1f} m²"),
    )
    for name, least, value, form in figures:
        if least is not None:
            known = value if is_merged else None
            found = "there is none" if known is None else f"it is {_down(known, form)}"
            what = f"its {name} is at least {form.format(least)}"
            yield Finding(robot.robot, what, known is not None and known >= least, found)
    if expected.merged_within_s is not None:
        yield _time(robot, expected.merged_within_s)


def _time(robot: RobotResult, most_s: float) -> Finding:
    after_s = robot.merged_after_s if robot.status == "merged" else None
    if after_s is not None:
        found = f"it was merged after {after_s:.1f} s"
    else:
        found = "it is not merged" if robot.status != "merged" else "its report does not say when: merge again"
    what = f"it is merged within {most_s:g} s of the first map"
    return Finding(robot.robot, what, after_s is not None and after_s <= most_s, found)


def _pose(robot: str, expected: PoseExpectation, found: Sim2 | None) -> Finding:
    true = expected.merged_from_map
    where = f"x {true.x_m:g} m, y {true.y_m:g} m, yaw {math.degrees(true.yaw_rad):.6g}°"
    what = f"it lies at {where}, within {expected.within_m:g} m and {expected.within_deg:g}°"
    if found is None:
        return Finding(robot, what, False, "it is not placed")
    off = error_of(found, true, expected.at_m)
    holds = off.within(expected.within_m, expected.within_deg)
    said = f"it lies {off.distance_m:.3f} m and {off.angle_deg:.2f}° off, at {found.in_words(3)}"
    if expected.scaled:
        ratio = abs(found.scale / true.scale - 1.0)
        what += f", with scale {true.scale:g} within {expected.within_scale:g}"
        holds, said = holds and ratio <= expected.within_scale, f"{said}, with scale {found.scale:.4f}"
    return Finding(robot, what, holds, said)


def _down(value: float, form: str) -> str:
    """Return a figure rounded down, so that what is less than a limit reads like that."""
    return form.format(rounded_down(value, int(form.partition(".")[2][0])))
