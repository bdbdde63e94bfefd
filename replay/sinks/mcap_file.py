"""The merged map, transforms, report and images as a new MCAP, ROS 2 profile.

Bytes are the same for the same input and settings: times are those of the recording, and nothing of the machine or
of the time of day is written.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib import resources
from typing import Any, cast

import numpy as np
from mcap.writer import Writer

from mapmerge.grid import UNKNOWN, Grid
from mapmerge.result import MergeResult
from replay import __version__
from replay.codec import (
    IMAGE_TYPE,
    FrameTransform,
    encode_grid,
    encode_image,
    encode_transforms,
    ros2_message_definition,
)
from replay.events import Event, Finished, Merged, Report, RobotInput, RobotPicture, Started
from replay.options import OutputOptions
from replay.plain_text import plain, plain_json
from replay.plan import MERGED_FRAME
from replay.sinks.mcap_output import McapOutput
from replay.sinks.partial_file import PartialFile
from replay.sinks.qos import LATCHED, VOLATILE
from replay.sources.base import GRID_TYPE, TF_TYPE
from replay.topics import IMAGE_TOPICS, MAP_TOPIC, REPORT_TOPIC

REPORT_SCHEMA = "report.schema.json"

_NO_SCHEMA = 0
_LONGEST_PART = 200


class McapSink(McapOutput):
    """Writes a run's outcome to an MCAP that mcap, rosbags, Rerun and Foxglove read."""

    def __init__(self, file: PartialFile, options: OutputOptions) -> None:
        super().__init__(file)
        self._options = options
        self._channels = _Channels(self._writer)
        self._robots: tuple[RobotInput, ...] = ()
        self._parts: dict[str, str] = {}
        self._merged: Grid | None = None
        self._blank: Grid | None = None
        self._last_map_ns: int | None = None
        self._pending_map: tuple[int, Grid] | None = None
        self._pending_report: tuple[int, Report] | None = None
        self._said: Mapping[str, Any] | None = None

    def take(self, event: Event) -> None:
        """Write what a tick brought."""
        with self._errors():
            match event:
                case Started():
                    self._robots = event.robots
                    self._parts = topic_parts([item.robot for item in event.robots])
                    self._channels.start(f"replay {__version__}")
                    self._channels.metadata("replay.provenance", _provenance(event))
                case Merged():
                    self._tick(event)
                case Finished():
                    self._end(event.report)
                case _:
                    pass
            self._stream.flush()  # chunks that are finished outlive a run that is killed

    def _tick(self, event: Merged) -> None:
        self._flush_report()
        if self._options.copy_maps:
            self._copy_maps(event.stamp_ns, event.result)
        self._map(event.stamp_ns, event.result.merged)
        transforms = self._transforms(event.result)
        if transforms:
            self._channels.ros2("/tf", TF_TYPE, event.stamp_ns, encode_transforms(transforms, event.stamp_ns))
        for item in event.pictures:
            self._image(item, event.stamp_ns)
        self._pending_report = (event.stamp_ns, event.report)

    def _map(self, stamp_ns: int, merged: Grid | None) -> None:
        """Write the merged map if it changed, at once or, when the last one is too recent, later."""
        if merged is None and self._merged is not None and self._merged is not self._blank:
            # a map that was offered as latched would stand for ever: take it back
            merged = self._blank = replace(self._merged, cells=np.full_like(self._merged.cells, UNKNOWN))
        if merged is not None and merged.cells.size and merged is not self._merged:
            self._merged = merged
            self._pending_map = (stamp_ns, merged)
        due = self._last_map_ns is None or stamp_ns - self._last_map_ns >= self._options.every_ns
        if due:
            self._flush_map(stamp_ns)

    def _flush_map(self, stamp_ns: int) -> None:
        if self._pending_map is None:
            return
        _, merged = self._pending_map
        self._pending_map, self._last_map_ns = None, stamp_ns
        self._channels.ros2(MAP_TOPIC, GRID_TYPE, stamp_ns, encode_grid(merged, MERGED_FRAME, stamp_ns), latched=True)

    def _copy_maps(self, stamp_ns: int, result: MergeResult) -> None:
        for item in self._robots:
            if item.robot in result.updated:
                data = encode_grid(result.grids[item.robot], item.frame, stamp_ns)
                self._channels.ros2(f"/{self._parts[item.robot]}/map", GRID_TYPE, stamp_ns, data, latched=True)

    def _transforms(self, result: MergeResult) -> list[FrameTransform]:
        return [
            FrameTransform(MERGED_FRAME, item.frame, pose)
            for item in self._robots
            if result.merged is not None and (pose := result.robots[item.robot].merged_from_map) is not None
        ]

    def _image(self, item: RobotPicture, stamp_ns: int) -> None:
        topic = f"{IMAGE_TOPICS}/{self._parts[item.robot]}/{item.picture.step}"
        data = encode_image(item.picture.rgb, MERGED_FRAME, stamp_ns)
        self._channels.ros2(topic, IMAGE_TYPE, stamp_ns, data)

    def _flush_report(self, *, is_last: bool = False) -> None:
        """Write the report of the tick before, unless it says nothing new.

        It is held back, for the last one is only known at the end.
        """
        if self._pending_report is None:
            return
        (stamp_ns, report), self._pending_report = self._pending_report, None
        said = {**report, "stamp_ns": None, "history": [], "history_before": 0}
        if is_last or report["history"] or said != self._said:
            self._channels.report(stamp_ns, report)
        self._said = said

    def _end(self, report: Report) -> None:
        stamp_ns = self._pending_report[0] if self._pending_report else 0
        self._flush_map(stamp_ns)
        self._pending_report = (stamp_ns, report)
        self._flush_report(is_last=True)
        self._channels.metadata("replay.inputs", {"inputs": _compact(report["inputs"])})


class _Channels:
    """Registers schemas and channels on first use and writes messages to them."""

    def __init__(self, writer: Writer) -> None:
        self._writer = writer
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._sequences: dict[str, int] = {}

    def start(self, library: str) -> None:
        self._writer.start(profile="ros2", library=library)

    def metadata(self, name: str, values: Mapping[str, str]) -> None:
        self._writer.add_metadata(name, dict(values))

    def ros2(self, topic: str, msgtype: str, stamp_ns: int, data: memoryview, *, latched: bool = False) -> None:
        if topic not in self._channels:
            if msgtype not in self._schemas:
                definition = ros2_message_definition(msgtype).encode()
                self._schemas[msgtype] = self._writer.register_schema(msgtype, "ros2msg", definition)
            self._channels[topic] = self._writer.register_channel(
                topic,
                "cdr",
                self._schemas[msgtype],
                {"offered_qos_profiles": LATCHED if latched else VOLATILE},
            )
        self._message(topic, stamp_ns, data)

    def report(self, stamp_ns: int, report: Report) -> None:
        if REPORT_TOPIC not in self._channels:
            # Its schema is attached: rosbags opens no file with a channel of a schema that is not of ROS, and Foxglove
            # reads no channel whose schema has references.
            schema = resources.files("replay").joinpath(f"schemas/{REPORT_SCHEMA}").read_bytes()
            self._writer.add_attachment(0, 0, REPORT_SCHEMA, "application/schema+json", schema)
            self._channels[REPORT_TOPIC] = self._writer.register_channel(REPORT_TOPIC, "json", _NO_SCHEMA)
        self._message(REPORT_TOPIC, stamp_ns, _compact(report).encode())

    def _message(self, topic: str, stamp_ns: int, data: bytes | memoryview) -> None:
        sequence = self._sequences.get(topic, 0)
        self._sequences[topic] = sequence + 1
        # the library takes whatever can be written to a stream
        self._writer.add_message(self._channels[topic], stamp_ns, cast("bytes", data), stamp_ns, sequence)


def topic_parts(robots: Sequence[str]) -> dict[str, str]:
    """Return each robot's name as a part of topics: letters, digits, underscores and slashes only, no two alike."""
    parts: dict[str, str] = {}
    for robot in robots:
        part = re.sub(r"/+", "/", re.sub(r"[^A-Za-z0-9_/]", "_", robot)).strip("/")[:_LONGEST_PART] or "_"
        part = "/".join(f"_{each}" if each[:1].isdigit() else each for each in part.split("/") if each)
        while part in (MERGED_FRAME, *parts.values()):
            part += "_"
        parts[robot] = part
    return parts


def _provenance(event: Started) -> dict[str, str]:
    return {
        "version": __version__,
        "reference": plain(event.robots[0].robot),
        "robots": _compact([item.robot for item in event.robots]),
        "settings": _compact(event.settings),
        "inputs": _compact([_named(item) for item in event.inputs]),
    }


def _named(item: Mapping[str, Any]) -> dict[str, Any]:
    return {key: item[key] for key in ("name", "format", "size_bytes")}


def _compact(value: Mapping[str, Any] | Sequence[Any]) -> str:
    return plain_json(json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":")))
