"""Chains of transforms within one recording."""

from __future__ import annotations

import itertools
import math

import pytest

from mapmerge.sim2 import IDENTITY, Sim2
from replay.messages import FrameLink
from replay.pose3 import Pose3
from replay.transforms import Chain, TransformBuffer

ONE, TWO, THREE = Sim2(1.0, 2.0, 0.3), Sim2(-4.0, 0.5, 2.0), Sim2(0.2, 7.0, -1.1)


def pose3(pose: Sim2) -> Pose3:
    return Pose3.of((pose.x_m, pose.y_m, 0.0), (0.0, 0.0, math.sin(pose.yaw_rad / 2), math.cos(pose.yaw_rad / 2)))


def buffer(*links: tuple[str, str, Sim2], stamp_ns: int | None = None) -> TransformBuffer:
    held = TransformBuffer()
    for parent, child, pose in links:
        held.hold(FrameLink(parent, child, pose3(pose)), stamp_ns)
    return held


def hold(held: TransformBuffer, parent: str, child: str, pose: Sim2, stamp_ns: int | None) -> None:
    held.hold(FrameLink(parent, child, pose3(pose)), stamp_ns)


def leads_to(chain: Chain | None, expected: Sim2) -> bool:
    assert chain is not None
    return chain.target_from_source.flat().is_close(expected, distance_m=1e-9, angle_rad=1e-9, at_m=(1.0, 1.0))


def test_a_single_link_and_its_inverse() -> None:
    held = buffer(("r1/map", "r2/map", ONE))
    assert leads_to(held.chain("r1/map", "r2/map"), ONE)
    assert leads_to(held.chain("r2/map", "r1/map"), ONE.inverse())


def test_a_frame_lies_in_itself_whether_it_is_known_or_not() -> None:
    held = buffer(("world", "r1/map", ONE))
    for frame in ("world", "r1/map", "nowhere"):
        assert leads_to(held.chain(frame, frame), IDENTITY)


def test_a_common_parent() -> None:
    held = buffer(("world", "r1/map", ONE), ("world", "r2/map", TWO))
    assert leads_to(held.chain("r1/map", "r2/map"), ONE.inverse() @ TWO)


@pytest.mark.parametrize(
    "order", list(itertools.permutations([("earth", "hall", ONE), ("hall", "r1/map", TWO), ("earth", "r2/map", THREE)]))
)
def test_a_common_ancestor_in_whatever_order_the_links_come(order) -> None:
    held = buffer(*order)
    assert leads_to(held.chain("r1/map", "r2/map"), (ONE @ TWO).inverse() @ THREE)
    assert leads_to(held.chain("r2/map", "r1/map"), THREE.inverse() @ ONE @ TWO)
    assert leads_to(held.chain("earth", "r1/map"), ONE @ TWO)


def test_the_nearest_common_ancestor_is_enough() -> None:
    """What is above it may be as wrong as it likes."""
    held = buffer(("world", "r1/map", ONE), ("world", "r2/map", TWO))
    hold(held, "far", "world", Sim2(1e9, 1e9), 5)
    chain = held.chain("r1/map", "r2/map")
    assert leads_to(chain, ONE.inverse() @ TWO)
    assert chain is not None
    assert chain.stamp_ns is None


def test_no_chain() -> None:
    held = buffer(("a", "r1/map", ONE), ("b", "r2/map", TWO))
    assert held.chain("r1/map", "r2/map") is None
    assert TransformBuffer().chain("r1/map", "r2/map") is None


def test_in_a_loop_there_is_no_telling() -> None:
    held = buffer(("b", "a", ONE), ("c", "b", TWO), ("a", "c", THREE), ("a", "hanging", ONE), ("world", "r1/map", ONE))
    for target, source in itertools.permutations(("a", "b", "hanging", "r1/map"), 2):
        assert held.chain(target, source) is None
    assert leads_to(held.chain("world", "r1/map"), ONE)


def test_depth_is_no_trouble() -> None:
    frames = [f"frame{index}" for index in range(2000)]
    held = buffer(*((parent, child, Sim2(1.0)) for parent, child in itertools.pairwise(frames)))
    chain = held.chain(frames[0], frames[-1])
    assert leads_to(chain, Sim2(1999.0))


class TestTime:
    def test_the_latest_holds(self) -> None:
        held = buffer(("world", "r1/map", IDENTITY))
        for stamp_ns, pose in enumerate((ONE, TWO, THREE)):
            hold(held, "world", "r2/map", pose, stamp_ns)
            chain = held.chain("r1/map", "r2/map")
            assert leads_to(chain, pose)
            assert chain is not None
            assert chain.stamp_ns == stamp_ns

    def test_what_holds_always_is_not_replaced(self) -> None:
        held = buffer(("world", "r2/map", ONE))
        hold(held, "elsewhere", "r2/map", TWO, 9)
        assert leads_to(held.chain("world", "r2/map"), ONE)
        hold(held, "world", "r2/map", THREE, None)
        assert leads_to(held.chain("world", "r2/map"), THREE)

    def test_and_replaces_what_does_not(self) -> None:
        held = TransformBuffer()
        hold(held, "world", "r2/map", TWO, 9)
        hold(held, "world", "r2/map", ONE, None)
        assert leads_to(held.chain("world", "r2/map"), ONE)

    def test_a_frame_may_change_its_parent(self) -> None:
        held = TransformBuffer()
        hold(held, "lift", "r2/map", ONE, 1)
        hold(held, "world", "r2/map", TWO, 2)
        assert leads_to(held.chain("world", "r2/map"), TWO)
        assert held.chain("lift", "r2/map") is None

    def test_a_chain_is_as_new_as_its_newest_link(self) -> None:
        held = TransformBuffer()
        hold(held, "world", "r1/map", ONE, 3)
        hold(held, "world", "r2/map", TWO, 8)
        chain = held.chain("r1/map", "r2/map")
        assert chain is not None
        assert chain.stamp_ns == 8


def test_a_detour_through_space_ends_in_the_plane() -> None:
    """As where a camera sees a tag on the wall: links are tilted, the whole is not."""
    tilted = Pose3.of((0.5, 0.0, 1.2), (0.5, -0.5, 0.5, -0.5))
    held = TransformBuffer()
    held.hold(FrameLink("r1/map", "camera", tilted), 1)
    held.hold(FrameLink("camera", "r2/map", tilted.inverse() @ pose3(ONE)), 1)
    chain = held.chain("r1/map", "r2/map")
    assert chain is not None
    assert chain.target_from_source.tilt_rad == pytest.approx(0.0, abs=1e-6)
    assert leads_to(chain, ONE)
