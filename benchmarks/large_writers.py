"""Recordings of any length, written message by message as they are made, so that none of them is ever held whole."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as Bag1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Bag2Writer

from replay.codec import ros1_typestore, ros2_typestore
from replay.sources.base import GRID_TYPE


class Message(NamedTuple):
    """One message in CDR; of what is no map, any bytes, for nothing decodes them."""

    topic: str
    msgtype: str
    log_ns: int
    data: bytes


def write_mcap(path: Path, messages: Iterable[Message]) -> None:
    """Write an MCAP file with chunks that are not compressed."""
    channels: dict[str, int] = {}
    with path.open("xb") as file:
        writer = McapWriter(file, chunk_size=4 << 20, compression=CompressionType.NONE)
        writer.start(profile="ros2", library="")
        for each in messages:
            if each.topic not in channels:
                definition = ros2_typestore().generate_msgdef(each.msgtype, ros_version=2)[0]
                schema = writer.register_schema(each.msgtype, "ros2msg", definition.encode())
                channels[each.topic] = writer.register_channel(each.topic, "cdr", schema)
            writer.add_message(channels[each.topic], each.log_ns, each.data, each.log_ns)
        writer.finish()  # type: ignore[no-untyped-call]


def write_bag(path: Path, messages: Iterable[Message]) -> None:
    """Write a ROS 1 bag with chunks that are not compressed."""
    store = ros1_typestore()
    connections: dict[str, Any] = {}
    with Bag1Writer(path) as writer:
        for each in messages:
            if each.topic not in connections:
                connections[each.topic] = writer.add_connection(each.topic, each.msgtype, typestore=store)
            is_map = each.msgtype == GRID_TYPE
            data = ros2_typestore().cdr_to_ros1(each.data, GRID_TYPE) if is_map else each.data
            writer.write(connections[each.topic], each.log_ns, bytes(data))


def write_db3(path: Path, messages: Iterable[Message]) -> None:
    """Write the SQLite file of a ROS 2 bag, without the folder around it."""
    connections: dict[str, Any] = {}
    folder = path.with_suffix("")
    with Bag2Writer(folder, version=8, storage_plugin=StoragePlugin.SQLITE3) as writer:
        for each in messages:
            if each.topic not in connections:
                connections[each.topic] = writer.add_connection(each.topic, each.msgtype, typestore=ros2_typestore())
            writer.write(connections[each.topic], each.log_ns, each.data)
    (part,) = folder.glob("*.db3")
    part.rename(path)
    (folder / "metadata.yaml").unlink()
    folder.rmdir()


WRITERS: Mapping[str, Callable[[Path, Iterable[Message]], None]] = {
    "mcap": write_mcap,
    "bag": write_bag,
    "db3": write_db3,
}
