"""Numbers over time in the Rerun recording: how well each robot's map agrees with the others, and what it cost."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import rerun as rr

from replay.events import Report, Timing
from replay.sinks.rerun_entities import LIMIT_COLOUR, PLOTS, EntityPath, RobotEntities
from replay.sinks.rerun_stream import RrdStream

QUANTITIES = ("acceptance", "confidence", "overlap_m2", "overlap_fraction")
"""Values of each robot in the report that are plotted."""
STEP_TIME = "step_ms"
TITLES: Mapping[str, str] = {
    "acceptance": "Acceptance index",
    "confidence": "Confidence",
    "overlap_m2": "Overlap, m²",
    "overlap_fraction": "Overlap, share",
    "x": "Placed at x, m",
    "y": "Placed at y, m",
    "yaw": "Placed at yaw, °",
    STEP_TIME: "Wall time per update, ms",
}
POSE = ("x", "y", "yaw")
"""Parts of where a map is placed that are plotted."""

_REFERENCE_WIDTH = 4.0
_WIDTH = 2.0
_STEPS: tuple[tuple[str, tuple[int, int, int]], ...] = (
    ("merge", (77, 163, 255)),
    ("render", (255, 159, 64)),
)


class Plots:
    """Logs a run's numbers.

    A robot that is not placed has the values of its best refused candidate. These are points rather than a line, on
    entities of their own, so that nobody takes them for the quality of a merged map.

    Parameters
    ----------
    stream
        The recording.
    robots
        The robots, the reference first.
    limit_of, limit
        Which quantity a placement is accepted by, and how much of it is needed.
    """

    def __init__(self, stream: RrdStream, robots: Sequence[RobotEntities], limit_of: str, limit: float) -> None:
        self._stream = stream
        self._robots = robots
        self._limit_path: EntityPath = [*PLOTS, limit_of, "limit"]
        self._limit = limit
        self._drawn: set[tuple[str, str]] = set()
        for entities in robots:
            for quantity in QUANTITIES:
                self._style(entities, quantity)
            for part in POSE if entities.index else ():
                stream.log(entities.pose_plot(part), self._line(entities, _WIDTH), static=True)
        line = rr.SeriesLines(colors=[LIMIT_COLOUR], widths=[1.0], names=["least accepted"])
        stream.log(self._limit_path, line, static=True)
        for name, colour in _STEPS:
            style = rr.SeriesLines(colors=[colour], widths=[_WIDTH], names=[name])
            stream.log([*PLOTS, STEP_TIME, name], style, static=True)

    def show(self, report: Report, timing: Timing) -> None:
        """Log the values of one tick."""
        for entities in self._robots:
            values = report["robots"][entities.robot]
            for quantity in QUANTITIES:
                self._show_value(entities, quantity, values)
            if entities.index:
                self._show_pose(entities, values["merged_from_map"])
        self._stream.log(self._limit_path, rr.Scalars(self._limit))
        for (name, _), seconds in zip(_STEPS, (timing.merge_s, timing.render_s), strict=True):
            self._stream.log([*PLOTS, STEP_TIME, name], rr.Scalars(seconds * 1000.0))

    def _style(self, entities: RobotEntities, quantity: str) -> None:
        # The reference agrees with the others as they do with it: its line is wide, so that theirs are seen on it.
        width = _WIDTH if entities.index else _REFERENCE_WIDTH
        self._stream.log(entities.plot(quantity, placed=True), self._line(entities, width), static=True)
        points = rr.SeriesPoints(
            colors=[entities.colour], markers=["cross"], marker_sizes=[4.0], names=[f"{entities.label_text}, refused"]
        )
        self._stream.log(entities.plot(quantity, placed=False), points, static=True)

    @staticmethod
    def _line(entities: RobotEntities, width: float) -> rr.SeriesLines:
        names, colours = [entities.label_text], [entities.colour]
        return rr.SeriesLines(colors=colours, widths=[width], names=names, interpolation_mode="StepAfter")

    def _show_pose(self, entities: RobotEntities, pose: Mapping[str, float] | None) -> None:
        """Log where a map is placed; the reference lies at the origin of its own frame, and is not plotted."""
        line = (entities.robot, "pose")
        if pose is None and line not in self._drawn:
            return
        values = (pose["x_m"], pose["y_m"], math.degrees(pose["yaw_rad"])) if pose else (math.nan,) * len(POSE)
        (self._drawn.add if pose else self._drawn.remove)(line)
        for part, value in zip(POSE, values, strict=True):
            self._stream.log(entities.pose_plot(part), rr.Scalars(value))

    def _show_value(self, entities: RobotEntities, quantity: str, values: Mapping[str, Any]) -> None:
        value, placed = values[quantity], values["merged_from_map"] is not None
        line = (entities.robot, quantity)
        if value is not None:
            self._stream.log(entities.plot(quantity, placed=placed), rr.Scalars(value))
        if placed and value is not None:
            self._drawn.add(line)
        elif line in self._drawn:
            # A gap, without which the line would go on to where the robot is placed again.
            self._drawn.remove(line)
            self._stream.log(entities.plot(quantity, placed=True), rr.Scalars(math.nan))
