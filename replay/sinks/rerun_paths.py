"""Where robots drove in the Rerun recording: a line in the robot's colour under its map frame, which grows."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import rerun as rr

from replay.events import Moved
from replay.palette import Rgb
from replay.sinks.rerun_entities import RobotEntities
from replay.sinks.rerun_stream import RrdStream
from replay.tracker import JUMP_M

PIECE_POSES = 256
"""Of a longer line only the last piece is logged again, so that what is written grows as the line does."""

_HEIGHT_M = 0.35
_ARROW_M = 0.8
_LINE_RADIUS = rr.Radius.ui_points(0.7)
_DOT_RADIUS = rr.Radius.ui_points(5.0)
_ARROW_RADIUS = rr.Radius.ui_points(2.0)

_Place = tuple[float, float, float]


@dataclass(slots=True)
class _Line:
    """The last piece of a robot's line, as strips that are parted where the robot jumped."""

    piece: int = 0
    strips: list[list[_Place]] = field(default_factory=list)
    waiting: list[Moved] = field(default_factory=list)

    def add(self, place: _Place) -> None:
        if self.strips and math.dist(self.strips[-1][-1], place) <= JUMP_M:
            self.strips[-1].append(place)
        else:
            self.strips.append([place])

    @property
    def is_full(self) -> bool:
        return sum(map(len, self.strips)) >= PIECE_POSES

    def begin_piece(self) -> None:
        self.piece += 1
        self.strips = [self.strips[-1][-1:]]


class PathScene:
    """Logs where robots drove and where they are.

    Parameters
    ----------
    stream
        The recording.
    robots
        The robots.
    """

    def __init__(self, stream: RrdStream, robots: Sequence[RobotEntities]) -> None:
        self._stream = stream
        self._robots: Mapping[str, RobotEntities] = {entities.robot: entities for entities in robots}
        self._lines = {entities.robot: _Line() for entities in robots}

    def show(self, moved: Sequence[Moved], shown: Collection[str]) -> None:
        """Log what is new; of robots whose map is not shown yet, later."""
        for item in moved:
            self._lines[item.robot].waiting.append(item)
        for robot, line in self._lines.items():
            if line.waiting and robot in shown:
                poses = np.concatenate([item.poses for item in line.waiting])
                line.waiting.clear()
                self._extend(self._robots[robot], line, poses.tolist())

    def _extend(self, entities: RobotEntities, line: _Line, poses: Sequence[Sequence[float]]) -> None:
        for x_m, y_m, _ in poses:
            line.add((x_m, y_m, _HEIGHT_M))
            if line.is_full:
                self._log_piece(entities, line)
                line.begin_piece()
        self._log_piece(entities, line)
        x_m, y_m, yaw_rad = poses[-1]
        ahead = [_ARROW_M * math.cos(yaw_rad), _ARROW_M * math.sin(yaw_rad), 0.0]
        place = [[x_m, y_m, _HEIGHT_M]]
        dot = rr.Points3D(
            place, radii=_DOT_RADIUS, colors=[entities.colour], point_shading=rr.components.PointShading.Flat
        )
        arrow = rr.Arrows3D(origins=place, vectors=[ahead], radii=_ARROW_RADIUS, colors=[entities.colour])
        self._stream.log(entities.position, dot, arrow)

    def _log_piece(self, entities: RobotEntities, line: _Line) -> None:
        strips = [np.array(strip, np.float32) for strip in line.strips if len(strip) > 1]
        if strips:
            lines = rr.LineStrips3D(strips, radii=_LINE_RADIUS, colors=[_light(entities.colour)])
            self._stream.log(entities.path(line.piece), lines)


def _light(colour: Rgb) -> Rgb:
    """Return a colour so light that the way is told from walls of the same colour."""
    red, green, blue = ((part + 255) // 2 for part in colour)
    return red, green, blue
