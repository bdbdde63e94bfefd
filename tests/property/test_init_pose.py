"""What is typed for --init-pose, and what is read of it."""

import contextlib
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mapmerge.sim2 import Sim2
from replay.errors import UsageError
from replay.init_pose import DEFAULT_SIGMA_M, DEFAULT_SIGMA_YAW_RAD, InitPose
from replay.pose3 import MAX_PLACE_M

numbers = st.floats(-MAX_PLACE_M, MAX_PLACE_M)
sigmas = st.floats(0.0, exclude_min=True, allow_nan=False, allow_infinity=False)
names = st.from_regex(r"[A-Za-z0-9_/][A-Za-z0-9_.\-/]*", fullmatch=True)
turns = st.floats(-math.tau, math.tau)
init_poses = st.builds(InitPose, names, numbers, numbers, turns, sigmas, sigmas, sigmas)


@given(init_poses)
def test_what_is_written_is_read_as_it_was(pose):
    assert InitPose.parse(str(pose)) == pose
    assert InitPose.parse(str(pose).replace("±", "+-")) == pose
    assert InitPose.parse(str(pose).replace("±", " +- ").replace(",", " , ")) == pose


@given(names, numbers, numbers, st.floats(-360.0, 360.0))
def test_degrees(name, x_m, y_m, yaw_deg):
    expected = InitPose(name, x_m, y_m, math.radians(yaw_deg))
    assert InitPose.parse(f"{name}={x_m!r},{y_m!r},{yaw_deg!r}deg") == expected
    assert InitPose.parse(f"{name}={x_m!r},{y_m!r},{yaw_deg!r} °") == expected


@given(st.text(max_size=30))
def test_whatever_is_typed_is_read_or_refused(text):
    with contextlib.suppress(UsageError):
        assert isinstance(InitPose.parse(text), InitPose)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("r2=1,2,0.5", InitPose("r2", 1.0, 2.0, 0.5)),
        ("r2=-1.5,+.5,-3", InitPose("r2", -1.5, 0.5, -3.0)),
        ("r2 = 1e1, 2., 0", InitPose("r2", 10.0, 2.0, 0.0)),
        ("r2=1,2,0.5±0.3,±0.4,±0.1", InitPose("r2", 1.0, 2.0, 0.5, 0.3, 0.4, 0.1)),
        ("r2=1,2,0.5±0.3±0.4±0.1", InitPose("r2", 1.0, 2.0, 0.5, 0.3, 0.4, 0.1)),
        ("r2=1,2,0.5+-0.3,+-0.4,+-0.1", InitPose("r2", 1.0, 2.0, 0.5, 0.3, 0.4, 0.1)),
        ("r2=1,2,90deg", InitPose("r2", 1.0, 2.0, math.pi / 2)),
        ("r2=1,2,90°±1,±1,±5", InitPose("r2", 1.0, 2.0, math.pi / 2, 1.0, 1.0, math.radians(5.0))),
        ("r2=1,2,0.5±1,±1,±5°", InitPose("r2", 1.0, 2.0, 0.5, 1.0, 1.0, math.radians(5.0))),
        ("fleet/r2=1,2,0", InitPose("fleet/r2", 1.0, 2.0, 0.0)),
    ],
)
def test_forms(text, expected):
    assert InitPose.parse(text) == expected


@pytest.mark.parametrize(
    "text",
    [
        "",
        "r2",
        "=1,2,3",
        "r2=",
        "r2=1,2",
        "r2=1,2,3,4",
        "r2=a,b,c",
        "r2=1,2,3±1",
        "r2=1,2,3±1,±1",
        "r2=1,2,3±-1,±1,±1x",
    ],
)
def test_malformed(text):
    with pytest.raises(UsageError, match=r"expected R=X,Y,YAW.* such as r2=4\.5,-1\.2,1\.57"):
        InitPose.parse(text)


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("r2=1,2,90", "if it is in degrees, give 90deg"),
        ("r2=1,2,-400deg", "more than a full turn"),
        ("r2=1,2,0±0,±1,±1", "more than 0"),
        ("r2=1,2,0±1,±1,±-0.1", "more than 0"),
        ("r2=1e999,2,0", "finite"),
    ],
)
def test_impossible(text, match):
    with pytest.raises(UsageError, match=match):
        InitPose.parse(text)


def test_as_a_prior():
    prior = InitPose("r2", 1.0, 2.0, 0.5).prior()
    assert prior.target_from_source == Sim2(1.0, 2.0, 0.5)
    assert (prior.sigma_x_m, prior.sigma_y_m, prior.sigma_yaw_rad) == (
        DEFAULT_SIGMA_M,
        DEFAULT_SIGMA_M,
        DEFAULT_SIGMA_YAW_RAD,
    )
    assert prior.origin == "given for r2"
