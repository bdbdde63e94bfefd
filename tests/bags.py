"""Writes recordings of every format with the libraries that are their reference.

`SAMPLE` is what most tests record: maps of two robots that overlap in time, an update, and chatter that is no map;
written out of order, with equal times, in chunks of which some hold no map.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Reader as Rosbag1Reader
from rosbags.rosbag1 import Writer as Rosbag1Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Rosbag2Writer

from mapmerge.grid import Grid
from mapmerge.sim2 import Sim2
from replay.codec import ros1_typestore, ros2_typestore
from replay.sources.base import GRID_TYPE, TF_TYPE, TF_TYPES, UPDATE_TYPE

TEXT_TYPE = "std_msgs/msg/String"
SECOND = 1_000_000_000
START = 1_700_000_000 * SECOND


@dataclass(frozen=True)
class Recorded:
    """One message to record.

    Parameters
    ----------
    fields
        What the message says, as `map_fields` returns it for a map.
    lost_bytes
        How many bytes are missing at its end.
    """

    topic: str
    msgtype: str
    log_time_ns: int
    fields: dict[str, Any]
    lost_bytes: int = 0


def grid(seed: int, rows: int = 40, cols: int = 60) -> Grid:
    cells = np.random.default_rng(seed).integers(-1, 101, (rows, cols)).astype(np.int8)
    return Grid(cells, 0.05, Sim2(-1.5, 2.25, 0.3))


def recorded_map(topic: str, log_time_ns: int, seed: int, rows: int = 40) -> Recorded:
    return Recorded(topic, GRID_TYPE, log_time_ns, map_fields(grid(seed, rows), log_time_ns - 7, f"{topic}_frame"))


def map_fields(known: Grid, stamp_ns: int = 0, frame_id: str = "map") -> dict[str, Any]:
    """Return what a message of this grid says; change it to make a message that no map can be."""
    pose = known.map_from_grid
    return {
        "stamp_ns": stamp_ns,
        "frame_id": frame_id,
        "resolution": known.resolution_m,
        "width": known.cols,
        "height": known.rows,
        "position": (pose.x_m, pose.y_m, 0.0),
        "orientation": (0.0, 0.0, math.sin(pose.yaw_rad / 2.0), math.cos(pose.yaw_rad / 2.0)),
        "data": known.cells.reshape(-1),
    }


def recorded_update(topic: str, log_time_ns: int, seed: int) -> Recorded:
    known = grid(seed, 4, 5)
    fields = {"stamp_ns": log_time_ns, "frame_id": "map", "x": 3, "y": 2, "width": 5, "height": 4}
    return Recorded(topic, UPDATE_TYPE, log_time_ns, {**fields, "data": known.cells.reshape(-1)})


def _chatter(log_time_ns: int, text: str) -> Recorded:
    return Recorded("/chatter", TEXT_TYPE, log_time_ns, {"data": text * 3000})


SAMPLE: tuple[Recorded, ...] = (
    _chatter(START - SECOND, "before "),
    recorded_map("/r1/map", START + 2 * SECOND, seed=1),
    recorded_map("/r2/map", START + 2 * SECOND, seed=2),
    recorded_map("/r1/map", START, seed=3),
    _chatter(START + 3 * SECOND, "between "),
    recorded_update("/r1/map_updates", START + 3 * SECOND, seed=4),
    recorded_map("/r2/map", START + 1 * SECOND + 1, seed=5, rows=50),
    recorded_map("/r2/map", START + 4 * SECOND, seed=6),
    recorded_map("/r1/map", START + 4 * SECOND, seed=7),
    _chatter(START + 9 * SECOND, "after "),
)


def in_order(messages: Iterable[Recorded], topics: Iterable[str]) -> list[Recorded]:
    """Return the messages of these topics as a source yields them."""
    wanted = set(topics)
    return sorted((each for each in messages if each.topic in wanted), key=lambda each: each.log_time_ns)


# --- messages


def as_cdr(message: Recorded) -> bytes:
    store = ros2_typestore()
    return _cut(bytes(store.serialize_cdr(_message(store, message, ros1=False), _known(message.msgtype))), message)


def as_ros1(message: Recorded) -> bytes:
    store = ros1_typestore()
    return _cut(bytes(store.serialize_ros1(_message(store, message, ros1=True), _known(message.msgtype))), message)


def _known(msgtype: str) -> str:
    """Return the type that a typestore has for it."""
    return TF_TYPE if msgtype in TF_TYPES else msgtype


def _cut(data: bytes, message: Recorded) -> bytes:
    return data[: len(data) - message.lost_bytes]


def _message(store: Any, message: Recorded, *, ros1: bool) -> Any:
    fields, types = message.fields, store.types
    if message.msgtype == TEXT_TYPE:
        return types[TEXT_TYPE](data=fields["data"])
    time = types["builtin_interfaces/msg/Time"]
    extra = {"seq": 5} if ros1 else {}
    if message.msgtype in TF_TYPES:
        return types[TF_TYPE]([_transform(types, extra, **link) for link in fields["links"]])
    sec, nanosec = fields.get("stamp") or divmod(fields["stamp_ns"], SECOND)
    header = types["std_msgs/msg/Header"](stamp=time(sec, nanosec), frame_id=fields["frame_id"], **extra)
    if message.msgtype == UPDATE_TYPE:
        rectangle = {key: fields[key] for key in ("x", "y", "width", "height", "data")}
        return types[UPDATE_TYPE](header=header, **rectangle)
    origin = types["geometry_msgs/msg/Pose"](
        types["geometry_msgs/msg/Point"](*fields["position"]),
        types["geometry_msgs/msg/Quaternion"](*fields["orientation"]),
    )
    info = types["nav_msgs/msg/MapMetaData"](
        time(0, 0), fields["resolution"], fields["width"], fields["height"], origin
    )
    return types[GRID_TYPE](header, info, fields["data"])


def _transform(
    types: Any,
    extra: dict[str, int],
    *,
    parent: str,
    child: str,
    stamp_ns: int,
    shift: tuple[float, float, float],
    turn: tuple[float, float, float, float],
) -> Any:
    stamp = types["builtin_interfaces/msg/Time"](*divmod(stamp_ns, SECOND))
    header = types["std_msgs/msg/Header"](stamp=stamp, frame_id=parent, **extra)
    transform = types["geometry_msgs/msg/Transform"](
        types["geometry_msgs/msg/Vector3"](*shift), types["geometry_msgs/msg/Quaternion"](*turn)
    )
    return types["geometry_msgs/msg/TransformStamped"](header, child, transform)


# --- recordings


def write_rosbag1(
    path: Path, messages: Sequence[Recorded] = SAMPLE, compression: str = "none", chunk_bytes: int = 2000
) -> Path:
    writer = Rosbag1Writer(path)
    if compression != "none":
        writer.set_compression(Rosbag1Writer.CompressionFormat[compression.upper()])
    writer.chunk_threshold = chunk_bytes
    with writer:
        connections: dict[str, Any] = {}
        for each in messages:
            if each.topic not in connections:
                connections[each.topic] = writer.add_connection(each.topic, each.msgtype, typestore=ros1_typestore())
            writer.write(connections[each.topic], each.log_time_ns, as_ros1(each))
    return path


def write_rosbag2(
    path: Path,
    messages: Sequence[Recorded] = SAMPLE,
    storage: Literal["sqlite3", "mcap"] = "sqlite3",
    compression: Literal["none", "file", "message"] = "none",
    serialization_format: str = "cdr",
) -> Path:
    writer = Rosbag2Writer(path, version=9, storage_plugin=StoragePlugin[storage.upper()])
    writer.set_compression(CompressionMode[compression.upper()], CompressionFormat.ZSTD)
    with writer:
        connections: dict[str, Any] = {}
        for each in messages:
            if each.topic not in connections:
                connections[each.topic] = writer.add_connection(
                    each.topic,
                    each.msgtype,
                    typestore=ros2_typestore(),
                    serialization_format=serialization_format,
                )
            writer.write(connections[each.topic], each.log_time_ns, as_cdr(each))
    return path


def write_split_rosbag2(
    path: Path,
    messages: Sequence[Recorded] = SAMPLE,
    storage: Literal["sqlite3", "mcap"] = "sqlite3",
    compression: Literal["none", "file", "message"] = "none",
) -> Path:
    """Write a folder in twelve parts at most, one message each; their names sort wrongly as text."""
    path.mkdir()
    names = []
    for index, each in enumerate(messages):
        single = write_rosbag2(path.parent / f"{path.name}_single_{index}", [each], storage, compression)
        (part,) = (file for file in single.iterdir() if file.suffix != ".yaml")
        suffix = part.name.removeprefix(single.name)
        names.append(f"{path.name}_{index + 5}{suffix}")
        part.rename(path / names[-1])
    listed = "".join(f"  - {path.name}/{name}\n" for name in names)
    (path / "metadata.yaml").write_text(
        "rosbag2_bagfile_information:\n"
        f"  version: 4\n  storage_identifier: {storage}\n  relative_file_paths:\n{listed}"
        f"  compression_format: {'zstd' if compression != 'none' else ''}\n"
        f"  compression_mode: {compression.upper() if compression != 'none' else ''}\n"
    )
    return path


def write_bare_db3(path: Path, messages: Sequence[Recorded] = SAMPLE, **options: Any) -> Path:
    # Under a plain name: the library puts the path into a URI as it is.
    folder = write_rosbag2(path.parent / "written", messages, **options)
    (part,) = folder.glob("*.db3")
    part.rename(path)
    return path


def write_mcap(
    path: Path,
    messages: Sequence[Recorded] = SAMPLE,
    profile: Literal["ros2", "ros1", ""] = "ros2",
    encoding: str | None = None,
    compression: Literal["none", "lz4", "zstd"] = "zstd",
    chunk_bytes: int = 2000,
    **options: Any,
) -> Path:
    """Write an MCAP file; with ``profile`` "" its messages are those of ROS 2, named as ROS 1 names them."""
    is_ros1 = profile == "ros1"
    with path.open("wb") as file:
        writer = McapWriter(file, chunk_size=chunk_bytes, compression=CompressionType[compression.upper()], **options)
        writer.start(profile=profile, library="tests")
        channels: dict[str, int] = {}
        for each in messages:
            if each.topic not in channels:
                name = each.msgtype if profile == "ros2" else each.msgtype.replace("/msg/", "/")
                store, version = (ros1_typestore(), 1) if is_ros1 else (ros2_typestore(), 2)
                definition, _ = store.generate_msgdef(_known(each.msgtype), ros_version=version)
                schema = writer.register_schema(name, "ros1msg" if is_ros1 else "ros2msg", definition.encode())
                channels[each.topic] = writer.register_channel(
                    each.topic, encoding or ("ros1" if is_ros1 else "cdr"), schema
                )
            data = as_ros1(each) if is_ros1 else as_cdr(each)
            writer.add_message(channels[each.topic], each.log_time_ns, data, each.log_time_ns)
        writer.finish()
    return path


NO_INDEX: dict[str, Any] = {"index_types": IndexType.NONE}
NO_SUMMARY: dict[str, Any] = {
    "index_types": IndexType.NONE,
    "repeat_channels": False,
    "repeat_schemas": False,
    "use_statistics": False,
    "use_summary_offsets": False,
}


def write_saved_map(path: Path, pixels: Any, image: str = "map.pgm", without: Sequence[str] = (), **keys: Any) -> Path:
    """Write a saved map; pixels in OpenCV's order of channels."""
    cv2.imwrite(str(path.parent / image), pixels)
    known = {
        "image": image,
        "resolution": 0.05,
        "origin": [-1.5, 2.25, 0.3],
        "negate": 0,
        "occupied_thresh": 0.65,
        "free_thresh": 0.196,
        **keys,
    }
    path.write_text("".join(f"{key}: {value}\n" for key, value in known.items() if key not in without))
    return path


# --- damage


@dataclass(frozen=True)
class Chunk:
    """Where the data of a chunk is in a file, and whose messages are in it."""

    start: int
    size: int
    topics: frozenset[str]


def chunks(path: Path) -> list[Chunk]:
    return _rosbag1_chunks(path) if path.suffix == ".bag" else _mcap_chunks(path)


def _rosbag1_chunks(path: Path) -> list[Chunk]:
    with Rosbag1Reader(path) as reader:
        names = {each.id: each.topic for each in reader.connections}
        return [
            Chunk(
                reader.chunks[info.pos].datapos,
                reader.chunks[info.pos].datasize,
                frozenset(names[key] for key, count in info.connection_counts.items() if count),
            )
            for info in reader.chunk_infos
        ]


def _mcap_chunks(path: Path) -> list[Chunk]:
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    return [
        Chunk(
            each.chunk_start_offset + each.chunk_length - each.compressed_size,
            each.compressed_size,
            frozenset(summary.channels[key].topic for key in each.message_index_offsets),
        )
        for each in summary.chunk_indexes
    ]


def damage(path: Path, chunk: Chunk) -> None:
    """Flip all bits of a few bytes in the middle of a chunk."""
    data = bytearray(path.read_bytes())
    middle = chunk.start + chunk.size // 2
    for index in range(middle, middle + 4):
        data[index] ^= 0xFF
    path.write_bytes(data)
