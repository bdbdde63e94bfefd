"""Recorded bytes → message objects of rosbags, whatever they were encoded with."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING

from replay.codec.typestores import ros1_typestore, ros2_typestore
from replay.errors import BadMessage
from replay.sources.base import RawMessage

if TYPE_CHECKING:
    from rosbags.typesys.stores.ros2_jazzy import std_msgs__msg__Header as Header

_NS = 1_000_000_000


def deserialized(raw: RawMessage, msgtype: str) -> object:
    """Return a recorded message as a message of this type.

    Raises
    ------
    BadMessage
        With the cause ``undecodable``, if the bytes are none.
    """
    from rosbags.serde import SerdeError

    # Given bytes, rosbags copies all of them to take off the first four.
    data = memoryview(raw.data)
    try:
        if raw.encoding == "ros1":
            return ros1_typestore().deserialize_ros1(data, msgtype)
        return ros2_typestore().deserialize_cdr(data, msgtype)
    except (SerdeError, struct.error, ValueError, LookupError, AssertionError, OverflowError) as error:
        found = " ".join(str(error).split()) or type(error).__name__
        raise BadMessage(
            "undecodable", f"{len(raw.data)} bytes are no {raw.encoding} {raw.msgtype}: {found}"
        ) from error


def header_stamp_ns(header: Header) -> int:
    """Return the time of a header; 0 if it was not set, or is none: before 1970, or with a second of nanoseconds."""
    stamp = header.stamp
    return stamp.sec * _NS + stamp.nanosec if stamp.sec >= 0 and stamp.nanosec < _NS else 0
