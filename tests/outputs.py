"""Reads back what a run wrote, with the libraries that others would use."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from mcap.reader import make_reader
from mcap.summary import Summary

from mapmerge.grid import Grid
from replay.codec import decode, ros2_typestore
from replay.messages import GridMessage
from replay.sources.base import GRID_TYPE, RawMessage


def summary(path: Path) -> Summary:
    with path.open("rb") as file:
        found = make_reader(file, validate_crcs=True).get_summary()
    assert found is not None
    return found


def topics(path: Path) -> dict[str, str]:
    """Return the topics of an MCAP and the names of their schemas, or the encoding where there is none."""
    known = summary(path)
    return {
        each.topic: known.schemas[each.schema_id].name if each.schema_id else each.message_encoding
        for each in known.channels.values()
    }


def raw(path: Path, topic: str) -> list[tuple[int, bytes]]:
    """Return the times and the bytes of a topic's messages."""
    with path.open("rb") as file:
        return [
            (message.log_time, message.data)
            for _, _, message in make_reader(file, validate_crcs=True).iter_messages([topic])
        ]


def maps(path: Path, topic: str = "/merged/map") -> list[GridMessage]:
    found = [decode(RawMessage(topic, GRID_TYPE, "cdr", time_ns, data)) for time_ns, data in raw(path, topic)]
    assert all(isinstance(each, GridMessage) for each in found)
    return found  # type: ignore[return-value]


def reports(path: Path) -> list[tuple[int, dict[str, Any]]]:
    return [(time_ns, json.loads(data)) for time_ns, data in raw(path, "/merged/report")]


def transforms(path: Path) -> Iterator[tuple[int, dict[str, Any]]]:
    """Yield time and transforms, by child frame, of each message on /tf."""
    for time_ns, data in raw(path, "/tf"):
        message: Any = ros2_typestore().deserialize_cdr(data, "tf2_msgs/msg/TFMessage")
        yield time_ns, {each.child_frame_id: each for each in message.transforms}


def metadata(path: Path) -> dict[str, dict[str, str]]:
    with path.open("rb") as file:
        return {each.name: dict(each.metadata) for each in make_reader(file).iter_metadata()}


def same_map(found: Grid, expected: Grid) -> bool:
    """Tell whether two maps say the same, after their origin went through a quaternion."""
    return (
        found.resolution_m == expected.resolution_m
        and np.array_equal(found.cells, expected.cells)
        and found.map_from_grid.is_close(expected.map_from_grid, distance_m=1e-9, angle_rad=1e-9, at_m=(0.0, 0.0))
    )
