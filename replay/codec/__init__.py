"""Messages as bytes ↔ messages as values: the only place that knows how ROS serialises them."""

from replay.codec.decode import decode
from replay.codec.decode_transforms import decode_transforms
from replay.codec.encode import (
    IMAGE_TYPE,
    FrameTransform,
    encode_grid,
    encode_image,
    encode_transforms,
)
from replay.codec.typestores import ros1_typestore, ros2_message_definition, ros2_typestore

__all__ = [
    "IMAGE_TYPE",
    "FrameTransform",
    "decode",
    "decode_transforms",
    "encode_grid",
    "encode_image",
    "encode_transforms",
    "ros1_typestore",
    "ros2_message_definition",
    "ros2_typestore",
]
