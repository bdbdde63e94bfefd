"""Runs as recordings: MCAP, ROS 1 bag, ROS 2 bag. Equal input gives equal bytes."""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag1 import Writer as Bag1Writer
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Bag2Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from mapmerge.grid import Grid
from mapmerge.sim2 import Sim2
from samples.mission import Run
from samples.world import Rng

GRID_TYPE = "nav_msgs/msg/OccupancyGrid"
TF_TYPE = "tf2_msgs/msg/TFMessage"
_SECOND_NS = 1_000_000_000
_FOREVER = QosTime(2147483647, 4294967295)


@dataclass(frozen=True, slots=True, eq=False)
class MapEvent:
    """A map to be recorded at ``log_ns``."""

    log_ns: int
    stamp_ns: int
    topic: str
    frame_id: str
    grid: Grid


@dataclass(frozen=True, slots=True, eq=False)
class PoseEvent:
    """A robot's pose, parent_from_child, to be recorded at ``log_ns``."""

    log_ns: int
    stamp_ns: int
    frame_id: str
    child_frame_id: str
    pose: Sim2
    topic: str = "/tf"


Event = MapEvent | PoseEvent


@dataclass(frozen=True, slots=True)
class Names:
    """What a robot calls its topic and its frames."""

    map_topic: str
    map_frame: str
    base_frame: str


@dataclass(frozen=True, slots=True)
class Timing:
    """When things are recorded.

    Parameters
    ----------
    start_ns
        Time of the run's first pose.
    map_lag_s
        Least and largest time from a map's stamp to its being recorded.
    pose_lag_s
        The same for poses.
    pose_period_s
        Least time between two poses.
    """

    start_ns: int
    map_lag_s: tuple[float, float] = (0.02, 0.08)
    pose_lag_s: tuple[float, float] = (0.002, 0.02)
    pose_period_s: float = 0.5


def events(run: Run, names: Names, timing: Timing, rng: Rng) -> Iterator[Event]:
    """Yield what a robot publishes during a run, in the order in which it is recorded."""
    return heapq.merge(
        _map_events(run, names, timing, rng),
        _pose_events(run, names, timing, rng),
        key=lambda event: event.log_ns,
    )


def _map_events(run: Run, names: Names, timing: Timing, rng: Rng) -> list[Event]:
    stamps_ns = [_stamp_ns(timing, snapshot.time_s) for snapshot in run.snapshots]
    logs_ns = _log_times_ns(stamps_ns, timing.map_lag_s, rng)
    return [
        MapEvent(log_ns, stamp_ns, names.map_topic, names.map_frame, snapshot.grid)
        for log_ns, stamp_ns, snapshot in zip(logs_ns, stamps_ns, run.snapshots, strict=True)
    ]


def _pose_events(run: Run, names: Names, timing: Timing, rng: Rng) -> list[Event]:
    chosen: list[tuple[int, Sim2]] = []
    due_s = 0.0
    for time_s, pose in run.poses:
        if time_s >= due_s:
            due_s = time_s + timing.pose_period_s
            chosen.append((_stamp_ns(timing, time_s), pose))
    logs_ns = _log_times_ns([stamp_ns for stamp_ns, _ in chosen], timing.pose_lag_s, rng)
    return [
        PoseEvent(log_ns, stamp_ns, names.map_frame, names.base_frame, pose)
        for log_ns, (stamp_ns, pose) in zip(logs_ns, chosen, strict=True)
    ]


def _stamp_ns(timing: Timing, time_s: float) -> int:
    return timing.start_ns + round(time_s * _SECOND_NS)


def _log_times_ns(stamps_ns: Sequence[int], lag_s: tuple[float, float], rng: Rng) -> list[int]:
    """Return when messages with these ascending stamps are recorded: later, and in the same order."""
    logs_ns: list[int] = []
    for stamp_ns in stamps_ns:
        log_ns = stamp_ns + round(float(rng.uniform(*lag_s)) * _SECOND_NS)
        logs_ns.append(max(log_ns, logs_ns[-1] + 1_000_000) if logs_ns else log_ns)
    return logs_ns


# Messages


class _Encoder:
    """Turns events into messages of one ROS generation."""

    __slots__ = ("_store", "_version")

    def __init__(self, store: Typestore, version: int) -> None:
        self._store = store
        self._version = version

    @property
    def store(self) -> Typestore:
        """The types of the messages."""
        return self._store

    def encode(self, event: Event) -> bytes:
        """Return the serialized message of an event."""
        message = self._map(event) if isinstance(event, MapEvent) else self._transforms(event)
        if self._version == 1:
            return bytes(self._store.serialize_ros1(message, type_of(event)))
        return bytes(self._store.serialize_cdr(message, type_of(event)))

    def _new(self, name: str, **fields: object) -> Any:  # noqa: ANN401 - the classes are made at run time
        maker: Any = self._store.types[name]
        return maker(**fields)

    def _header(self, event: Event) -> object:
        sec, nanosec = divmod(event.stamp_ns, _SECOND_NS)
        stamp = self._new("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)
        sequence = {"seq": 0} if self._version == 1 else {}
        return self._new("std_msgs/msg/Header", stamp=stamp, frame_id=event.frame_id, **sequence)

    def _turn(self, yaw_rad: float) -> object:
        z, w = math.sin(0.5 * yaw_rad), math.cos(0.5 * yaw_rad)
        return self._new("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=z, w=w)

    def _map(self, event: MapEvent) -> object:
        grid, header = event.grid, self._header(event)
        origin = grid.map_from_grid
        position = self._new("geometry_msgs/msg/Point", x=origin.x_m, y=origin.y_m, z=0.0)
        info = self._new(
            "nav_msgs/msg/MapMetaData",
            map_load_time=self._new("builtin_interfaces/msg/Time", sec=0, nanosec=0),
            resolution=grid.resolution_m,
            width=grid.cols,
            height=grid.rows,
            origin=self._new("geometry_msgs/msg/Pose", position=position, orientation=self._turn(origin.yaw_rad)),
        )
        return self._new(GRID_TYPE, header=header, info=info, data=np.ascontiguousarray(grid.cells).reshape(-1))

    def _transforms(self, event: PoseEvent) -> object:
        pose = event.pose
        shift = self._new("geometry_msgs/msg/Vector3", x=pose.x_m, y=pose.y_m, z=0.0)
        transform = self._new(
            "geometry_msgs/msg/TransformStamped",
            header=self._header(event),
            child_frame_id=event.child_frame_id,
            transform=self._new("geometry_msgs/msg/Transform", translation=shift, rotation=self._turn(pose.yaw_rad)),
        )
        return self._new(TF_TYPE, transforms=[transform])


def type_of(event: Event) -> str:
    """Return the message type of an event."""
    return GRID_TYPE if isinstance(event, MapEvent) else TF_TYPE


def _ros2() -> _Encoder:
    return _Encoder(get_typestore(Stores.ROS2_HUMBLE), 2)


def _ros1() -> _Encoder:
    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", TF_TYPE))
    return _Encoder(store, 1)


# Files


class WriteRecording(Protocol):
    """A way to write events, which are in log order, to a path."""

    def __call__(self, path: Path, recorded: Iterable[Event]) -> None:
        """Write a recording; nothing may be at the path yet."""


def write_mcap(path: Path, recorded: Iterable[Event]) -> None:
    """Write a ROS 2 MCAP file, compressed with zstd."""
    encoder = _ros2()
    channels: dict[str, int] = {}
    schemas: dict[str, int] = {}
    with path.open("xb") as file:
        writer = McapWriter(file, chunk_size=4 << 20, compression=CompressionType.ZSTD)
        writer.start(profile="ros2", library="")
        for event in recorded:
            kind = type_of(event)
            if kind not in schemas:
                definition = encoder.store.generate_msgdef(kind, ros_version=2)[0]
                schemas[kind] = writer.register_schema(kind, "ros2msg", definition.encode())
            if event.topic not in channels:
                metadata = {"offered_qos_profiles": _qos_text(event)}
                channels[event.topic] = writer.register_channel(event.topic, "cdr", schemas[kind], metadata)
            writer.add_message(channels[event.topic], event.log_ns, encoder.encode(event), event.log_ns)
        writer.finish()  # type: ignore[no-untyped-call]


def write_bag1(path: Path, recorded: Iterable[Event]) -> None:
    """Write a ROS 1 bag, compressed with lz4."""
    encoder = _ros1()
    writer = Bag1Writer(path)
    writer.set_compression(Bag1Writer.CompressionFormat.LZ4)
    connections: dict[str, Any] = {}
    with writer:
        for event in recorded:
            if event.topic not in connections:
                connections[event.topic] = writer.add_connection(
                    event.topic,
                    type_of(event),
                    typestore=encoder.store,
                    latching=1 if isinstance(event, MapEvent) else None,
                )
            writer.write(connections[event.topic], event.log_ns, encoder.encode(event))


def write_bag2(path: Path, recorded: Iterable[Event]) -> None:
    """Write a ROS 2 bag folder with uncompressed sqlite3 storage."""
    encoder = _ros2()
    connections: dict[str, Any] = {}
    with Bag2Writer(path, version=8, storage_plugin=StoragePlugin.SQLITE3) as writer:
        for event in recorded:
            if event.topic not in connections:
                connections[event.topic] = writer.add_connection(
                    event.topic, type_of(event), typestore=encoder.store, offered_qos_profiles=[_qos(event)]
                )
            writer.write(connections[event.topic], event.log_ns, encoder.encode(event))


def _qos(event: Event) -> Qos:
    is_map = isinstance(event, MapEvent)
    return Qos(
        QosHistory.KEEP_LAST,
        1 if is_map else 100,
        QosReliability.RELIABLE,
        QosDurability.TRANSIENT_LOCAL if is_map else QosDurability.VOLATILE,
        _FOREVER,
        _FOREVER,
        QosLiveliness.AUTOMATIC,
        _FOREVER,
        avoid_ros_namespace_conventions=False,
    )


def _qos_text(event: Event) -> str:
    """Return the offered quality of service as rosbag2 writes it into an MCAP channel."""
    qos = _qos(event)
    forever = f"\n    sec: {_FOREVER.sec}\n    nsec: {_FOREVER.nsec}"
    return (
        f"- history: {qos.history.value}\n  depth: {qos.depth}\n  reliability: {qos.reliability.value}\n"
        f"  durability: {qos.durability.value}\n  deadline:{forever}\n  lifespan:{forever}\n"
        f"  liveliness: {qos.liveliness.value}\n  liveliness_lease_duration:{forever}\n"
        "  avoid_ros_namespace_conventions: false"
    )
