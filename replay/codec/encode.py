"""Maps, transforms and pictures → ROS 2 messages in CDR."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mapmerge.grid import Grid
from mapmerge.sim2 import Sim2
from replay.codec.typestores import ros2_typestore
from replay.errors import OutputError
from replay.sources.base import GRID_TYPE, TF_TYPE

if TYPE_CHECKING:
    from mapmerge.render import Rgb

IMAGE_TYPE = "sensor_msgs/msg/Image"

_NS = 1_000_000_000


@dataclass(frozen=True, slots=True)
class FrameTransform:
    """``parent_from_child`` between two named frames; its scale is not written, for ROS transforms are rigid."""

    parent: str
    child: str
    parent_from_child: Sim2


def encode_grid(grid: Grid, frame_id: str, stamp_ns: int) -> memoryview:
    """Return a map as a ``nav_msgs/OccupancyGrid``; its ``map_load_time`` is left at 0.

    Raises
    ------
    OutputError
        If the stamp does not fit the message: its seconds end in the year 2038.
    """
    pose = grid.map_from_grid
    message = _new(
        GRID_TYPE,
        header=_header(frame_id, stamp_ns),
        info=_new(
            "nav_msgs/msg/MapMetaData",
            map_load_time=_time(0),
            resolution=grid.resolution_m,
            width=grid.cols,
            height=grid.rows,
            origin=_new(
                "geometry_msgs/msg/Pose",
                position=_new("geometry_msgs/msg/Point", x=pose.x_m, y=pose.y_m, z=0.0),
                orientation=_turn(pose.yaw_rad),
            ),
        ),
        data=np.ascontiguousarray(grid.cells).reshape(-1),
    )
    return _encoded(message, GRID_TYPE)


def encode_transforms(transforms: Sequence[FrameTransform], stamp_ns: int) -> memoryview:
    """Return transforms as a ``tf2_msgs/TFMessage``; raises as `encode_grid` does."""
    stamped = [
        _new(
            "geometry_msgs/msg/TransformStamped",
            header=_header(item.parent, stamp_ns),
            child_frame_id=item.child,
            transform=_new(
                "geometry_msgs/msg/Transform",
                translation=_new(
                    "geometry_msgs/msg/Vector3", x=item.parent_from_child.x_m, y=item.parent_from_child.y_m, z=0.0
                ),
                rotation=_turn(item.parent_from_child.yaw_rad),
            ),
        )
        for item in transforms
    ]
    return _encoded(_new(TF_TYPE, transforms=stamped), TF_TYPE)


def encode_image(rgb: Rgb, frame_id: str, stamp_ns: int) -> memoryview:
    """Return a picture as a ``sensor_msgs/Image`` with encoding ``rgb8``; raises as `encode_grid` does."""
    rows, cols = rgb.shape[:2]
    message = _new(
        IMAGE_TYPE,
        header=_header(frame_id, stamp_ns),
        height=rows,
        width=cols,
        encoding="rgb8",
        is_bigendian=0,
        step=cols * 3,
        data=np.ascontiguousarray(rgb).reshape(-1),
    )
    return _encoded(message, IMAGE_TYPE)


def _new(msgtype: str, **values: Any) -> Any:  # noqa: ANN401 - message classes are made at run time
    return ros2_typestore().types[msgtype](**values)


def _header(frame_id: str, stamp_ns: int) -> Any:  # noqa: ANN401 - as above
    return _new("std_msgs/msg/Header", stamp=_time(stamp_ns), frame_id=frame_id)


def _time(stamp_ns: int) -> Any:  # noqa: ANN401 - as above
    sec, nanosec = divmod(stamp_ns, _NS)
    if not -(2**31) <= sec < 2**31:
        raise OutputError(f"the time {stamp_ns} ns does not fit a ROS 2 stamp, which has 32 bits for the seconds")
    return _new("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)


def _turn(yaw_rad: float) -> Any:  # noqa: ANN401 - as above
    return _new("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=math.sin(yaw_rad / 2), w=math.cos(yaw_rad / 2))


def _encoded(message: Any, msgtype: str) -> memoryview:  # noqa: ANN401 - as above
    return ros2_typestore().serialize_cdr(message, msgtype, little_endian=True)
