"""From poses that were given and transforms that were recorded to priors, and what is said where there are none."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import pytest

from mapmerge.prior import Prior
from mapmerge.sim2 import Sim2
from replay.beliefs import TF_SIGMA_M, TF_SIGMA_YAW_RAD, Beliefs
from replay.init_pose import InitPose
from replay.messages import FrameLink
from replay.pose3 import Pose3
from replay.sources.base import Source
from replay.timeline import Transforms
from tests.fakes import FakeSource

FRAMES = {"r1": "r1/map", "r2": "r2/map", "r3": "r3/map"}
POSE = Sim2(3.0, -1.0, 0.5)


def pose3(pose: Sim2, roll_rad: float = 0.0) -> Pose3:
    yaw = Pose3.of((pose.x_m, pose.y_m, 0.0), (0.0, 0.0, math.sin(pose.yaw_rad / 2), math.cos(pose.yaw_rad / 2)))
    return yaw @ Pose3.of((0.0, 0.0, 0.0), (math.sin(roll_rad / 2), 0.0, 0.0, math.cos(roll_rad / 2)))


def told(
    beliefs: Beliefs, recording: Source, child: str, pose: Sim2, stamp_ns: int | None = None, **options: Any
) -> None:
    links = (FrameLink("r1/map", child, pose3(pose, **options)),)
    beliefs.take(Transforms(recording, stamp_ns, links))


def beliefs(
    *recordings: Source,
    frames: Mapping[str, str | None] | None = None,
    given: Sequence[InitPose] = (),
    use_tf: bool = True,
) -> Beliefs:
    return Beliefs(frames or FRAMES, given, recordings if use_tf else None)


def messages(notes) -> dict[str, str]:
    found = [(note.robot, note.message) for note in notes]
    assert len(dict(found)) == len(found), "once a robot"
    return dict(found)


def is_about(prior: Prior, pose: Sim2) -> bool:
    return prior.target_from_source.is_close(pose, distance_m=1e-9, angle_rad=1e-9, at_m=(1.0, 1.0))


def test_nothing_is_believed_and_nothing_said_unless_asked() -> None:
    known = beliefs(use_tf=False)
    assert known.now() == ({}, ())
    assert messages(known.foreseen()) == messages(known.missed()) == {}


def test_a_given_pose() -> None:
    given = InitPose("r2", 1.0, 2.0, 0.5)
    priors, notes = beliefs(given=[given], use_tf=False).now()
    assert (priors, notes) == ({"r2": given.prior()}, ())


def test_a_transform() -> None:
    recording = FakeSource([])
    known = beliefs(recording)
    assert known.now() == ({}, ())
    told(known, recording, "r2/map", POSE, 5)
    priors, notes = known.now()
    assert notes == ()
    assert set(priors) == {"r2"}
    assert is_about(priors["r2"], POSE)
    prior = priors["r2"]
    assert (prior.sigma_x_m, prior.sigma_y_m, prior.sigma_yaw_rad) == (TF_SIGMA_M, TF_SIGMA_M, TF_SIGMA_YAW_RAD)
    assert prior.origin == "recorded in /tf"
    (missed,) = messages(known.missed()).items()
    assert missed[0] == "r3"
    assert "links its map frame 'r3/map' with 'r1/map'" in missed[1]


def test_a_given_pose_wins() -> None:
    recording = FakeSource([])
    given = InitPose("r2", 1.0, 2.0, 0.5)
    known = beliefs(recording, given=[given])
    told(known, recording, "r2/map", POSE)
    assert known.now()[0] == {"r2": given.prior()}
    assert set(messages(known.missed())) == {"r3"}


class TestSeveralRecordings:
    def test_frames_of_two_are_not_linked(self) -> None:
        a, b = FakeSource([]), FakeSource([])
        known = beliefs(a, b)
        known.take(Transforms(a, None, (FrameLink("world", "r1/map", pose3(POSE)),)))
        known.take(Transforms(b, None, (FrameLink("world", "r2/map", pose3(POSE)),)))
        assert known.now()[0] == {}

    def test_the_newest_counts(self) -> None:
        a, b = FakeSource([]), FakeSource([])
        known = beliefs(a, b)
        told(known, a, "r2/map", POSE, 5)
        told(known, b, "r2/map", Sim2(9.0), 4)
        assert is_about(known.now()[0]["r2"], POSE)
        told(known, b, "r2/map", Sim2(9.0), 6)
        assert is_about(known.now()[0]["r2"], Sim2(9.0))

    def test_of_those_that_hold_always_the_first(self) -> None:
        a, b = FakeSource([]), FakeSource([])
        known = beliefs(a, b)
        told(known, b, "r2/map", Sim2(9.0))
        told(known, a, "r2/map", POSE)
        assert is_about(known.now()[0]["r2"], POSE)
        told(known, b, "r2/map", Sim2(9.0))
        assert is_about(known.now()[0]["r2"], POSE)


class TestWhatIsSaid:
    def test_no_transforms_at_all(self) -> None:
        said = messages(beliefs().foreseen())
        assert set(said) == {"r2", "r3"}
        assert said["r2"] == "there is no /tf and no /tf_static in the recordings; no prior is used for it"

    def test_frames_of_one_name(self) -> None:
        recording = FakeSource([])
        known = beliefs(recording, frames={"r1": "map", "r2": "map", "r3": "r3/map"})
        said = messages(known.foreseen())
        assert set(said) == {"r2"}
        assert "have the same frame, 'map', so that no transform tells" in said["r2"]
        assert known.now() == ({}, ())
        assert set(messages(known.missed())) == {"r3"}

    @pytest.mark.parametrize(("frames", "whose"), [({"r1": "", "r2": "map"}, "r1"), ({"r1": "map", "r2": ""}, "r2")])
    def test_frames_without_a_name(self, frames: dict[str, str], whose: str) -> None:
        said = messages(beliefs(FakeSource([]), frames=frames).foreseen())
        assert f"the maps of {whose} name no frame" in said["r2"]

    @pytest.mark.parametrize("frames", [{"r1": "r1/map", "r2": None}, {"r1": None, "r2": "r2/map"}])
    def test_nothing_of_robots_without_a_map(self, frames: dict[str, str | None]) -> None:
        known = beliefs(FakeSource([]), frames=frames)
        assert messages(known.foreseen()) == messages(known.missed()) == {}
        assert known.now() == ({}, ())

    def test_transforms_that_come_too_late(self) -> None:
        recording = FakeSource([])
        known = beliefs(recording, frames={"r1": "r1/map", "r2": "r2/map"})
        assert known.now() == ({}, ())
        told(known, recording, "r2/map", POSE, 9)
        (said,) = messages(known.missed()).values()
        assert "'r2/map' with 'r1/map' only after the last map" in said

    def test_a_tilted_transform_once(self) -> None:
        recording = FakeSource([])
        known = beliefs(recording)
        told(known, recording, "r2/map", POSE, 1, roll_rad=math.radians(30.0))
        priors, notes = known.now()
        assert priors == {}
        assert "'r2/map' to 'r1/map' is tilted by 30°" in messages(notes)["r2"]
        assert known.now() == ({}, ())
        assert set(messages(known.missed())) == {"r3"}
        told(known, recording, "r2/map", POSE, 2, roll_rad=math.radians(3.0))
        priors, notes = known.now()
        assert notes == ()
        assert is_about(priors["r2"], POSE)
