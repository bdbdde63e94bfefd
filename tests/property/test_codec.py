"""Whatever bytes a message has: a map that can be one, or a reason why it is none; in no more memory than the bytes."""

import struct
import tracemalloc

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from replay.codec import decode, decode_transforms
from replay.codec.decode import MAX_RESOLUTION_M, MIN_RESOLUTION_M
from replay.errors import BadMessage
from replay.messages import TransformMessage, UpdateMessage
from replay.pose3 import MAX_PLACE_M
from replay.skip_cause import SkipCause
from replay.sources.base import GRID_TYPE, TF_TYPE, UPDATE_TYPE, RawMessage
from tests.bags import START, Recorded, as_cdr, as_ros1, grid, map_fields
from tests.runs import link, linked, updated

MORE = settings().max_examples * 5
SOUND = {
    GRID_TYPE: Recorded("/m", GRID_TYPE, START, map_fields(grid(1, 4, 5), START, "odom")),
    UPDATE_TYPE: updated("r1", 0.0, 1, 2, grid(2, 2, 3).cells),
    TF_TYPE: linked(1.0, link("w", "a"), link("w", "b")),
}
WORDS = [0, 1, 5, 20, 100_001, 1 << 16, 1 << 30, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFB, 0xFFFFFFFF]
NUMBERS = [float("nan"), float("inf"), float("-inf"), 0.0, -1.0, 1e-30, 5e-324, 1e9, 1e30, 1e308, -1e308]

offsets = st.integers(0, 200)
changes = st.one_of(
    st.tuples(st.just("byte"), offsets, st.binary(min_size=1, max_size=3)),
    st.tuples(st.just("byte"), offsets, st.sampled_from(WORDS).map(lambda word: struct.pack("<I", word))),
    st.tuples(st.just("byte"), offsets, st.sampled_from(NUMBERS).map(lambda number: struct.pack("<d", number))),
    st.tuples(
        st.just("byte"), offsets, st.sampled_from(NUMBERS).map(lambda n: np.float32(min(max(n, -3e38), 3e38)).tobytes())
    ),
    st.tuples(st.just("cut"), offsets, st.just(b"")),
    st.tuples(st.just("insert"), offsets, st.binary(min_size=1, max_size=9)),
)
encodings = st.sampled_from(["cdr", "ros1"])
types = st.sampled_from(sorted(SOUND))


def changed(data, how):
    for kind, offset, part in how:
        at = offset % (len(data) + 1)
        kept = {"cut": b"", "byte": data[at + len(part) :], "insert": data[at:]}[kind]
        data = data[:at] + part + kept
    return data


def attempt(raw):
    """Return the message, or why it is none."""
    try:
        return (decode_transforms if raw.msgtype == TF_TYPE else decode)(raw), None
    except BadMessage as error:
        return None, error


def check(msgtype, encoding, data):
    """Decode, and check that it is what can be used; return whether it is."""
    raw = RawMessage("/x", msgtype, encoding, START, data)
    tracemalloc.start()
    message, error = attempt(raw)
    _, peak_bytes = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    # the first decoder of a type is made when it is used first
    assert peak_bytes < 20_000_000 + 100 * len(data)
    if error is not None:
        assert error.cause in set(SkipCause)
        assert "\n" not in error.detail
        assert len(error.detail) < 1000
        return False
    assert 0 <= message.stamp_ns < 2**32 * 10**9
    if isinstance(message, TransformMessage):
        for each in message.links:
            pose = each.parent_from_child
            assert max(map(abs, (pose.x_m, pose.y_m, pose.z_m))) <= MAX_PLACE_M
        return True
    cells = message.cells if isinstance(message, UpdateMessage) else message.grid.cells
    assert 0 < cells.size <= len(data)
    assert np.isin(cells, np.arange(-1, 101)).all()
    if not isinstance(message, UpdateMessage):
        pose = message.grid.map_from_grid
        assert MIN_RESOLUTION_M <= message.grid.resolution_m <= MAX_RESOLUTION_M
        assert max(abs(pose.x_m), abs(pose.y_m)) <= MAX_PLACE_M
    return True


@settings(max_examples=MORE)
@given(types, encodings, st.binary(max_size=300))
def test_any_bytes(msgtype, encoding, data):
    check(msgtype, encoding, data)


@settings(max_examples=MORE)
@given(types, encodings, st.binary(max_size=300))
def test_any_bytes_after_a_sound_beginning(msgtype, encoding, data):
    check(msgtype, encoding, b"\x00\x01\x00\x00" + data)


@settings(max_examples=MORE)
@given(types, encodings, st.lists(changes, max_size=4))
def test_messages_that_were_changed(msgtype, encoding, how):
    sound = as_ros1(SOUND[msgtype]) if encoding == "ros1" else as_cdr(SOUND[msgtype])
    usable = check(msgtype, encoding, changed(sound, how))
    assert usable or how, "what was not changed can be used"


@settings(max_examples=MORE)
@given(
    encodings,
    st.sampled_from([0, 1, 4, 5, 20, 100_001, 1 << 16, 1 << 31, (1 << 32) - 1]),
    st.sampled_from([0, 1, 4, 5, 20, 100_001, 1 << 16, 1 << 31, (1 << 32) - 1]),
    st.one_of(st.sampled_from(NUMBERS), st.floats(width=64)),
    st.tuples(*[st.one_of(st.sampled_from(NUMBERS), st.floats(width=64))] * 3),
    st.tuples(*[st.one_of(st.sampled_from(NUMBERS), st.floats(width=64))] * 4),
)
def test_fields_that_no_map_has(encoding, width, height, resolution, position, orientation):
    fields = {
        **map_fields(grid(1, 4, 5), START),
        "width": width,
        "height": height,
        "resolution": resolution if abs(resolution) < 3e38 else float("inf"),
        "position": position,
        "orientation": orientation,
    }
    recorded = Recorded("/m", GRID_TYPE, START, fields)
    usable = check(GRID_TYPE, encoding, as_ros1(recorded) if encoding == "ros1" else as_cdr(recorded))
    assert not usable or width * height == 20
