"""Where robots are believed to be: poses that are given, transforms that are recorded, and what is said of them."""

from __future__ import annotations

import math
import sqlite3
import sys
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from mapmerge.config import MergeConfig
from mapmerge.match import MATCHERS, Match, Matcher, Rival, load_matcher
from mapmerge.prior import Prior
from mapmerge.reasons import Reason, ReasonCode
from mapmerge.sim2 import Sim2
from replay.beliefs import TF_SIGMA_M, TF_SIGMA_YAW_RAD
from replay.init_pose import DEFAULT_SIGMA_M, DEFAULT_SIGMA_YAW_RAD, InitPose
from replay.options import RunOptions
from replay.pipeline import merge
from replay.runs import RunPath
from replay.sources.losses import MOST_PLACES, OTHER_PLACES
from tests import bags
from tests.bags import Recorded, write_bare_db3, write_mcap, write_rosbag1, write_rosbag2
from tests.outputs import reports
from tests.program import Program
from tests.runs import at, growing, in_log_order, is_right, link, linked, reference_from, seen, two_robots

TRUE = reference_from("r2")


class RecordingMatcher(Matcher[Any]):
    """Matches as the default does without priors, and keeps the priors and settings that it is given."""

    name = "recording"

    def __init__(self) -> None:
        self._matcher = load_matcher("correlation")
        self.priors: list[Prior | None] = []
        self.config: MergeConfig | None = None
        self.confidence: float | None = None

    def prepare(self, *arguments: Any) -> Any:
        return self._matcher.prepare(*arguments)

    def match(self, target: Any, source: Any, config: MergeConfig, prior: Prior | None = None) -> Match:
        self.priors.append(prior)
        self.config = config
        found = self._matcher.match(target, source, config)
        return Match(found.target_from_source, found.scores, found.accepted, found.reason, self.confidence)


@pytest.fixture
def matcher(monkeypatch: pytest.MonkeyPatch) -> RecordingMatcher:
    found = RecordingMatcher()
    monkeypatch.setitem(sys.modules, "recording_matcher", SimpleNamespace(Recording=lambda: found))
    monkeypatch.setitem(MATCHERS, "recording", "recording_matcher:Recording")
    return found


@pytest.fixture
def merged(replay: Program, matcher: RecordingMatcher) -> Callable[..., Any]:
    return lambda *arguments: replay.merge(*arguments, "--method", matcher.name)


def robots(*, frames: tuple[str, str] = ("r1/map", "r2/map")) -> list[Recorded]:
    """Return two robots' last maps, in frames of their own."""
    return [seen("r1", 1.0, frame=frames[0]), seen("r2", 2.0, frame=frames[1])]


def near(prior: Prior | None, pose: Sim2) -> bool:
    assert prior is not None
    return prior.target_from_source.is_close(pose, distance_m=1e-6, angle_rad=1e-6, at_m=(1.0, 1.0))


class TestInitPose:
    def test_as_far_away_as_a_place_may_be(self, replay: Program, two: Path) -> None:
        ran = replay.merge(two, "--init-pose", "r2=1e8,-1e8,0", images="all")
        assert ran.statuses == {"r1": "reference", "r2": "unmerged"}
        assert ran.robots["r2"]["reason"]["code"] == "prior_contradicted"

    def test_is_given_to_the_matcher_and_reported(
        self, merged: Callable[..., Any], matcher: RecordingMatcher, two: Path
    ) -> None:
        ran = merged(two, "--init-pose", "r2 = 1.5, -2, 90deg ± 0.5, ± 0.6, ± 5")
        expected = Prior(Sim2(1.5, -2.0, math.pi / 2), 0.5, 0.6, math.radians(5.0), "given for r2")
        assert set(matcher.priors) == {expected}
        told = ran.robots["r2"]["prior"]
        assert told == {
            "pose": {"x_m": 1.5, "y_m": -2.0, "yaw_rad": 1.570796327, "scale": 1.0},
            "sigma": {"x_m": 0.5, "y_m": 0.6, "yaw_rad": 0.087266},
            "origin": "given for r2",
        }
        assert ran.robots["r1"]["prior"] is None
        assert ran.report["pairs"][0]["prior"] == told
        assert [report["robots"]["r2"]["prior"] for _, report in reports(ran.mcap)] == [told] * 6
        assert ran.report["settings"]["init_poses"][0]["robot"] == "r2"
        assert ran.report["notes"] == []

    def test_its_spread_has_a_default(self, merged: Callable[..., Any], matcher: RecordingMatcher, two: Path) -> None:
        merged(two, "--init-pose", "r2=1,2,0.5")
        prior = matcher.priors[0]
        assert prior is not None
        sigmas = (prior.sigma_x_m, prior.sigma_y_m, prior.sigma_yaw_rad)
        assert sigmas == (DEFAULT_SIGMA_M, DEFAULT_SIGMA_M, DEFAULT_SIGMA_YAW_RAD)

    def test_of_several_robots(self, merged: Callable[..., Any], matcher: RecordingMatcher, tmp_path: Path) -> None:
        run = write_mcap(tmp_path / "run.mcap", [seen("r1", 1.0), seen("r2", 1.0), seen("r3", 1.0)])
        merged(run, "--init-pose", "r3=1,2,0", "--init-pose", "r2=1,2,0")
        assert near(matcher.priors[0], Sim2(1.0, 2.0))
        assert near(matcher.priors[2], Sim2())

    @pytest.mark.parametrize(
        ("poses", "expected"),
        [
            (["r2=1,2"], "--init-pose r2=1,2: expected R=X,Y,YAW[±SX,±SY,±SYAW]"),
            (["r2=1,2,90"], "if it is in degrees, give 90.0deg"),
            (
                ["r2=1e300,0,0"],
                "--init-pose r2=1e+300,0.0,0.0: its shift is (1e+300, 0.0); at most 1e+08 m",
            ),
            (["r2=0,-1.1e8,0"], "its shift is (0.0, -110000000.0); at most 1e+08 m were expected"),
            (["r9=1,2,0"], "--init-pose r9: no such robot is merged; there are: r2"),
            (["r1=1,2,0"], "--init-pose r1: r1 is the reference"),
            (["r2=1,2,0", "r2=1,2,0"], "--init-pose r2: given twice"),
            (["r2=1,2,0±0,±1,±1"], "expected standard deviations that are more than 0"),
        ],
    )
    def test_that_is_none(self, replay: Program, two: Path, poses: list[str], expected: str) -> None:
        ran = replay.merge(two, *(part for pose in poses for part in ("--init-pose", pose)))
        assert ran.status == 2
        assert expected.replace("90.0deg", "90deg") in ran.error
        assert not list(replay.folder.iterdir())

    def test_of_one_robot_alone(self, replay: Program, two: Path) -> None:
        ran = replay.merge(two, "--robots", "r2", "--init-pose", "r1=1,2,0")
        assert "there are: none but the reference r2" in ran.error


RECORDED = in_log_order(
    robots(), [linked(0.5, link("world", "/r1/map"), link("/world", "r2/map", TRUE), static=True), linked(0.6)]
)
FORMATS: dict[str, Callable[[Path], Path]] = {
    "rosbag1": lambda folder: write_rosbag1(folder / "run.bag", RECORDED),
    "rosbag2-sqlite3": lambda folder: write_rosbag2(folder / "run", RECORDED),
    "rosbag2-message": lambda folder: write_rosbag2(folder / "run", RECORDED, compression="message"),
    "rosbag2-mcap": lambda folder: write_rosbag2(folder / "run", RECORDED, "mcap"),
    "rosbag2-split": lambda folder: bags.write_split_rosbag2(folder / "run", RECORDED),
    "db3": lambda folder: bags.write_bare_db3(folder / "run.db3", RECORDED),
    "mcap": lambda folder: write_mcap(folder / "run.mcap", RECORDED),
    "mcap-no-summary": lambda folder: write_mcap(folder / "run.mcap", RECORDED, **bags.NO_SUMMARY),
    "mcap-ros1-before-tf2": lambda folder: write_mcap(
        folder / "run.mcap",
        [
            Recorded(each.topic, each.msgtype.replace("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage"), *_rest(each))
            for each in RECORDED
        ],
        "ros1",
    ),
}


def _rest(recorded: Recorded) -> tuple[int, dict[str, Any]]:
    return recorded.log_time_ns, recorded.fields


class TestUseTf:
    @pytest.mark.parametrize("name", FORMATS)
    def test_of_every_format(
        self, merged: Callable[..., Any], matcher: RecordingMatcher, tmp_path: Path, name: str
    ) -> None:
        (tmp_path / "in").mkdir()
        ran = merged(FORMATS[name](tmp_path / "in"), "--use-tf")
        (prior,) = matcher.priors
        assert near(prior, TRUE)
        assert prior is not None
        assert (prior.sigma_x_m, prior.sigma_y_m, prior.sigma_yaw_rad) == (TF_SIGMA_M, TF_SIGMA_M, TF_SIGMA_YAW_RAD)
        assert ran.robots["r2"]["prior"]["origin"] == "recorded in /tf"
        assert is_right(ran.robots["r2"]["prior"]["pose"], TRUE)
        assert (ran.report["notes"], ran.report["skipped"]) == ([], {})
        (found,) = ran.report["inputs"]
        assert {topic: read["messages"] for topic, read in found["transforms"].items()} == {"/tf": 1, "/tf_static": 1}
        assert found["messages"] == 2
        assert ran.report["settings"]["use_tf"] is True

    def test_is_not_read_unless_asked_for(
        self, merged: Callable[..., Any], matcher: RecordingMatcher, tmp_path: Path
    ) -> None:
        ran = merged(write_mcap(tmp_path / "run.mcap", RECORDED))
        assert matcher.priors == [None]
        assert ran.report["inputs"][0]["transforms"] == {}

    def test_moves_no_tick(self, replay: Program, tmp_path: Path) -> None:
        moving = [linked(each / 3, link("a", "b"), stamp_ns=at(each * 7.0)) for each in range(60)]
        run = write_mcap(tmp_path / "run.mcap", in_log_order(two_robots(), moving))
        times = [[time_ns for time_ns, _ in reports(replay.merge(run, *flags).mcap)] for flags in ((), ("--use-tf",))]
        assert times[0] == times[1]

    def test_the_latest_at_each_tick(
        self, merged: Callable[..., Any], matcher: RecordingMatcher, tmp_path: Path
    ) -> None:
        """Nothing is known at first; then a map frame is corrected again and again, as SLAM does."""
        moving = [
            linked(5.0, link("r1/map", "r2/map", Sim2(1.0))),
            linked(11.0, link("r1/map", "r2/map", Sim2(2.0))),
            linked(13.0, link("r1/map", "r2/map", Sim2(2.001))),
            linked(30.0, link("r1/map", "r2/map", Sim2(9.0))),
        ]
        maps = in_log_order(growing("r1", frame="r1/map"), growing("r2", 2.0, frame="r2/map"))
        ran = merged(write_mcap(tmp_path / "run.mcap", in_log_order(maps, moving)), "--use-tf")
        found = [each.target_from_source.x_m if each else None for each in matcher.priors]
        assert found == pytest.approx([None, 1.0, 2.0, 2.0, 2.0])
        assert [
            report["robots"]["r2"]["prior"] and report["robots"]["r2"]["prior"]["pose"]["x_m"]
            for _, report in reports(ran.mcap)
        ] == [None, None, 1.0, 2.0, 2.001, 2.001]

    def test_on_another_clock(self, merged: Callable[..., Any], matcher: RecordingMatcher, tmp_path: Path) -> None:
        """The second recording's clock is simulated time, and its transforms go along with its maps.

        Its last map says nothing new: only because it is the last one, what is believed by then is tried as well.
        """
        simulated = [
            seen("r2", seconds, stamp_ns=round(seconds * 1e9), frame="r2/map", topic="/map") for seconds in (1.0, 9.0)
        ]
        moving = [
            linked(seconds, link("r1/map", "r2/map", Sim2(seconds)), stamp_ns=round(seconds * 1e9))
            for seconds in (0.5, 5.0, 12.0)
        ]
        a = write_mcap(tmp_path / "a.mcap", [seen("r1", 100.0, frame="r1/map", topic="/map")])
        b = write_rosbag1(tmp_path / "b.bag", in_log_order(simulated, moving))
        ran = merged(f"a={a}", f"b={b}", "--align-starts", "--use-tf")
        assert [each.target_from_source.x_m if each else None for each in matcher.priors] == pytest.approx([0.5, 5.0])
        assert ran.robots["b"]["prior"]["pose"]["x_m"] == pytest.approx(5.0)

    def test_of_a_recording_without_maps(
        self, merged: Callable[..., Any], matcher: RecordingMatcher, tmp_path: Path
    ) -> None:
        maps = write_mcap(tmp_path / "maps.mcap", robots())
        placed = write_rosbag1(tmp_path / "tf.bag", [linked(1.5, link("r1/map", "r2/map", TRUE))])
        ran = merged(maps, placed, "--use-tf")
        assert near(matcher.priors[0], TRUE)
        read = [
            {topic: each["messages"] for topic, each in item["transforms"].items()} for item in ran.report["inputs"]
        ]
        assert read == [{}, {"/tf": 1}]

    def test_a_given_pose_wins(self, merged: Callable[..., Any], matcher: RecordingMatcher, tmp_path: Path) -> None:
        merged(write_mcap(tmp_path / "run.mcap", RECORDED), "--use-tf", "--init-pose", "r2=1,2,0")
        assert near(matcher.priors[0], Sim2(1.0, 2.0))


class TestWhatIsSaid:
    @pytest.mark.parametrize(
        ("messages", "expected"),
        [
            (robots(), "there is no /tf and no /tf_static in the recordings; no prior is used for it"),
            ([*robots(frames=("/map", "map")), linked(3.0, link("w", "map"))], "have the same frame, 'map'"),
            ([*robots(), linked(3.0, link("w", "r2/map"))], "links its map frame 'r2/map' with 'r1/map'"),
            (
                [linked(0.0, link("r1/map", "r2/map", roll_rad=0.5), static=True), *robots()],
                "from its map frame 'r2/map' to 'r1/map' is tilted by 29°",
            ),
        ],
    )
    def test_where_no_transform_serves(
        self, replay: Program, tmp_path: Path, messages: list[Recorded], expected: str
    ) -> None:
        ran = replay.merge(write_mcap(tmp_path / "run.mcap", messages), "--use-tf")
        (note,) = ran.report["notes"]
        assert note["robot"] == "r2"
        assert expected in note["message"]
        (line,) = [line for line in ran.err.splitlines() if note["message"] in line]
        assert line.startswith("r2: ")
        assert ran.statuses["r2"] == "merged"
        assert ran.robots["r2"]["prior"] is None

    def test_transforms_that_are_none(self, replay: Program, tmp_path: Path) -> None:
        none = linked(0.5, link("w", "r1/map", shift=(math.nan, 0.0, 0.0)), link("r1/map", "r2/map", TRUE))
        run = write_mcap(tmp_path / "run.mcap", in_log_order([none], robots()))
        ran = replay.merge(run, "--use-tf")
        assert ran.report["skipped"] == {"bad_transform": 1}
        assert "skipped a message (run.mcap, /tf at " in ran.err
        assert "the transform from 'r1/map' to 'w' is none: finite numbers were expected" in ran.err
        assert is_right(ran.robots["r2"]["prior"]["pose"], TRUE)
        strict = replay.merge(run, "--use-tf", "--strict")
        assert strict.status == 2
        assert strict.err.splitlines()[-1].startswith("replay: error: run.mcap: /tf at 2023-11-14 22:1")
        assert replay.merge(run, "--strict").status == 0

    def test_transforms_that_are_all_damaged_are_added_up(self, replay: Program, tmp_path: Path) -> None:
        moving = [linked(0.01 * number, link("r1/map", "r2/map", TRUE)) for number in range(100)]
        run = write_bare_db3(tmp_path / "run.db3", in_log_order(moving, robots()))
        with closing(sqlite3.connect(run)) as database:
            cut = bytes.fromhex("28b52ffd00")
            database.execute(
                "UPDATE messages SET data = ? WHERE topic_id IN (SELECT id FROM topics WHERE name = '/tf')", [cut]
            )
            database.commit()
        ran = replay.merge(run, "--use-tf")
        assert ran.report["skipped"] == {"damaged": 100}
        rows = [(each["topic"], each["messages"]) for each in ran.report["skipped_at"]]
        assert rows == [*[("/tf", 1)] * MOST_PLACES, ("/tf", 100 - MOST_PLACES)]
        assert ran.report["skipped_at"][-1]["place"] == OTHER_PLACES


class TestContradicted:
    def test_both_places_are_reported(
        self, merged: Callable[..., Any], matcher: RecordingMatcher, two: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        match = matcher.match

        def contradicted(target: Any, source: Any, config: MergeConfig, prior: Prior | None = None) -> Match:
            found = match(target, source, config, prior)
            if found.target_from_source is None or found.scores is None or prior is None:
                return found
            reason = Reason(ReasonCode.PRIOR_CONTRADICTED, "the maps fit at x 9.72 m, not where it was given for r2")
            rivals = (Rival(found.target_from_source, found.scores.score_m),)
            return Match(prior.target_from_source, found.scores, accepted=False, reason=reason, rivals=rivals)

        monkeypatch.setattr(matcher, "match", contradicted)
        ran = merged(two, "--init-pose", "r2=-30,-30,0")
        found = ran.robots["r2"]
        assert (found["status"], found["reason"]["code"]) == ("unmerged", "prior_contradicted")
        (pair,) = ran.report["pairs"]
        assert pair["a_from_b"] == pair["prior"]["pose"]
        assert is_right(pair["rivals"][0]["a_from_b"], TRUE)
        assert "the maps fit at x 9.72 m" in ran.out


class TestOtherSettings:
    def test_reach_the_matcher(self, merged: Callable[..., Any], matcher: RecordingMatcher, two: Path) -> None:
        ran = merged(two, "--scale", "free", "--min-confidence", "0.95")
        assert matcher.config is not None
        assert (matcher.config.scale, matcher.config.verify.min_confidence) == ("free", 0.95)
        settings = ran.report["settings"]["merge"]
        assert (settings["method"], settings["scale"], settings["verify"]["min_confidence"]) == (
            "recording",
            "free",
            0.95,
        )

    def test_have_the_library_s_defaults(
        self, merged: Callable[..., Any], matcher: RecordingMatcher, two: Path
    ) -> None:
        merged(two)
        assert matcher.config == MergeConfig(method="recording")

    @pytest.mark.parametrize("value", ["0", "1", "-0.5", "99.9", "nan", "sure", ""])
    def test_no_probability(self, replay: Program, two: Path, value: str) -> None:
        ran = replay.merge(two, "--min-confidence", value)
        assert ran.status == 2
        assert f"--min-confidence {value}: expected a probability above 0 and below 1, such as 0.99" in ran.error

    @pytest.mark.parametrize(
        ("value", "flags", "most"), [("0.99999", [], 0.9999), ("0.999", ["--scale", "free"], 0.9986)]
    )
    def test_a_probability_that_no_placement_is_given(
        self, replay: Program, two: Path, value: str, flags: list[str], most: float
    ) -> None:
        ran = replay.merge(two, "--min-confidence", value, *flags)
        assert ran.status == 2
        assert f"--min-confidence {value}: " in ran.error
        assert f"expected at most {most}" in ran.error

    def test_no_method(self, replay: Program, two: Path) -> None:
        ran = replay.merge(two, "--method", "magic")
        assert ran.status == 2
        assert ran.error.startswith("--method: 'magic' is none of correlation, ")
        assert replay.merge(two, "--method", "papre").error.endswith("; did you mean paper?")
        for name in MATCHERS:
            assert name in ran.error

    def test_help_names_every_method(self, replay: Program) -> None:
        assert all(name in replay("merge", "--help").out for name in MATCHERS)

    def test_no_scale(self, replay: Program, two: Path) -> None:
        ran = replay.merge(two, "--scale", "huge")
        assert ran.status == 2
        assert "--scale" in ran.err


class TestConfidence:
    def test_is_in_the_report_and_the_table(
        self, merged: Callable[..., Any], matcher: RecordingMatcher, two: Path
    ) -> None:
        matcher.confidence = 0.99978
        ran = merged(two)
        assert [robot["confidence"] for robot in ran.robots.values()] == [None, 0.99978]
        assert ran.report["pairs"][0]["confidence"] == 0.99978
        head, first, second = ran.out.splitlines()
        assert "confidence" in head
        assert "99.97%" in second
        assert "99.97" not in first

    def test_has_a_dash_where_it_is_not_known(self, merged: Callable[..., Any], two: Path) -> None:
        ran = merged(two)
        assert ran.robots["r2"]["confidence"] is None
        header, _, row = ran.out.splitlines()
        assert row[header.index("confidence") : header.index("reason")].strip() == "–"


def test_from_python(matcher: RecordingMatcher, tmp_path: Path) -> None:
    run = write_mcap(tmp_path / "run.mcap", RECORDED)
    options = RunOptions(
        (RunPath(None, run),), init_poses=(InitPose("r2", 1.0, 2.0, 0.5),), merge=MergeConfig(method="recording")
    )
    assert list(merge(options))
    assert near(matcher.priors[0], Sim2(1.0, 2.0, 0.5))
