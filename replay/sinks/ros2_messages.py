"""The ROS 2 messages that are written, encoded in CDR."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mapmerge.render import Rgb
from mapmerge.sim2 import Sim2
from replay.codec import ros2_typestore

TF_TYPE = "tf2_msgs/msg/TFMessage"
IMAGE_TYPE = "sensor_msgs/msg/Image"


def header(frame_id: str, stamp_ns: int) -> Any:  # noqa: ANN401 - made at run time
    """Return a ``std_msgs/Header``."""
    types = ros2_typestore().types
    sec, nanosec = divmod(stamp_ns, 1_000_000_000)
    stamp = types["builtin_interfaces/msg/Time"](sec=sec, nanosec=nanosec)
    return types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame_id)


@dataclass(frozen=True, slots=True)
class FrameTransform:
    """``parent_from_child`` between two named frames; its scale is not written, for ROS transforms are rigid."""

    parent: str
    child: str
    parent_from_child: Sim2


def encode_transforms(transforms: Sequence[FrameTransform], stamp_ns: int) -> bytes:
    """Return transforms as a ``tf2_msgs/TFMessage``."""
    types = ros2_typestore().types
    return _encoded(
        types[TF_TYPE](transforms=[_transform_stamped(types, item, stamp_ns) for item in transforms]), TF_TYPE
    )


def encode_image(rgb: Rgb, frame_id: str, stamp_ns: int) -> bytes:
    """Return a picture, shape (rows, columns, 3), as a ``sensor_msgs/Image`` with encoding ``rgb8``."""
    message = ros2_typestore().types[IMAGE_TYPE](
        header=header(frame_id, stamp_ns),
        height=rgb.shape[0],
        width=rgb.shape[1],
        encoding="rgb8",
        is_bigendian=0,
        step=rgb.shape[1] * 3,
        data=np.ascontiguousarray(rgb).reshape(-1),
    )
    return _encoded(message, IMAGE_TYPE)


def _transform_stamped(types: Any, item: FrameTransform, stamp_ns: int) -> Any:  # noqa: ANN401 - made at run time
    pose = item.parent_from_child
    return types["geometry_msgs/msg/TransformStamped"](
        header=header(item.parent, stamp_ns),
        child_frame_id=item.child,
        transform=types["geometry_msgs/msg/Transform"](
            translation=types["geometry_msgs/msg/Vector3"](x=pose.x_m, y=pose.y_m, z=0.0),
            rotation=types["geometry_msgs/msg/Quaternion"](
                x=0.0, y=0.0, z=math.sin(pose.yaw_rad / 2), w=math.cos(pose.yaw_rad / 2)
            ),
        ),
    )


def _encoded(message: object, msgtype: str) -> bytes:
    return bytes(ros2_typestore().serialize_cdr(message, msgtype, little_endian=True))
