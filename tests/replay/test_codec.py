from __future__ import annotations

import contextlib
import math
from typing import Any

import numpy as np
import pytest

from mapmerge.grid import Grid
from mapmerge.sim2 import Sim2
from replay.codec import decode, encode_grid, ros1_typestore, ros2_message_definition, ros2_typestore
from replay.errors import BadMessage, OutputError
from replay.messages import GridMessage, UpdateMessage
from replay.sources.base import GRID_TYPE, UPDATE_TYPE, Encoding, RawMessage
from tests.bags import START, Recorded, as_cdr, as_ros1, grid, map_fields


def _raw(fields: dict[str, Any], encoding: Encoding = "cdr", msgtype: str = GRID_TYPE) -> RawMessage:
    recorded = Recorded("/map", msgtype, START, fields)
    return RawMessage("/map", msgtype, encoding, START, as_ros1(recorded) if encoding == "ros1" else as_cdr(recorded))


def _decoded(encoding: Encoding = "cdr", **changes: Any) -> GridMessage:
    message = decode(_raw({**map_fields(grid(1), START, "odom"), **changes}, encoding))
    assert isinstance(message, GridMessage)
    return message


def _refused(encoding: Encoding = "cdr", msgtype: str = GRID_TYPE, **changes: Any) -> BadMessage:
    with pytest.raises(BadMessage) as caught:
        decode(_raw({**map_fields(grid(1)), "x": 0, "y": 0, **changes}, encoding, msgtype))
    assert "\n" not in caught.value.detail
    return caught.value


@pytest.mark.parametrize("encoding", ["cdr", "ros1"])
class TestDecode:
    def test_returns_what_was_recorded(self, encoding: Encoding) -> None:
        message, known = _decoded(encoding), grid(1)
        assert (message.stamp_ns, message.frame_id) == (START, "odom")
        assert np.array_equal(message.grid.cells, known.cells)
        assert message.grid.resolution_m == known.resolution_m
        assert message.grid.map_from_grid.is_close(known.map_from_grid, distance_m=0, angle_rad=1e-12, at_m=(0, 0))

    def test_cells_are_a_read_only_view_of_the_message(self, encoding: Encoding) -> None:
        raw = _raw(map_fields(grid(1)), encoding)
        message = decode(raw)
        assert isinstance(message, GridMessage)
        assert np.shares_memory(message.grid.cells, np.frombuffer(raw.data, np.uint8))
        assert not message.grid.cells.flags.writeable

    def test_values_that_mean_nothing_are_unknown(self, encoding: Encoding) -> None:
        cells = np.array([-128, -2, -1, 0, 100, 101, 127, 50], np.int8)
        message = _decoded(encoding, width=4, height=2, data=cells)
        assert message.grid.cells.tolist() == [[-1, -1, -1, 0], [100, -1, -1, 50]]
        assert message.odd_cells == 4
        assert _decoded(encoding).odd_cells == 0
        assert not message.grid.cells.flags.writeable

    def test_update(self, encoding: Encoding) -> None:
        cells = np.array([0, 100, -1, 101, 5, 6], np.int8)
        fields = {"stamp_ns": 5, "frame_id": "f", "x": -2, "y": 7, "width": 3, "height": 2, "data": cells}
        message = decode(_raw(fields, encoding, UPDATE_TYPE))
        assert isinstance(message, UpdateMessage)
        assert (message.stamp_ns, message.frame_id, message.col, message.row) == (5, "f", -2, 7)
        assert message.cells.tolist() == [[0, 100, -1], [-1, 5, 6]]
        assert message.odd_cells == 1
        assert not message.cells.flags.writeable

    @pytest.mark.parametrize("yaw_rad", [0.0, 0.5, -3.0, math.pi, 1e-9])
    def test_a_turned_origin_becomes_its_yaw(self, encoding: Encoding, yaw_rad: float) -> None:
        turn = (0.0, 0.0, 3.0 * math.sin(yaw_rad / 2.0), 3.0 * math.cos(yaw_rad / 2.0))
        assert _decoded(encoding, orientation=turn).grid.map_from_grid.yaw_rad == pytest.approx(yaw_rad, abs=1e-12)

    def test_a_quaternion_that_was_never_set_is_no_turn(self, encoding: Encoding) -> None:
        assert _decoded(encoding, orientation=(0.0, 0.0, 0.0, 0.0)).grid.map_from_grid == Sim2(-1.5, 2.25)

    def test_a_slight_tilt_is_flattened(self, encoding: Encoding) -> None:
        turn = (math.sin(math.radians(2.0)), 0.0, 0.0, math.cos(math.radians(2.0)))
        assert _decoded(encoding, orientation=turn).grid.map_from_grid.yaw_rad == pytest.approx(0.0, abs=1e-12)

    @pytest.mark.parametrize("resolution", [0.0, -0.05, math.nan, math.inf])
    def test_bad_resolution(self, encoding: Encoding, resolution: float) -> None:
        assert _refused(encoding, resolution=resolution).cause == "bad_resolution"

    @pytest.mark.parametrize(
        "changes",
        [
            {"position": (math.nan, 0.0, 0.0)},
            {"position": (0.0, math.inf, 0.0)},
            {"orientation": (0.0, 0.0, math.nan, 1.0)},
            {"orientation": (1.0, 0.0, 0.0, 0.0)},
            {"orientation": (0.0, math.sin(math.radians(4.0)), 0.0, math.cos(math.radians(4.0)))},
        ],
    )
    def test_bad_origin(self, encoding: Encoding, changes: dict[str, Any]) -> None:
        assert _refused(encoding, **changes).cause == "bad_origin"

    def test_size_mismatch_says_both_sizes(self, encoding: Encoding) -> None:
        error = _refused(encoding, width=7, height=3, data=np.zeros(20, np.int8))
        assert error.cause == "size_mismatch"
        assert "20 cells" in error.detail
        assert "7 × 3 = 21" in error.detail

    def test_empty(self, encoding: Encoding) -> None:
        # As a publisher sends it before it has a map: nothing is set.
        nothing = np.zeros(0, np.int8)
        assert _refused(encoding, width=0, height=0, resolution=0.0, data=nothing).cause == "empty"
        assert _refused(encoding, UPDATE_TYPE, width=0, height=9, data=nothing).cause == "empty"

    def test_too_large(self, encoding: Encoding) -> None:
        cells = np.zeros(100_001, np.int8)
        assert _refused(encoding, width=100_001, height=1, data=cells).cause == "too_large"
        assert _refused(encoding, UPDATE_TYPE, width=1, height=100_001, data=cells).cause == "too_large"

    def test_every_truncation_is_undecodable(self, encoding: Encoding) -> None:
        raw = _raw(map_fields(grid(1, rows=2, cols=3)), encoding)
        for length in range(len(raw.data)):
            cut = RawMessage(raw.topic, raw.msgtype, encoding, START, raw.data[:length])
            with pytest.raises(BadMessage) as caught:
                decode(cut)
            assert caught.value.cause == "undecodable"

    def test_noise_is_refused_or_read_but_never_crashes(self, encoding: Encoding) -> None:
        raw = _raw(map_fields(grid(1, rows=2, cols=3)), encoding)
        random = np.random.default_rng(3)
        for _ in range(2000):
            data = bytearray(raw.data)
            data[random.integers(len(data))] = random.integers(256)
            data[random.integers(len(data))] = random.integers(256)
            with contextlib.suppress(BadMessage):
                decode(RawMessage(raw.topic, raw.msgtype, encoding, START, bytes(data)))


def test_another_type_is_undecodable() -> None:
    with pytest.raises(BadMessage, match="is no map") as caught:
        decode(RawMessage("/t", "std_msgs/msg/String", "cdr", 0, b"\0\1\0\0"))
    assert caught.value.cause == "undecodable"


def test_big_endian_is_read() -> None:
    known = Recorded("/map", GRID_TYPE, START, map_fields(grid(1)))
    message = ros2_typestore().deserialize_cdr(as_cdr(known), GRID_TYPE)
    data = ros2_typestore().serialize_cdr(message, GRID_TYPE, little_endian=False)
    found = decode(RawMessage("/map", GRID_TYPE, "cdr", START, data))
    assert isinstance(found, GridMessage)
    assert np.array_equal(found.grid.cells, grid(1).cells)


@pytest.mark.parametrize("yaw_rad", [0.0, 1.0, -2.5, math.pi])
def test_encode_grid_is_the_inverse_of_decode(yaw_rad: float) -> None:
    known = Grid(grid(8).cells, 0.1, Sim2(3.0, -4.0, yaw_rad))
    message = decode(RawMessage("/map", GRID_TYPE, "cdr", 0, encode_grid(known, "merged", START + 1)))
    assert isinstance(message, GridMessage)
    assert (message.stamp_ns, message.frame_id) == (START + 1, "merged")
    assert np.array_equal(message.grid.cells, known.cells)
    assert message.grid.resolution_m == known.resolution_m
    assert message.grid.map_from_grid.is_close(known.map_from_grid, distance_m=0, angle_rad=1e-12, at_m=(0.0, 0.0))


def test_encode_grid_takes_cells_that_are_not_contiguous() -> None:
    known = Grid(grid(8).cells[::-2, 3:50:2], 0.05)
    message = decode(RawMessage("/map", GRID_TYPE, "cdr", 0, encode_grid(known, "map", 0)))
    assert isinstance(message, GridMessage)
    assert np.array_equal(message.grid.cells, known.cells)


def test_encode_grid_refuses_a_time_that_no_stamp_holds() -> None:
    with pytest.raises(OutputError, match="32 bits"):
        encode_grid(grid(1), "map", 2**31 * 1_000_000_000)


def test_message_definition_holds_all_it_depends_on() -> None:
    text = ros2_message_definition(GRID_TYPE)
    assert text.startswith("std_msgs/Header header\n")
    for name in ("std_msgs/Header", "builtin_interfaces/Time", "nav_msgs/MapMetaData", "geometry_msgs/Quaternion"):
        assert f"MSG: {name}\n" in text
    assert "int32 x" in ros2_message_definition(UPDATE_TYPE)


def test_typestores_have_what_is_recorded_beside_maps() -> None:
    for store in (ros1_typestore(), ros2_typestore()):
        assert {GRID_TYPE, UPDATE_TYPE, "tf2_msgs/msg/TFMessage"} <= store.types.keys()
    assert ros2_typestore() is ros2_typestore()
