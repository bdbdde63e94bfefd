"""The message definitions that are built in.

Every recording is decoded with these, not with those that it carries: ``nav_msgs/OccupancyGrid`` has not changed since
ROS 1 Fuerte, and a recording without definitions reads as well as any other.
"""

from __future__ import annotations

import functools
from typing import TYPE_CHECKING

from replay.sources.base import TF_TYPE, UPDATE_TYPE

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

_UPDATE_DEFINITION = """\
std_msgs/Header header
int32 x
int32 y
uint32 width
uint32 height
int8[] data
"""
_TF_DEFINITION = "geometry_msgs/TransformStamped[] transforms\n"


@functools.cache
def ros2_typestore() -> Typestore:
    """Return the ROS 2 message definitions, with ``map_msgs/OccupancyGridUpdate``."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg(_UPDATE_DEFINITION, UPDATE_TYPE))
    return store


@functools.cache
def ros1_typestore() -> Typestore:
    """Return the ROS 1 message definitions, with ``map_msgs/OccupancyGridUpdate`` and ``tf2_msgs/TFMessage``."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg(_UPDATE_DEFINITION, UPDATE_TYPE))
    store.register(get_types_from_msg(_TF_DEFINITION, TF_TYPE))
    return store


def ros2_message_definition(msgtype: str) -> str:
    """Return the text of a ROS 2 message definition with all it depends on, as MCAP's ``ros2msg`` wants it."""
    text, _ = ros2_typestore().generate_msgdef(msgtype, ros_version=2)
    return text
