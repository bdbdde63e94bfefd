"""What is recorded, small so that a variant takes a moment: two robots in one flat, a third in another.

The third must never be merged: what is damaged may make maps look alike.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from benchmarks.faults.messages import MapContent, Message, UpdateContent
from mapmerge.grid import Grid
from mapmerge.sim2 import Sim2

SECOND_NS = 1_000_000_000
START_NS = 1_700_000_000 * SECOND_NS
RESOLUTION_M = 0.15
SIZE_M = (12.0, 9.9)
PARTS_M = (4.5, 7.5, 9.0)
"""How far from the west each of a robot's maps reaches."""

Box = tuple[float, float, float, float]
FLAT: tuple[Box, ...] = (
    (-0.15, -0.15, 9.15, 0.0),
    (-0.15, 6.0, 9.15, 6.15),
    (-0.15, 0.0, 0.0, 6.0),
    (9.0, 0.0, 9.15, 6.0),
    (3.45, 0.0, 3.6, 2.25),
    (3.45, 3.15, 3.6, 6.0),
    (3.6, 3.75, 7.35, 3.9),
    (6.15, 0.0, 6.3, 1.35),
    (0.0, 4.35, 1.2, 4.5),
    (7.8, 1.65, 8.55, 2.55),
    (4.2, 5.1, 5.1, 5.55),
)
OTHER_FLAT: tuple[Box, ...] = (
    *FLAT[:4],
    (2.1, 1.5, 2.25, 6.0),
    (5.4, 0.0, 5.55, 4.2),
    (5.55, 4.05, 7.8, 4.2),
    (2.25, 2.7, 4.05, 2.85),
    (6.9, 0.9, 7.8, 1.2),
    (0.6, 0.6, 1.2, 1.5),
)
BARE_ROOM = FLAT[:4]
SQUARE_ROOM: tuple[Box, ...] = (
    (1.35, -0.15, 7.65, 0.0),
    (1.35, 6.0, 7.65, 6.15),
    (1.35, 0.0, 1.5, 6.0),
    (7.5, 0.0, 7.65, 6.0),
)
ONE_WALL: tuple[Box, ...] = ((-0.15, 3.0, 9.15, 3.15),)
CORRIDOR: tuple[Box, ...] = ((-0.15, 2.1, 9.15, 2.25), (-0.15, 3.9, 9.15, 4.05))
ODD_BUILDINGS = (BARE_ROOM, SQUARE_ROOM, ONE_WALL, CORRIDOR)
FLOOR_FROM_MAP: Mapping[str, Sim2] = {
    "r1": Sim2(-1.0, -1.0),
    "r2": Sim2(10.2, 1.3, 2.2),
    "r3": Sim2(-0.9, -1.2, 0.2),
}
STRANGER = "r3"


def messages() -> tuple[Message, ...]:
    """Return what is recorded, in order of time."""
    maps = [
        _map_message(robot, part, 4.0 * part + late_s)
        for robot, late_s in (("r1", 0.0), ("r2", 1.0), ("r3", 2.0))
        for part in range(len(PARTS_M))
        if (robot, part) != (STRANGER, 0)
    ]
    updates = [_update("r1", 9.5, 20, 20), _update("r1", 10.5, 30, 25)]
    chatter = [Message("/chatter", _at(seconds), b"nothing of note " * 40) for seconds in (0.5, 3.5, 7.5, 11.0)]
    return tuple(sorted([*maps, *updates, *chatter], key=lambda each: each.log_time_ns))


def robot_of(topic: str) -> str:
    """Return whose topic it is."""
    return topic.split("/")[1]


def robot_map(robot: str, part: int) -> Grid:
    """Return one of a robot's maps, known up to so far from the west."""
    return drawn_map(robot, part, OTHER_FLAT if robot == STRANGER else FLAT)


@functools.cache
def drawn_map(robot: str, part: int, walls: tuple[Box, ...]) -> Grid:
    """Return a map of a building in the frame of a robot: as far as its walls reach, and known up to its part."""
    rows, cols = round(SIZE_M[1] / RESOLUTION_M), round(SIZE_M[0] / RESOLUTION_M)
    row, col = np.indices((rows, cols)).reshape(2, -1)
    # Cells whose centres stray by up to half a cell, as no robot's cells lie along a wall exactly.
    stray = np.random.default_rng([part, *robot.encode()]).uniform(-0.3, 0.3, (rows * cols, 2))
    centres_m = (np.stack([col + 0.5, row + 0.5], axis=1) + stray) * RESOLUTION_M
    x_m, y_m = FLOOR_FROM_MAP[robot].apply(centres_m).T
    until_m = min(PARTS_M[part], max(wall[2] for wall in walls) - RESOLUTION_M)
    from_m = min(wall[0] for wall in walls) + RESOLUTION_M
    cells = np.full(len(x_m), -1, np.int8)
    cells[(x_m >= from_m) & (x_m < until_m) & (y_m >= 0.0) & (y_m < 6.0)] = 0
    for x0_m, y0_m, x1_m, y1_m in walls:
        cells[(x_m >= x0_m) & (x_m < min(x1_m, PARTS_M[part])) & (y_m >= y0_m) & (y_m < y1_m)] = 100
    return Grid(cells.reshape(rows, cols), RESOLUTION_M)


def map_content(grid: Grid, stamp_ns: int) -> MapContent:
    """Return what a message with this map says."""
    pose, half = grid.map_from_grid, grid.map_from_grid.yaw_rad / 2
    return MapContent(
        stamp_ns,
        b"map",
        grid.resolution_m,
        grid.cols,
        grid.rows,
        (pose.x_m, pose.y_m, 0.0, 0.0, 0.0, math.sin(half), math.cos(half)),
        grid.cells.tobytes(),
    )


def changed(message: Message, **fields: object) -> Message:
    """Return a message whose content says something else."""
    return replace(message, content=replace(message.content, **fields))  # type: ignore[type-var]


def indices_of_maps(recorded: Sequence[Message]) -> list[int]:
    """Return which messages are full maps."""
    return [index for index, each in enumerate(recorded) if isinstance(each.content, MapContent)]


def _map_message(robot: str, part: int, seconds: float) -> Message:
    return Message(f"/{robot}/map", _at(seconds), map_content(robot_map(robot, part), _at(seconds) - 1000))


def _update(robot: str, seconds: float, x: int, y: int) -> Message:
    cells = robot_map(robot, len(PARTS_M) - 1).cells[y : y + 8, x : x + 10].tobytes()
    content = UpdateContent(_at(seconds) - 1000, b"map", x, y, 10, 8, cells)
    return Message(f"/{robot}/map_updates", _at(seconds), content)


def _at(seconds: float) -> int:
    return START_NS + round(seconds * SECOND_NS)
