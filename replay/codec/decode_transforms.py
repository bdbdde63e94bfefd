"""Recorded bytes → transforms between frames."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, cast

from replay.codec.deserialize import deserialized, header_stamp_ns
from replay.messages import FrameLink, TransformMessage
from replay.pose3 import MAX_PLACE_M, Pose3
from replay.sources.base import TF_TYPE, RawMessage

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rosbags.typesys.stores.ros2_jazzy import geometry_msgs__msg__TransformStamped as TransformStamped


class _TransformMessage(Protocol):
    """``tf2_msgs/TFMessage``; the ``tf/tfMessage`` of old ROS 1 nodes has the same bytes."""

    transforms: Sequence[TransformStamped]


def decode_transforms(raw: RawMessage) -> TransformMessage:
    """Return the transforms that a recorded message holds; those that are none are told apart.

    Raises
    ------
    BadMessage
        With the cause ``undecodable``, if the bytes are no message of this type.
    """
    message = cast("_TransformMessage", deserialized(raw, TF_TYPE))
    links: list[FrameLink] = []
    bad: list[str] = []
    for item in message.transforms:
        parent, child = item.header.frame_id.lstrip("/"), item.child_frame_id.lstrip("/")
        try:
            links.append(_link(parent, child, item))
        except ValueError as error:
            bad.append(f"the transform from {child!r} to {parent!r} is none: {error}")
    stamp_ns = max((header_stamp_ns(item.header) for item in message.transforms), default=0)
    return TransformMessage(stamp_ns, tuple(links), tuple(bad))


def _link(parent: str, child: str, item: TransformStamped) -> FrameLink:
    if not parent or not child or parent == child:
        raise ValueError("two frames with names of their own were expected")
    shift, turn = item.transform.translation, item.transform.rotation
    pose = Pose3.of((shift.x, shift.y, shift.z), (turn.x, turn.y, turn.z, turn.w))
    if max(abs(shift.x), abs(shift.y), abs(shift.z)) > MAX_PLACE_M:
        raise ValueError(f"its shift is ({shift.x}, {shift.y}, {shift.z}); at most {MAX_PLACE_M:g} m were expected")
    return FrameLink(parent, child, pose)
