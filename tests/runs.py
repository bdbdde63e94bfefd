"""Small runs: robots that map one drawn flat, each in a frame of its own, and what they would record."""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mapmerge.grid import Grid
from mapmerge.sim2 import IDENTITY, Sim2
from replay.sources.base import GRID_TYPE, TF_TYPE, UPDATE_TYPE
from tests.bags import SECOND, START, Recorded, map_fields
from tests.floors import FLAT_M, FLAT_WALLS, UNKNOWN, drawn, errors, filled, in_frame, within

RESOLUTION_M = 0.1
FLOOR_FROM_MAP: Mapping[str, Sim2] = {
    "r1": Sim2(-1.0, -1.0),
    "r2": Sim2(10.2, 1.3, 2.2),
    "r3": Sim2(-0.6, 6.9, -0.8),
}


@functools.cache
def flat_map(robot: str, east_m: float = FLAT_M[0], resolution_m: float = RESOLUTION_M) -> Grid:
    """Return a robot's map of the flat, known up to ``east_m``."""
    return drawn(
        within(0.0, 0.0, east_m, FLAT_M[1]),
        [(x0_m, y0_m, min(x1_m, east_m), y1_m) for x0_m, y0_m, x1_m, y1_m in FLAT_WALLS if x0_m < east_m],
        size_m=(12.0, 10.0),
        resolution_m=resolution_m,
        floor_from_map=FLOOR_FROM_MAP[robot],
    )


def begun_anew(grid: Grid) -> Grid:
    """Return the same map in another frame, as after a restart."""
    return in_frame(grid, Sim2(3.0, -2.0, 1.0))


def bare_room() -> Grid:
    """Return a map of one wall, too little to be placed by."""
    cells = filled(UNKNOWN, 60, 60, RESOLUTION_M).cells.copy()
    cells[10:50, 10:50] = 0
    cells[10, 10:50] = 100
    return Grid(cells, RESOLUTION_M)


def forgetting(robot: str, count: int) -> list[Recorded]:
    """Return maps, one a second, of which each knows nothing of what the one before it knew: all but the first jump."""
    found = []
    for index in range(count):
        cells = np.full((40, 60), UNKNOWN, np.int8)
        cells[5:35, slice(2, 28) if index % 2 else slice(32, 58)] = 0
        found.append(seen(robot, float(index), Grid(cells, RESOLUTION_M)))
    return found


def at(seconds: float) -> int:
    """Return a time of the recordings, in nanoseconds."""
    return START + round(seconds * SECOND)


def seen(
    robot: str,
    seconds: float,
    grid: Grid | None = None,
    *,
    topic: str | None = None,
    frame: str = "map",
    stamp_ns: int | None = None,
    **fields: Any,
) -> Recorded:
    """Return a map as a robot records it; ``fields`` are what its message says instead."""
    grid = flat_map(robot) if grid is None else grid
    log_ns = at(seconds)
    known = map_fields(grid, log_ns if stamp_ns is None else stamp_ns, frame)
    return Recorded(topic or f"/{robot}/map", GRID_TYPE, log_ns, {**known, **fields})


def updated(robot: str, seconds: float, col: int, row: int, cells: np.ndarray) -> Recorded:
    """Return an update of a part of a robot's map."""
    rows, cols = cells.shape
    fields = {"stamp_ns": at(seconds), "frame_id": "map", "x": col, "y": row, "width": cols, "height": rows}
    return Recorded(f"/{robot}/map_updates", UPDATE_TYPE, at(seconds), {**fields, "data": cells.reshape(-1)})


def link(
    parent: str, child: str, pose: Sim2 = IDENTITY, stamp_ns: int = 0, *, roll_rad: float = 0.0, **fields: Any
) -> dict[str, Any]:
    """Return a transform of a message; ``fields`` are what it says instead."""
    roll, yaw = roll_rad / 2, pose.yaw_rad / 2
    turn = (
        math.cos(yaw) * math.sin(roll),
        math.sin(yaw) * math.sin(roll),
        math.sin(yaw) * math.cos(roll),
        math.cos(yaw) * math.cos(roll),
    )
    known = {"parent": parent, "child": child, "stamp_ns": stamp_ns, "shift": (pose.x_m, pose.y_m, 0.0), "turn": turn}
    return {**known, **fields}


def linked(
    seconds: float, *links: dict[str, Any], static: bool = False, msgtype: str = TF_TYPE, stamp_ns: int | None = None
) -> Recorded:
    """Return transforms as they are recorded; those without a stamp have that of the message."""
    stamp_ns = at(seconds) if stamp_ns is None else stamp_ns
    stamped = [{**each, "stamp_ns": each["stamp_ns"] or stamp_ns} for each in links]
    return Recorded("/tf_static" if static else "/tf", msgtype, at(seconds), {"links": stamped})


def growing(robot: str, first_s: float = 0.0, **options: Any) -> list[Recorded]:
    """Return a robot's three maps, ten seconds apart, the first too small to be placed by."""
    shares_m = (1.0, 7.0, 9.0)
    return [
        seen(robot, first_s + 10.0 * index, flat_map(robot, east_m), **options) for index, east_m in enumerate(shares_m)
    ]


def in_log_order(*parts: Sequence[Recorded]) -> list[Recorded]:
    return sorted((each for part in parts for each in part), key=lambda each: each.log_time_ns)


def two_robots() -> list[Recorded]:
    """Return what most tests record: r1 and r2, whose maps grow, r2 two seconds behind."""
    return in_log_order(growing("r1"), growing("r2", 2.0))


def bad_messages(robot: str, first_s: float) -> dict[str, Recorded]:
    """Return a message of each kind that cannot be used, a second apart, by the cause that is to be counted."""
    line = np.zeros(100_001, np.int8)
    known: dict[str, Mapping[str, Any]] = {
        "size_mismatch": {"height": 7},
        "bad_resolution": {"resolution": math.nan},
        "bad_origin": {"position": (math.nan, 0.0, 0.0)},
        "too_large": {"width": line.size, "height": 1, "data": line},
        "empty": {"width": 0, "height": 0, "data": line[:0]},
    }
    messages = {cause: seen(robot, first_s + index, **fields) for index, (cause, fields) in enumerate(known.items())}
    whole = seen(robot, first_s + len(messages))
    cut = Recorded(whole.topic, whole.msgtype, whole.log_time_ns, whole.fields, lost_bytes=9)
    return {**messages, "undecodable": cut}


def reference_from(robot: str, reference: str = "r1") -> Sim2:
    """Return where a robot's map frame truly lies in the reference's."""
    return FLOOR_FROM_MAP[reference].inverse() @ FLOOR_FROM_MAP[robot]


def is_right(found: Mapping[str, float] | None, true: Sim2, at_m: tuple[float, float] = (5.0, 4.0)) -> bool:
    """Tell whether a reported pose is within 0.20 m and 1° of the truth."""
    if found is None:
        return False
    error_m, error_deg = errors(Sim2(found["x_m"], found["y_m"], found["yaw_rad"], found["scale"]), true, at_m)
    return error_m <= 0.20 and error_deg <= 1.0
