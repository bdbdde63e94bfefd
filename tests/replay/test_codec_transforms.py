from __future__ import annotations

import math
from typing import Any

import pytest

from mapmerge.sim2 import Sim2
from replay.codec import FrameTransform, decode_transforms, encode_transforms
from replay.errors import BadMessage
from replay.messages import TransformMessage
from replay.sources.base import TF_TYPE, TF_TYPES, Encoding, RawMessage
from tests.bags import START, Recorded, as_cdr, as_ros1
from tests.runs import link, linked


def decoded(*links: dict[str, Any], encoding: Encoding = "cdr", msgtype: str = TF_TYPE) -> TransformMessage:
    return decode_transforms(raw(linked(0.0, *links, msgtype=msgtype), encoding))


def raw(recorded: Recorded, encoding: Encoding = "cdr") -> RawMessage:
    data = as_ros1(recorded) if encoding == "ros1" else as_cdr(recorded)
    return RawMessage("/tf", recorded.msgtype, encoding, recorded.log_time_ns, data)


@pytest.mark.parametrize("msgtype", TF_TYPES)
@pytest.mark.parametrize("encoding", ["cdr", "ros1"])
def test_returns_what_was_recorded(encoding: Encoding, msgtype: str) -> None:
    pose = Sim2(1.5, -2.0, 2.5)
    links = link("world", "r1/map", pose, START + 5), link("r1/map", "r1/odom", stamp_ns=START + 3)
    message = decoded(*links, encoding=encoding, msgtype=msgtype)
    assert (message.stamp_ns, message.bad) == (START + 5, ())
    first, second = message.links
    assert (first.parent, first.child, second.child) == ("world", "r1/map", "r1/odom")
    assert first.parent_from_child.flat().is_close(pose, distance_m=0.0, angle_rad=1e-12, at_m=(0.0, 0.0))
    assert second.parent_from_child.flat() == Sim2()


def test_leading_slashes_are_stripped() -> None:
    (found,) = decoded(link("/world", "/r1/map")).links
    assert (found.parent, found.child) == ("world", "r1/map")


def test_quaternions_of_any_length_are_turns() -> None:
    (found,) = decoded(link("a", "b", turn=(0.0, 0.0, 3.0, 3.0))).links
    assert found.parent_from_child.flat().yaw_rad == pytest.approx(math.pi / 2)


@pytest.mark.parametrize(
    ("fields", "expected"),
    [
        ({"shift": (math.nan, 0.0, 0.0)}, "finite"),
        ({"shift": (0.0, math.inf, 0.0)}, "finite"),
        ({"turn": (0.0, 0.0, math.nan, 1.0)}, "finite"),
        ({"turn": (0.0, 0.0, 0.0, 0.0)}, "four zeros"),
        ({"child": ""}, "two frames"),
        ({"parent": ""}, "two frames"),
        ({"child": "/world"}, "two frames"),
    ],
)
def test_one_that_is_none_does_not_spoil_the_others(fields: dict[str, Any], expected: str) -> None:
    good = link("world", "r2/map", Sim2(1.0))
    message = decoded(link("world", "r1/map") | fields, good)
    assert [each.child for each in message.links] == ["r2/map"]
    (bad,) = message.bad
    assert expected in bad
    assert "is none: " in bad


def test_no_transforms() -> None:
    assert decoded() == TransformMessage(0, (), ())


def test_bytes_that_are_none() -> None:
    whole = raw(linked(0.0, link("a", "b")))
    for data in (whole.data[:-9], b"", b"\0\1\0\0\xff\xff\xff\xff"):
        with pytest.raises(BadMessage, match="bytes are no cdr") as caught:
            decode_transforms(RawMessage("/tf", TF_TYPE, "cdr", 0, data))
        assert caught.value.cause == "undecodable"


def test_what_this_program_writes_is_read() -> None:
    data = encode_transforms([FrameTransform("merged", "r2/map", Sim2(1.0, 2.0, 0.5))], START)
    message = decode_transforms(RawMessage("/tf", TF_TYPE, "cdr", 0, data))
    (found,) = message.links
    assert message.stamp_ns == START
    assert (found.parent, found.child) == ("merged", "r2/map")
    expected = Sim2(1.0, 2.0, 0.5)
    assert found.parent_from_child.flat().is_close(expected, distance_m=1e-12, angle_rad=1e-12, at_m=(1.0, 1.0))
