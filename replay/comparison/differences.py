"""What differs between the outcomes of two runs."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from mapmerge.sim2 import Sim2, wrap_angle
from replay.errors import UsageError
from replay.placement_error import error_of
from replay.run_result import RobotResult, RunResult

_DIGITS = 6
_WRITTEN = "outputs"
"""The settings of what is written, which change no outcome."""


@dataclass(frozen=True, slots=True)
class Tolerance:
    """How much may differ.

    Parameters
    ----------
    distance_m, angle_deg
        Of poses: at the middle of what the robot's map knows, and of the turn.
    share
        Of acceptance and confidence; and of scale, as a share of it.
    area_share
        Of overlaps, as a share of the larger one.
    time_s
        Of when a robot was placed first.
    """

    distance_m: float = 0.05
    angle_deg: float = 0.5
    share: float = 0.02
    area_share: float = 0.05
    time_s: float = 1.0

    def __post_init__(self) -> None:
        for name in ("distance_m", "angle_deg", "share", "area_share", "time_s"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise UsageError(f"a tolerance is {getattr(self, name)}; expected a number, 0 or more")


@dataclass(frozen=True, slots=True)
class Difference:
    """Something that is not as it was.

    Parameters
    ----------
    robot
        Whose; "" of the run.
    what
        What differs: appeared, vanished, placed, lost, status, reason, moved, acceptance, confidence, overlap, time,
        reference, skipped.
    before, after
        What was, and what is, in words.
    detail
        By how much, in words.
    amounts
        The same as numbers, by names that carry their units.
    """

    robot: str
    what: str
    before: str
    after: str
    detail: str = ""
    amounts: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Comparison:
    """Two runs side by side.

    Parameters
    ----------
    differences
        What is not as it was, beyond the tolerances.
    notes
        What a reader should know of it: none of it is a difference of outcomes.
    """

    differences: tuple[Difference, ...]
    notes: tuple[str, ...]


def compare(before: RunResult, after: RunResult, tolerance: Tolerance) -> Comparison:
    """Return what differs between two runs.

    Poses are compared in the first run's merged frame. Where the reference is another robot, those of the second run
    are taken there by the place of the first reference in it; where it has none, poses cannot be compared.
    """
    frame = _before_from_after(before, after)
    found = [*_of_run(before, after)]
    for robot in dict.fromkeys([*before.robots, *after.robots]):
        one, other = before.robots.get(robot), after.robots.get(robot)
        if one is None and other is not None:
            found.append(Difference(robot, "appeared", "–", other.status, other.message))
        elif other is None and one is not None:
            found.append(Difference(robot, "vanished", one.status, "–"))
        elif one is not None and other is not None:
            if before.reference == after.reference:
                places = one.is_placed, other.is_placed
            else:  # a reference is always placed, which says nothing where another robot is it
                places = before.is_joined(robot), after.is_joined(robot)
            found.extend(_of_place(one, other, places))
            if all(places):
                found.extend(_of_placed(one, other, frame, tolerance))
    return Comparison(tuple(found), tuple(_notes(before, after, frame)))


def _before_from_after(before: RunResult, after: RunResult) -> Sim2 | None:
    """Return where the second run's merged frame lies in the first one's; None if nothing tells."""
    if before.reference == after.reference:
        return Sim2()
    there = after.robots.get(before.reference)
    return there.merged_from_map.inverse() if there is not None and there.merged_from_map is not None else None


def _of_run(before: RunResult, after: RunResult) -> Iterator[Difference]:
    if before.reference != after.reference:
        yield Difference("", "reference", before.reference, after.reference)
    for cause in sorted({*before.skipped, *after.skipped}):
        one, other = before.skipped.get(cause, 0), after.skipped.get(cause, 0)
        if one != other:
            yield Difference("", "skipped", str(one), str(other), f"{cause}: {other - one:+d}", {cause: other - one})


def _of_place(one: RobotResult, other: RobotResult, places: tuple[bool, bool]) -> Iterator[Difference]:
    """Yield whether a robot was placed or lost, or is in another way, or for another reason, not merged."""
    was_placed, is_placed = places
    if was_placed != is_placed:
        yield Difference(one.robot, "placed" if is_placed else "lost", one.status, other.status, other.message)
    elif not one.is_placed and not other.is_placed:
        if one.status != other.status:
            yield Difference(one.robot, "status", one.status, other.status, other.message)
        if one.reason != other.reason:
            yield Difference(one.robot, "reason", one.reason, other.reason, other.message)


def _of_placed(one: RobotResult, other: RobotResult, frame: Sim2 | None, tolerance: Tolerance) -> Iterator[Difference]:
    """Yield how the place of a robot that is merged in both runs differs, and how sure it is."""
    if frame is not None and one.merged_from_map is not None and other.merged_from_map is not None:
        yield from _moved(
            one.robot, one.merged_from_map, frame @ other.merged_from_map, _between_m(one, other), tolerance
        )
    yield from _figures(one, other, tolerance)


def _between_m(one: RobotResult, other: RobotResult) -> tuple[float, float]:
    """Return where positions are compared: the origin of the map frame may be far from the map.

    That is between the middles of what the map knew in both runs, or the one that is known; the origin if none is.
    """
    known_m = [centre_m for centre_m in (one.centre_m, other.centre_m) if centre_m is not None] or [(0.0, 0.0)]
    return sum(x_m for x_m, _ in known_m) / len(known_m), sum(y_m for _, y_m in known_m) / len(known_m)


def _moved(robot: str, one: Sim2, other: Sim2, at_m: tuple[float, float], tolerance: Tolerance) -> Iterator[Difference]:
    (x_m, y_m), (to_x_m, to_y_m) = one.apply_point(*at_m), other.apply_point(*at_m)
    dx_m, dy_m = to_x_m - x_m, to_y_m - y_m
    turn_deg = math.degrees(wrap_angle(other.yaw_rad - one.yaw_rad))
    ratio = other.scale / one.scale
    off = error_of(other, one, at_m)
    if off.within(tolerance.distance_m, tolerance.angle_deg) and abs(ratio - 1.0) <= tolerance.share:
        return
    detail = f"by {off.distance_m:.3f} m amid its map (x {dx_m:+.3f}, y {dy_m:+.3f}), turned by {turn_deg:+.2f}°"
    if ratio != 1.0:
        detail += f", scaled by {ratio:.4f}"
    amounts = {"distance_m": off.distance_m, "dx_m": dx_m, "dy_m": dy_m, "turn_deg": turn_deg, "scale_ratio": ratio}
    yield Difference(robot, "moved", one.in_words(3), other.in_words(3), detail, _rounded(amounts))


def _figures(one: RobotResult, other: RobotResult, tolerance: Tolerance) -> Iterator[Difference]:
    """Yield the figures that differ."""
    for name in ("acceptance", "confidence"):
        yield from _figure(one.robot, name, getattr(one, name), getattr(other, name), tolerance.share, "{:.3f}")
    largest = max(one.overlap_m2 or 0.0, other.overlap_m2 or 0.0)
    allowed_m2 = tolerance.area_share * largest
    yield from _figure(one.robot, "overlap", one.overlap_m2, other.overlap_m2, allowed_m2, "{:.1f} m²")
    if one.status == other.status == "merged":
        yield from _figure(one.robot, "time", one.merged_after_s, other.merged_after_s, tolerance.time_s, "{:.1f} s")


def _figure(
    robot: str, what: str, one: float | None, other: float | None, allowed: float, form: str
) -> Iterator[Difference]:
    # a figure that one version tells and another does not is no change of the outcome
    if one is None or other is None or abs(other - one) <= allowed:
        return
    sign = "+" if other > one else "−"
    detail = sign + form.format(abs(other - one))
    amounts = _rounded({"before": one, "after": other})
    yield Difference(robot, what, form.format(one), form.format(other), detail, amounts)


def _rounded(amounts: Mapping[str, float]) -> dict[str, float]:
    return {name: round(value, _DIGITS) + 0.0 for name, value in amounts.items()}


def _notes(before: RunResult, after: RunResult, frame: Sim2 | None) -> Iterator[str]:
    if before.version != after.version:
        yield f"made by replay {before.version} and by replay {after.version}"
    one_digests, other_digests = (sorted((item.name, item.sha256) for item in run.inputs) for run in (before, after))
    if one_digests != other_digests:
        one_left, other_left = Counter(one_digests), Counter(other_digests)
        names = sorted({name for name, _ in (*(one_left - other_left), *(other_left - one_left))})
        yield f"what was used of the inputs is not the same: {', '.join(names)}"
    one, other = ({**run.settings, _WRITTEN: None} for run in (before, after))
    changed = sorted(_changed(one, other))
    if changed:
        yield f"the settings are not the same: {', '.join(changed)}"
    if frame is None:
        yield (
            f"poses cannot be compared: the first run's are in the frame of {before.reference}, which the second one "
            "did not place"
        )


def _changed(one: object, other: object, name: str = "") -> Iterator[str]:
    """Yield the names of settings that differ."""
    if isinstance(one, dict) and isinstance(other, dict):
        for key in {**one, **other}:
            yield from _changed(one.get(key), other.get(key), f"{name}.{key}" if name else str(key))
    elif one != other:
        yield name
