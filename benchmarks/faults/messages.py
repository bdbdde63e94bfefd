"""Messages as bytes, laid out here byte by byte so that they can say anything, also what no robot would."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Literal

from replay.sources.base import GRID_TYPE, UPDATE_TYPE

TEXT_TYPE = "std_msgs/msg/String"
_CDR_LITTLE_ENDIAN = b"\x00\x01\x00\x00"
_NS = 1_000_000_000


@dataclass(frozen=True, slots=True)
class MapContent:
    """What a message with a map says.

    Parameters
    ----------
    pose
        Of the grid's corner: x, y, z and a quaternion x, y, z, w.
    told_length
        How many cells the message says that it has; None for as many as it has.
    """

    stamp_ns: int
    frame_id: bytes
    resolution_m: float
    width: int
    height: int
    pose: tuple[float, float, float, float, float, float, float]
    cells: bytes
    told_length: int | None = None


@dataclass(frozen=True, slots=True)
class UpdateContent:
    """What a message with a part of a map says."""

    stamp_ns: int
    frame_id: bytes
    x: int
    y: int
    width: int
    height: int
    cells: bytes


@dataclass(frozen=True, slots=True)
class Message:
    """One message to record.

    Parameters
    ----------
    content
        What it says; bytes for a text.
    cut_bytes
        How many bytes are missing at its end.
    """

    topic: str
    log_time_ns: int
    content: MapContent | UpdateContent | bytes
    cut_bytes: int = 0

    @property
    def msgtype(self) -> str:
        """Type in the form ``nav_msgs/msg/OccupancyGrid``."""
        if isinstance(self.content, MapContent):
            return GRID_TYPE
        return UPDATE_TYPE if isinstance(self.content, UpdateContent) else TEXT_TYPE

    def data(self, encoding: Literal["cdr", "ros1"]) -> bytes:
        """Return the message as it is recorded."""
        layout = _Layout(is_ros1=encoding == "ros1")
        if isinstance(self.content, MapContent):
            _put_map(layout, self.content)
        elif isinstance(self.content, UpdateContent):
            _put_update(layout, self.content)
        else:
            layout.put_text(self.content)
        whole = layout.bytes()
        return whole[: len(whole) - self.cut_bytes]


class _Layout:
    """Values one after the other: aligned in ROS 2, close together in ROS 1."""

    def __init__(self, *, is_ros1: bool) -> None:
        self.is_ros1 = is_ros1
        self._body = bytearray()

    def put(self, kind: str, value: float) -> None:
        size = struct.calcsize(f"<{kind}")
        if not self.is_ros1:
            self._body += bytes(-len(self._body) % size)
        self._body += struct.pack(f"<{kind}", value)

    def put_text(self, text: bytes) -> None:
        ended = text if self.is_ros1 else text + b"\0"
        self.put("I", len(ended))
        self._body += ended

    def put_cells(self, cells: bytes, told_length: int | None = None) -> None:
        self.put("I", len(cells) if told_length is None else told_length)
        self._body += cells

    def put_header(self, stamp_ns: int, frame_id: bytes) -> None:
        if self.is_ros1:
            self.put("I", 0)
        seconds, nanoseconds = divmod(stamp_ns, _NS)
        self.put("I", seconds % 2**32)
        self.put("I", nanoseconds)
        self.put_text(frame_id)

    def bytes(self) -> bytes:
        return bytes(self._body) if self.is_ros1 else _CDR_LITTLE_ENDIAN + bytes(self._body)


def _put_map(layout: _Layout, content: MapContent) -> None:
    layout.put_header(content.stamp_ns, content.frame_id)
    layout.put("I", 0)
    layout.put("I", 0)
    layout.put("f", content.resolution_m)
    layout.put("I", content.width)
    layout.put("I", content.height)
    for value in content.pose:
        layout.put("d", value)
    layout.put_cells(content.cells, content.told_length)


def _put_update(layout: _Layout, content: UpdateContent) -> None:
    layout.put_header(content.stamp_ns, content.frame_id)
    layout.put("i", content.x)
    layout.put("i", content.y)
    layout.put("I", content.width)
    layout.put("I", content.height)
    layout.put_cells(content.cells)
