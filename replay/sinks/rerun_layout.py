"""Where each robot's map is shown: at its placement or, without one, parked to the right of the merged map."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mapmerge.result import MergeResult
from mapmerge.sim2 import Points, Sim2
from replay.sinks.rerun_labels import PointM, label_places_m

_LEAST_GAP_M = 2.0
_GAP_SHARE = 0.08
_LABEL_GAP_SHARE = 0.2
_MARGIN = 1.16
_EYE_FIELD_RAD = math.radians(55.0)
_EYE_ASPECT = 1.3
_LABEL_SHARE = 0.08
_BEFORE_SHARE = 0.4


@dataclass(frozen=True, slots=True)
class Box:
    """An upright rectangle in the merged frame."""

    x0_m: float
    y0_m: float
    x1_m: float
    y1_m: float

    @staticmethod
    def around(points_m: Points) -> Box:
        """Return the smallest box that holds these points."""
        low, high = points_m.min(axis=0), points_m.max(axis=0)
        return Box(float(low[0]), float(low[1]), float(high[0]), float(high[1]))

    def joined(self, other: Box | None) -> Box:
        """Return the smallest box that holds both."""
        if other is None:
            return self
        return Box(
            min(self.x0_m, other.x0_m),
            min(self.y0_m, other.y0_m),
            max(self.x1_m, other.x1_m),
            max(self.y1_m, other.y1_m),
        )

    def within(self, other: Box, margin_m: float) -> Box:
        """Return what of the box is at most so far outside of another one, which it meets."""
        return Box(
            max(self.x0_m, other.x0_m - margin_m),
            max(self.y0_m, other.y0_m - margin_m),
            min(self.x1_m, other.x1_m + margin_m),
            min(self.y1_m, other.y1_m + margin_m),
        )

    @property
    def width_m(self) -> float:
        """Extent along x."""
        return self.x1_m - self.x0_m

    @property
    def height_m(self) -> float:
        """Extent along y."""
        return self.y1_m - self.y0_m

    @property
    def centre_m(self) -> PointM:
        """Middle of the box."""
        return (self.x0_m + self.x1_m) / 2, (self.y0_m + self.y1_m) / 2


@dataclass(frozen=True, slots=True)
class Layout:
    """Where the maps are shown.

    Parameters
    ----------
    merged_from_map
        Of each robot that has a map with anything in it, in the order of the robots.
    labels_m
        Where each of these robots' labels hangs.
    extent
        About what all of these maps know, without what only some rays reached; None without maps.
    """

    merged_from_map: Mapping[str, Sim2]
    labels_m: Mapping[str, PointM]
    extent: Box | None


def lay_out(result: MergeResult, corners_m: Mapping[str, Points], places_m: Mapping[str, Points]) -> Layout:
    """Place all maps.

    Maps that fit each other, but not the reference's, are parked together, as they fit.

    Parameters
    ----------
    result
        What is known of the robots.
    corners_m
        Corners of what each map knows, in its map frame, for those that know anything.
    places_m
        What each of these maps knows, in its map frame: see `replay.sinks.rerun_labels.known_places_m`.
    """
    shown: dict[str, Sim2] = {}
    parked: dict[str, dict[str, Sim2]] = {}
    for robot, outcome in result.robots.items():
        if robot not in corners_m:
            continue
        if outcome.merged_from_map is not None:
            shown[robot] = outcome.merged_from_map
        elif outcome.placement is not None:
            parked.setdefault(outcome.placement.component, {})[robot] = outcome.placement.component_from_map
    labels_m = label_places_m(shown, places_m)
    base = _covered(shown, corners_m)
    for poses in _park(base, parked, corners_m):
        shown.update(poses)
        labels_m.update(_below(poses, corners_m))
    ordered = {robot: shown[robot] for robot in result.robots if robot in shown}
    return Layout(ordered, labels_m, _covered(ordered, {**corners_m, **places_m}))


def _below(poses: Mapping[str, Sim2], corners_m: Mapping[str, Points]) -> dict[str, PointM]:
    """Return points side by side below maps that are parked together."""
    box = _covered(poses, corners_m)
    if box is None:
        return {}
    share_m = box.width_m / len(poses)
    return {robot: (box.x0_m + share_m * (index + 0.5), box.y0_m) for index, robot in enumerate(poses)}


def _covered(poses: Mapping[str, Sim2], corners_m: Mapping[str, Points]) -> Box | None:
    if not poses:
        return None
    return Box.around(np.concatenate([pose.apply(corners_m[robot]) for robot, pose in poses.items()]))


def _park(
    base: Box | None, parked: Mapping[str, Mapping[str, Sim2]], corners_m: Mapping[str, Points]
) -> Iterator[dict[str, Sim2]]:
    """Stack components in columns to the right of ``base``, centred on it, and yield where each lies."""
    boxes = {name: box for name, poses in parked.items() if (box := _covered(poses, corners_m)) is not None}
    start = base or Box(0.0, 0.0, 0.0, 0.0)
    column_m = max([start.height_m, *(box.height_m for box in boxes.values())])
    gap_m = max(_LEAST_GAP_M, _GAP_SHARE * max(start.width_m, column_m))
    below_m = max(_LEAST_GAP_M, _LABEL_GAP_SHARE * column_m)
    left_m = start.x1_m + (gap_m if base else 0.0)
    for column in _columns(boxes, column_m, below_m):
        top_m = start.centre_m[1] + _stacked_m(column, boxes, below_m) / 2
        for name in column:
            shift = Sim2(left_m - boxes[name].x0_m, top_m - boxes[name].y1_m)
            yield {robot: shift @ pose for robot, pose in parked[name].items()}
            top_m -= boxes[name].height_m + below_m
        left_m += max(boxes[name].width_m for name in column) + gap_m


def _columns(boxes: Mapping[str, Box], limit_m: float, gap_m: float) -> list[list[str]]:
    """Break components into columns of limited height, in their order."""
    columns: list[list[str]] = []
    for name in boxes:
        if columns and _stacked_m([*columns[-1], name], boxes, gap_m) <= limit_m:
            columns[-1].append(name)
        else:
            columns.append([name])
    return columns


def _stacked_m(column: Sequence[str], boxes: Mapping[str, Box], gap_m: float) -> float:
    return sum(boxes[name].height_m for name in column) + gap_m * (len(column) - 1)


def in_view(now: Box, ever: Box) -> Box:
    """Return what to look at: all that is shown in the end, and what was shown before, if it is not much farther off.

    Maps are parked beside smaller ones at first, some of them beyond what the merged map covers in the end.
    """
    return ever.within(now, _BEFORE_SHARE * max(now.width_m, now.height_m))


def eye(extent: Box) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Return from where, and at which point, to look so that an extent and the labels below it just fill the view."""
    x_m, y_m = extent.centre_m
    side_m = max(extent.height_m, extent.width_m / _EYE_ASPECT, 1.0) * (1.0 + _LABEL_SHARE)
    y_m -= side_m * _LABEL_SHARE / 2
    return (x_m, y_m, side_m / 2 * _MARGIN / math.tan(_EYE_FIELD_RAD / 2)), (x_m, y_m, 0.0)
