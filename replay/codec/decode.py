"""Recorded bytes → maps and updates of maps."""

from __future__ import annotations

import math
import struct
from typing import TYPE_CHECKING, Protocol, cast

import numpy as np

from mapmerge.grid import MAX_SIDE_CELLS, UNKNOWN, Cells, Grid
from mapmerge.sim2 import Sim2
from replay.codec.typestores import ros1_typestore, ros2_typestore
from replay.errors import BadMessage
from replay.messages import GridMessage, UpdateMessage
from replay.sources.base import GRID_TYPE, UPDATE_TYPE, RawMessage

if TYPE_CHECKING:
    from rosbags.typesys.stores.ros2_jazzy import geometry_msgs__msg__Pose as Pose
    from rosbags.typesys.stores.ros2_jazzy import nav_msgs__msg__OccupancyGrid as OccupancyGrid
    from rosbags.typesys.stores.ros2_jazzy import std_msgs__msg__Header as Header

MAX_TILT_RAD = math.radians(5.0)

_NS = 1_000_000_000


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
        - ``bad_resolution``: it is no positive number;
        - ``bad_origin``: it is not finite, or not flat.
    """
    message = _deserialized(raw)
    if raw.msgtype == UPDATE_TYPE:
        return _update(cast("_OccupancyGridUpdate", message))
    return _grid(cast("OccupancyGrid", message))


def _deserialized(raw: RawMessage) -> object:
    from rosbags.serde import SerdeError

    if raw.msgtype not in {GRID_TYPE, UPDATE_TYPE}:
        raise BadMessage("undecodable", f"{raw.msgtype} is no map; {GRID_TYPE} or {UPDATE_TYPE} was expected")
    # Given bytes, rosbags copies all of them to take off the first four.
    data = memoryview(raw.data)
    try:
        if raw.encoding == "ros1":
            return ros1_typestore().deserialize_ros1(data, raw.msgtype)
        return ros2_typestore().deserialize_cdr(data, raw.msgtype)
    except (SerdeError, struct.error, ValueError, LookupError, AssertionError, TypeError, OverflowError) as error:
        found = " ".join(str(error).split()) or type(error).__name__
        raise BadMessage(
            "undecodable", f"{len(raw.data)} bytes are no {raw.encoding} {raw.msgtype}: {found}"
        ) from error


def _grid(message: OccupancyGrid) -> GridMessage:
    info = message.info
    cells = _cells(message.data, info.width, info.height)
    if not (math.isfinite(info.resolution) and info.resolution > 0.0):
        raise BadMessage("bad_resolution", f"the resolution is {info.resolution} m; a positive number was expected")
    grid = Grid(cells, _shortest(info.resolution), _flat_pose(info.origin))
    return GridMessage(_stamp_ns(message.header), message.header.frame_id, grid)


def _shortest(single: float) -> float:
    """Return the number of fewest digits that is the same in single precision: 0.05, not 0.05000000074505806."""
    return float(str(np.float32(single)))


def _update(message: _OccupancyGridUpdate) -> UpdateMessage:
    cells = _cells(message.data, message.width, message.height)
    return UpdateMessage(_stamp_ns(message.header), message.header.frame_id, message.x, message.y, cells)


def _stamp_ns(header: Header) -> int:
    return header.stamp.sec * _NS + header.stamp.nanosec


def _cells(data: Cells, width: int, height: int) -> Cells:
    """Return the cells as rows and columns, read-only."""
    if data.size != width * height:
        raise BadMessage(
            "size_mismatch", f"there are {data.size} cells; {width} × {height} = {width * height} were expected"
        )
    if data.size == 0:
        raise BadMessage("empty", f"the map has no cells: {width} × {height}")
    if max(width, height) > MAX_SIDE_CELLS:
        raise BadMessage("too_large", f"the map has {width} × {height} cells; at most {MAX_SIDE_CELLS} a side are read")
    if data.min() < UNKNOWN or data.max() > 100:
        data = np.where((data >= UNKNOWN) & (data <= 100), data, np.int8(UNKNOWN))
    cells = data.reshape(height, width)
    cells.flags.writeable = False
    return cells


def _flat_pose(pose: Pose) -> Sim2:
    """Return a pose in space as a pose in the plane.

    A quaternion of four zeros is taken as no turn, as RViz takes it: ROS 1 leaves it so in a message whose sender
    did not set it. Any other is normalised.
    """
    position, turn = pose.position, pose.orientation
    if not all(map(math.isfinite, (position.x, position.y, position.z, turn.x, turn.y, turn.z, turn.w))):
        raise BadMessage("bad_origin", f"the origin is {_text(pose)}; finite numbers were expected")
    norm = math.hypot(turn.x, turn.y, turn.z, turn.w)
    if norm == 0.0:
        return Sim2(position.x, position.y)
    x, y, z, w = turn.x / norm, turn.y / norm, turn.z / norm, turn.w / norm
    # The angle between the map's z axis and that of its grid; hypot(x, y) is the sine of half of it.
    tilt_rad = 2.0 * math.asin(min(1.0, math.hypot(x, y)))
    if tilt_rad > MAX_TILT_RAD:
        raise BadMessage(
            "bad_origin",
            f"the origin is tilted by {math.degrees(tilt_rad):.0f}°: {_text(pose)}; a turn about z was expected",
        )
    return Sim2(position.x, position.y, math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))


def _text(pose: Pose) -> str:
    position, turn = pose.position, pose.orientation
    return f"({position.x}, {position.y}, {position.z}), quaternion ({turn.x}, {turn.y}, {turn.z}, {turn.w})"
