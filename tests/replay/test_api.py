"""`replay.merge`: a run from Python is that of the command line, told by values."""

from __future__ import annotations

import inspect
import json
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path

import cv2
import numpy as np
import pytest

import replay
from mapmerge import MergeConfig, VerifyConfig
from replay.options import RunOptions, TimeBound
from replay.runs import RunPath, TopicChoice
from replay.settings import keys
from tests.data_paths import ROOT
from tests.program import Program

SAMPLE = ROOT / "samples" / "two_robots.mcap"
BAGS = ROOT / "samples" / "bag_per_robot"


def options(**told: object) -> RunOptions:
    return replay.merge("run.mcap", **told).options  # type: ignore[arg-type]


def test_a_run_yields_what_happens() -> None:
    seen = list(replay.merge(SAMPLE, robots=["r2", "r1"], stop=100))
    assert isinstance(seen[0], replay.Started)
    assert isinstance(seen[-1], replay.Finished)
    assert {type(event) for event in seen[1:-1]} == {replay.Merged}
    assert [item.robot for item in seen[0].robots] == ["r2", "r1"]
    assert seen[-1].report["settings"]["robots"] == ["r2", "r1"]


def test_what_is_written_is_what_the_command_line_writes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    by_flags = Program(capsys, tmp_path)(
        "merge", SAMPLE, "-o", tmp_path / "a.mcap", "--no-rrd", "--start", "3.5", "--copy-maps"
    )
    assert by_flags.status == 0, by_flags.err
    run = replay.merge(SAMPLE, start=3.5)
    report = run.write(tmp_path / "b.mcap", rrd=False, copy_maps=True)
    assert (tmp_path / "a.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()
    assert replay.read_report(tmp_path / "b.json") == json.loads(json.dumps(report))
    assert replay.read_report(tmp_path / "b.mcap") == replay.read_report(str(tmp_path / "b.json"))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.json", "a.mcap", "b.json", "b.mcap"]


def test_the_recording_for_rerun_and_the_page_are_written_too(tmp_path: Path) -> None:
    replay.merge(SAMPLE, stop=20, images="none").write(tmp_path / "b.mcap", report=tmp_path / "page.html")
    assert (tmp_path / "b.rrd").stat().st_size > 1000
    assert "<html" in (tmp_path / "page.html").read_text(encoding="utf-8")


def test_a_run_is_over_once() -> None:
    run = replay.merge(SAMPLE, stop=20)
    assert run.finish()["updates"] > 0
    assert list(run) == []
    with pytest.raises(replay.UsageError, match="this run is over"):
        run.finish()


def test_only_what_was_not_begun_can_be_written(tmp_path: Path) -> None:
    with replay.merge(SAMPLE, stop=20) as run:
        next(run)
        with pytest.raises(replay.UsageError, match="taken already"):
            run.write(tmp_path / "b.mcap")
    assert list(run) == []
    assert list(tmp_path.iterdir()) == []


def test_files_that_exist_are_kept(tmp_path: Path) -> None:
    output = tmp_path / "b.mcap"
    output.write_text("mine", encoding="utf-8")
    run = replay.merge(SAMPLE, stop=20)
    with pytest.raises(replay.UsageError, match=r"there is already .*; give force=True to replace, or another name"):
        run.write(output, rrd=False)
    with pytest.raises(replay.UsageError, match=r"^output .*b\.bag: expected a name that ends in \.mcap"):
        run.write(tmp_path / "b.bag")
    with pytest.raises(replay.UsageError, match=r"^report .*b\.txt: expected a name that ends in \.html"):
        run.write(tmp_path / "c.mcap", report=tmp_path / "b.txt")
    with pytest.raises(replay.OutputError, match="no file can have this name"):
        run.write("a\0.mcap")
    assert output.read_text(encoding="utf-8") == "mine"
    run.write(output, rrd=False, force=True)  # nothing of it was taken yet
    assert output.stat().st_size > 1000


def test_a_run_says_what_it_is() -> None:
    run = replay.merge(SAMPLE, robots=["r1", "r2"], stop=20)
    assert repr(run) == "<replay.MergeRun of r1, r2 in two_robots.mcap: not begun>"
    next(run)
    assert repr(run).endswith(": going on>")
    run.close()
    assert repr(run).endswith(": over>")
    assert repr(replay.merge(SAMPLE)) == "<replay.MergeRun of all robots in two_robots.mcap: not begun>"


def test_recordings_may_be_one_or_several_or_by_robot() -> None:
    assert replay.merge(Path("a=b.mcap")).options.runs == (RunPath(None, Path("a=b.mcap")),)
    assert [run.path.name for run in replay.merge(["a", Path("b")]).options.runs] == ["a", "b"]
    by_robot = replay.merge({"x": BAGS / "alpha", "y": BAGS / "bravo"}).finish()
    assert sorted(by_robot["robots"]) == ["x", "y"]


def test_values_are_those_of_python() -> None:
    told = options(
        robots=["a", "b"],
        topics={"a": "/x", "b": "/y"},
        start=12,
        stop=datetime(1970, 1, 1, 2, tzinfo=timezone(timedelta(hours=1))),
        reorder_window_s=0.1,
        init_poses={"b": (1, 2.5, 0.5)},
        min_confidence=0.99,
        method="paper",
        scale="free",
        max_memory="2GiB",
    )
    assert told.robots == ("a", "b")
    assert told.topics == (TopicChoice("a", "/x"), TopicChoice("b", "/y"))
    assert told.start == TimeBound(12 * 10**9, relative=True)
    assert told.stop == TimeBound(3600 * 10**9, relative=False)
    assert told.reorder_window_ns == 100_000_000
    assert told.init_poses == (replay.InitPose("b", 1.0, 2.5, 0.5),)
    assert told.merge == MergeConfig(method="paper", scale="free", verify=VerifyConfig(min_confidence=0.99))
    assert told.max_memory_bytes == 2 << 30


def test_what_is_not_said_is_as_on_the_command_line() -> None:
    assert options() == RunOptions((RunPath(None, Path("run.mcap")),), images="none")
    assert options(topics="/{robot}/slam").topics == (TopicChoice(None, "/{robot}/slam"),)
    assert options(start="60", stop=datetime(2026, 1, 1, tzinfo=UTC)).start == TimeBound(60 * 10**9, relative=True)
    config = MergeConfig(verify=VerifyConfig(min_overlap_m2=3.0))
    kept = options(config=config, min_confidence=0.5).merge.verify
    assert (kept.min_overlap_m2, kept.min_confidence) == (3.0, 0.5)


def test_keywords_are_called_as_settings() -> None:
    keywords = set(inspect.signature(replay.merge).parameters) | set(
        inspect.signature(replay.MergeRun.write).parameters
    )
    names = {key.rpartition(".")[2] for key in keys.all_settings()}
    of_python_alone = {"config", "self", "rrd", "force"}
    assert keywords - names == of_python_alone


@pytest.mark.parametrize(
    ("told", "said"),
    [
        ({"robots": "r1,r2"}, "robots is 'r1,r2'; expected a list of names"),
        ({"robots": ["a", "a"]}, "each once"),
        ({"clock": "sun"}, "clock is 'sun'; expected one of header, log"),
        ({"images": "some"}, "images is 'some'"),
        ({"method": "guess"}, "method is 'guess'; expected one of correlation"),
        ({"start": -1.0}, "no number of seconds"),
        ({"start": float("nan")}, "no number of seconds"),
        ({"stop": "noon"}, "is no time"),
        ({"init_poses": {"r2": (1, 2)}}, "init_poses of r2 has 2 numbers; expected x_m, y_m and yaw_rad"),
        ({"min_confidence": 2.0}, "min_confidence is 2.0"),
        ({"min_confidence": 0}, "min_confidence is 0.0; expected a number more than 0, at most 1"),
        ({"start": "1" * 5000 + "ns"}, "start: '1111.*… is no time; expected seconds"),
        ({"max_memory": "much"}, "max_memory: 'much' is no size"),
        ({"max_memory": -5}, "max_memory is -5; expected a number of bytes"),
        ({"max_memory": 0}, "max_memory: '0' is less than 1 MiB"),
        ({"max_memory": True}, "max_memory is True"),
        ({"jobs": 0}, "jobs is 0; expected a number of threads, 1 to 999"),
        ({"jobs": -1}, "jobs is -1"),
        ({"jobs": 1.5}, "jobs is 1.5"),
        ({"jobs": True}, "jobs is True"),
        ({"start": True}, "start is True, which is no number of seconds"),
        ({"start": [1]}, r"start is \[1\]"),
        ({"stop": "noon"}, "stop: 'noon' is no time"),
        ({"stop": 10**5000}, "stop is a number of too many digits"),
        ({"reorder_window_s": "abc"}, "reorder_window_s is 'abc'"),
        ({"reorder_window_s": float("inf")}, "reorder_window_s is inf"),
        ({"init_poses": {"r2": (1, 2, "a")}}, "init_poses of r2 has 'a' in it; expected numbers"),
        ({"init_poses": {"r2": (1, 2, float("nan"))}}, "init_poses of r2 has nan in it"),
        ({"init_poses": {"r2": (10**400, 2, 0)}}, "init_poses of r2 has a number that is too large"),
        ({"init_poses": {"r2": (1, 2, 90)}}, "init_poses: r2=1.0,2.0,90.0: a yaw of 90 rad"),
        ({"init_poses": {"r2": 5}}, "init_poses of r2 is 5; expected x_m, y_m and yaw_rad"),
        ({"init_poses": {"r2": "1,2,3"}}, "init_poses of r2 is '1,2,3'"),
        ({"init_poses": {2: (1, 2, 3)}}, "init_poses is 2"),
        ({"init_poses": ["r2"]}, "init_poses is 'r2'; expected InitPose values"),
        ({"init_poses": 5}, "init_poses is 5"),
        ({"topics": [5]}, "topics is 5; expected text"),
        ({"topics": ["r1="]}, "topics: r1=: expected a topic"),
        ({"topics": {"r1": ""}}, "topics is ''"),
        ({"topics": 5}, "topics is 5; expected a topic, several"),
        ({"robots": [1]}, r"robots is \[1\]; expected a list of names"),
        ({"robots": 1}, "robots is 1; expected a list of names"),
        ({"robots": []}, r"robots is \[\]; expected a list of names"),
        ({"images": ""}, "images is ''"),
        ({"trajectories": ["all"]}, "trajectories is"),
        ({"method": 5}, "method is 5"),
        ({"min_confidence": "high"}, "min_confidence is 'high'; expected a number"),
        ({"config": {"method": "paper"}}, "config is .*; expected a MergeConfig"),
        ({"strict": "no"}, "strict is 'no'; expected True or False"),
        ({"use_tf": 1}, "use_tf is 1"),
        ({"robot": ["r1"]}, "^merge has no keyword robot; did you mean robots\\?$"),
        ({"init_pose": {}}, "^merge has no keyword init_pose; did you mean init_poses\\?$"),
        (
            {"min_overlap_m2": 3},
            "no keyword min_overlap_m2; it is config.verify.min_overlap_m2, of a",
        ),
        ({"x" * 9999: 3}, "^merge has no keyword x{99}…; expected runs, robots, topics, "),
    ],
)
def test_what_does_not_fit_is_refused_at_once(told: dict[str, object], said: str) -> None:
    with pytest.raises(replay.ReplayError, match=said):
        options(**told)


@pytest.mark.parametrize("runs", [5, [5], b"a.mcap", [b"a.mcap"], {1: "a.mcap"}, {"": "a.mcap"}, {"r1": None}])
def test_what_is_no_recording_is_refused(runs: object) -> None:
    with pytest.raises(replay.UsageError, match="runs is "):
        replay.merge(runs)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("told", "said"),
    [
        ({"output": 5}, "output is 5; expected a path"),
        ({"report": 5}, "report is 5; expected a path"),
        ({"every_s": "1"}, "every_s is '1'"),
        ({"every_s": -1}, "every_s is -1"),
        ({"rrd": "no"}, "rrd is 'no'; expected True or False"),
        ({"force": None}, "force is None"),
        ({"copy_map": True}, "^write has no keyword copy_map; did you mean copy_maps\\?$"),
    ],
)
def test_what_cannot_be_written_is_refused(tmp_path: Path, told: dict[str, object], said: str) -> None:
    with pytest.raises(replay.UsageError, match=said):
        replay.merge(SAMPLE).write(**{"output": tmp_path / "out.mcap", **told})  # type: ignore[arg-type]
    assert list(tmp_path.iterdir()) == []


def test_numbers_may_be_those_of_numpy() -> None:
    poses = {"r2": np.array([1.0, 2.0, 0.5])}
    told = options(start=np.float32(0.5), jobs=np.int64(2), max_memory=np.int64(1 << 30), init_poses=poses)
    assert (told.start, told.jobs) == (TimeBound(500_000_000, relative=True), 2)
    assert told.max_memory_bytes == 1 << 30
    assert told.init_poses == (replay.InitPose("r2", 1.0, 2.0, 0.5),)


def test_threads_of_opencv_are_as_before_a_run(tmp_path: Path) -> None:
    before = cv2.getNumThreads()
    try:
        cv2.setNumThreads(2)
        replay.merge(SAMPLE, stop=20).write(tmp_path / "b.mcap", rrd=False)
        assert cv2.getNumThreads() == 2
    finally:
        cv2.setNumThreads(before)


def test_without_a_recording_there_is_no_run() -> None:
    for runs in ([], {}):
        with pytest.raises(replay.UsageError, match="no recording was given"):
            replay.merge(runs)


@pytest.mark.parametrize("content", [None, b"{", b"\xff", b"[]", b""])
def test_reports_that_are_none(tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "x.json"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(replay.InputError, match=r"x\.json: "):
        replay.read_report(path)


def test_all_that_is_offered_is_there() -> None:
    assert [getattr(replay, name).__name__ for name in replay.__all__] == replay.__all__
    assert set(replay.__all__) <= set(dir(replay))
    with pytest.raises(AttributeError, match="nothing"):
        _ = replay.nothing
