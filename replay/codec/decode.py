"""Recorded bytes → maps and updates of maps."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Protocol, cast

import numpy as np

from mapmerge.grid import MAX_SIDE_CELLS, UNKNOWN, Cells, Grid
from mapmerge.sim2 import Sim2
from replay.codec.deserialize import deserialized, header_stamp_ns
from replay.errors import BadMessage
from replay.messages import GridMessage, UpdateMessage
from replay.pose3 import MAX_PLACE_M, MAX_TILT_RAD, Pose3
from replay.sources.base import GRID_TYPE, UPDATE_TYPE, RawMessage

if TYPE_CHECKING:
    from rosbags.typesys.stores.ros2_jazzy import geometry_msgs__msg__Pose as Pose
    from rosbags.typesys.stores.ros2_jazzy import nav_msgs__msg__OccupancyGrid as OccupancyGrid
    from rosbags.typesys.stores.ros2_jazzy import std_msgs__msg__Header as Header


MIN_RESOLUTION_M, MAX_RESOLUTION_M = 1e-4, 10.0
"""No map of a robot's surroundings has smaller or larger cells: what says so is damaged, or not in metres."""


class _OccupancyGridUpdate(Protocol):
    """``map_msgs/OccupancyGridUpdate``, which no typestore of rosbags has."""

    header: Header
    x: int
    y: int
    width: int
    height: int
    data: Cells


def decode(raw: RawMessage) -> GridMessage | UpdateMessage:
    """Return the map, or the update of a map, that a recorded message holds.

    The cells are a read-only view of the message's bytes; they are copied only if some are outside −1 to 100, which
    become unknown.

    Raises
    ------
    BadMessage
        With one of these causes:

        - ``undecodable``: the bytes are no message of this type;
        - ``size_mismatch``: there are not width × height cells;
        - ``empty``: there is no cell;
        - ``too_large``: a side has over 100 000 cells;
        - ``bad_resolution``: it is no number of metres that a cell can have, see `MIN_RESOLUTION_M`;
        - ``bad_origin``: it is not finite, not flat, or farther away than anything is, see `MAX_PLACE_M`.
    """
    if raw.msgtype not in {GRID_TYPE, UPDATE_TYPE}:
        raise BadMessage("undecodable", f"{raw.msgtype} is no map; {GRID_TYPE} or {UPDATE_TYPE} was expected")
    message = deserialized(raw, raw.msgtype)
    if raw.msgtype == UPDATE_TYPE:
        return _update(cast("_OccupancyGridUpdate", message))
    return _grid(cast("OccupancyGrid", message))


def _grid(message: OccupancyGrid) -> GridMessage:
    info = message.info
    cells, odd_cells = _cells(message.data, info.width, info.height)
    resolution_m = _shortest(info.resolution)
    if not MIN_RESOLUTION_M <= resolution_m <= MAX_RESOLUTION_M:
        raise BadMessage(
            "bad_resolution",
            f"the resolution is {resolution_m} m; a positive number was expected, {MIN_RESOLUTION_M:g} to "
            f"{MAX_RESOLUTION_M:g}",
        )
    grid = Grid(cells, resolution_m, _flat_pose(info.origin))
    return GridMessage(header_stamp_ns(message.header), message.header.frame_id, grid, odd_cells)


def _shortest(single: float) -> float:
    """Return the number of fewest digits that is the same in single precision: 0.05, not 0.05000000074505806."""
    return float(str(np.float32(single)))


def _update(message: _OccupancyGridUpdate) -> UpdateMessage:
    cells, odd_cells = _cells(message.data, message.width, message.height)
    header = message.header
    return UpdateMessage(header_stamp_ns(header), header.frame_id, message.x, message.y, cells, odd_cells)


def _cells(data: Cells, width: int, height: int) -> tuple[Cells, int]:
    """Return the cells as rows and columns, read-only, and how many of them had no meaning."""
    odd_cells = 0
    if data.size != width * height:
        raise BadMessage(
            "size_mismatch", f"there are {data.size} cells; {width} × {height} = {width * height} were expected"
        )
    if data.size == 0:
        raise BadMessage("empty", f"the map has no cells: {width} × {height}")
    if max(width, height) > MAX_SIDE_CELLS:
        raise BadMessage("too_large", f"the map has {width} × {height} cells; at most {MAX_SIDE_CELLS} a side are read")
    if data.min() < UNKNOWN or data.max() > 100:
        has_meaning = (data >= UNKNOWN) & (data <= 100)
        odd_cells = data.size - int(np.count_nonzero(has_meaning))
        data = np.where(has_meaning, data, np.int8(UNKNOWN))
    cells = data.reshape(height, width)
    cells.flags.writeable = False
    return cells, odd_cells


def _flat_pose(pose: Pose) -> Sim2:
    """Return a pose in space as a pose in the plane.

    A quaternion of four zeros is taken as no turn, as RViz takes it: ROS 1 leaves it so in a message whose sender
    did not set it. Any other is normalised.
    """
    position, turn = pose.position, pose.orientation
    quaternion = (turn.x, turn.y, turn.z, turn.w)
    try:
        unset = quaternion == (0.0, 0.0, 0.0, 0.0)
        placed = Pose3.of((position.x, position.y, position.z), (0.0, 0.0, 0.0, 1.0) if unset else quaternion)
    except ValueError as error:
        raise BadMessage("bad_origin", f"the origin is {_text(pose)}; {error}") from None
    if max(abs(position.x), abs(position.y)) > MAX_PLACE_M:
        raise BadMessage(
            "bad_origin", f"the origin is {_text(pose)}; a place at most {MAX_PLACE_M:g} m away was expected"
        )
    if placed.tilt_rad > MAX_TILT_RAD:
        raise BadMessage(
            "bad_origin",
            f"the origin is tilted by {math.degrees(placed.tilt_rad):.0f}°: {_text(pose)}; a turn about z was expected",
        )
    return placed.flat()


def _text(pose: Pose) -> str:
    position, turn = pose.position, pose.orientation
    return f"({position.x}, {position.y}, {position.z}), quaternion ({turn.x}, {turn.y}, {turn.z}, {turn.w})"
