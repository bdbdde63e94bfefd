from __future__ import annotations

import json
from pathlib import Path

import pytest

from replay.errors import UsageError
from replay.init_pose import InitPose
from replay.options import MOST_NS, RunOptions, TimeBound, seconds_to_ns
from replay.runs import RunPath, TopicChoice

DAY_NS = 86_400 * 10**9
MANY_DIGITS = ["1" * 40, "1" * 5000, "0." + "1" * 5000]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("0", 0),
        ("5", 5_000_000_000),
        ("2.5", 2_500_000_000),
        (".5", 500_000_000),
        ("7.", 7_000_000_000),
        ("0.000000001", 1),
        ("1700000000.123456789", 1_700_000_000_123_456_789),
    ],
)
def test_seconds_to_ns(text: str, expected: int) -> None:
    assert seconds_to_ns(text) == expected


@pytest.mark.parametrize("text", ["", "-1", "+1", "1e3", "inf", "nan", "1,5", "1.2.3", ".", "5s", " 5", *MANY_DIGITS])
def test_no_seconds(text: str) -> None:
    with pytest.raises(UsageError, match=r"expected one such as 12\.5") as refused:
        seconds_to_ns(text)
    assert len(str(refused.value)) < 300


def test_the_longest_time() -> None:
    assert seconds_to_ns("1000000000000") == MOST_NS
    assert TimeBound.parse(f"-{MOST_NS}ns") == TimeBound(-MOST_NS, relative=False)
    for text in ("1000000000000.1", "1000000000001"):
        with pytest.raises(UsageError, match=r"of at most 1000000000000$"):
            seconds_to_ns(text)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("12.5", TimeBound(12_500_000_000, relative=True)),
        ("0", TimeBound(0, relative=True)),
        ("1700000000123456789ns", TimeBound(1_700_000_000_123_456_789, relative=False)),
        ("-5ns", TimeBound(-5, relative=False)),
        ("1969-12-31", TimeBound(-DAY_NS, relative=False)),
        ("1970-01-02", TimeBound(DAY_NS, relative=False)),
        ("1970-01-02T00:00:01Z", TimeBound(DAY_NS + 10**9, relative=False)),
        ("1970-01-02T02:00:00+02:00", TimeBound(DAY_NS, relative=False)),
        ("1970-01-02 00:00:00.000001", TimeBound(DAY_NS + 1_000, relative=False)),
        ("2026-05-01T12:00:00.123456Z", TimeBound(1_777_636_800_123_456_000, relative=False)),
        ("2026-05-01T12:00:00.123456789Z", TimeBound(1_777_636_800_123_456_789, relative=False)),
    ],
)
def test_time_bound(text: str, expected: TimeBound) -> None:
    assert TimeBound.parse(text) == expected


@pytest.mark.parametrize(
    "text", ["noon", "12:30", "2026-13-01", "5 ns", "ns", "-3", "1e9", "", f"{MANY_DIGITS[1]}ns", f"{MOST_NS + 1}ns"]
)
def test_no_time(text: str) -> None:
    with pytest.raises(UsageError, match="is no time; expected") as refused:
        TimeBound.parse(text)
    assert len(str(refused.value)) < 400


def test_absolute() -> None:
    assert TimeBound(5, relative=True).absolute_ns(100) == 105
    assert TimeBound(5, relative=False).absolute_ns(100) == 5


def test_settings_are_json_and_all_that_affects_results() -> None:
    options = RunOptions(
        (RunPath(None, Path("run.mcap")),),
        topics=(TopicChoice("r1", "/x"),),
        start=TimeBound(5, relative=True),
        strict=True,
        images="all",
        init_poses=(InitPose("r2", 1.0, 2.0, 0.5),),
        use_tf=True,
    )
    settings = options.settings()
    assert json.loads(json.dumps(settings)) == settings
    assert settings["start"] == {"ns": 5, "relative": True}
    assert settings["stop"] is None
    assert settings["topics"] == [{"robot": "r1", "topic": "/x"}]
    assert settings["merge"]["method"] == "correlation"
    assert settings["use_tf"] is True
    (pose,) = settings["init_poses"]
    assert InitPose(**pose) == InitPose("r2", 1.0, 2.0, 0.5)
    assert not {"images", "strict", "runs"} & set(settings)
