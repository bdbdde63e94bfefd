from __future__ import annotations

from pathlib import Path

import pytest

from replay.errors import InputError, UsageError
from replay.runs import RunPath, TopicChoice
from replay.selection import Selected, select
from replay.skip_cause import SkipCause
from replay.sources.base import UPDATE_TYPE, SourceInfo
from replay.sources.losses import Loss
from tests.fakes import info_of

RUN = RunPath(None, Path("run.mcap"))


def topics(*infos: SourceInfo, runs: tuple[RunPath, ...] = (), choices: tuple[str, ...] = (), **options) -> dict:
    """Return the topic of each robot that is selected."""
    parsed = [TopicChoice.parse(text) for text in choices]
    found = select(runs or (RUN,) * len(infos), infos, topics=parsed, **options)
    return {item.robot: item.topic for item in found}


class TestRunPath:
    @pytest.mark.parametrize(
        ("text", "robot", "path"),
        [
            ("run.mcap", None, "run.mcap"),
            ("r1=run.mcap", "r1", "run.mcap"),
            ("r-1.a_b=/x/y=z.mcap", "r-1.a_b", "/x/y=z.mcap"),
            ("/data/a=b.mcap", None, "/data/a=b.mcap"),
            ("=run.mcap", None, "=run.mcap"),
            ("r1=", None, "r1="),
            ("a b=run.mcap", None, "a b=run.mcap"),
        ],
    )
    def test_parse(self, text: str, robot: str | None, path: str) -> None:
        assert RunPath.parse(text) == RunPath(robot, Path(path))

    def test_what_exists_is_a_path(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(tmp_path)
        (tmp_path / "speed=2.mcap").touch()
        assert RunPath.parse("speed=2.mcap").robot is None


def test_topic_choice() -> None:
    assert TopicChoice.parse("/{robot}/map") == TopicChoice(None, "/{robot}/map")
    assert TopicChoice.parse("r1=/x") == TopicChoice("r1", "/x")


@pytest.mark.parametrize(
    ("there", "expected"),
    [
        (("/r2/map", "/r1/map"), {"r1": "/r1/map", "r2": "/r2/map"}),
        (("/map",), {"run": "/map"}),
        (("/r1/map", "/map"), {"r1": "/r1/map"}),
        (("/fleet/r1/map", "/fleet/r2/map"), {"r1": "/fleet/r1/map", "r2": "/fleet/r2/map"}),
        (("/r1/slam/map", "/r2/slam/map"), {"r1": "/r1/slam/map", "r2": "/r2/slam/map"}),
        (("/r1/map", "/r1/slam/map"), {"r1": "/r1/map"}),
        (("/r1/grid", "/r1/slam/map"), {"r1": "/r1/slam/map"}),
        (("/r1/map", "/r1/global_costmap/costmap", "/r1/keepout_mask"), {"r1": "/r1/map"}),
        (("/r1/map", "/r2/local_costmap/costmap"), {"r1": "/r1/map"}),
        (("/costmap",), {"run": "/costmap"}),
        (("/r1/costmap", "/r2/costmap"), {"r1": "/r1/costmap", "r2": "/r2/costmap"}),
        (("/map", "/global_costmap/costmap"), {"run": "/map"}),
    ],
)
def test_robots_are_found_by_namespace(there: tuple[str, ...], expected: dict[str, str]) -> None:
    found = topics(info_of(*there))
    assert found == expected
    assert list(found) == sorted(found)


def test_robots_asked_for_come_in_their_order() -> None:
    found = topics(info_of("/r1/map", "/r2/map", "/r3/map"), robots=["r3", "r1"])
    assert list(found.items()) == [("r3", "/r3/map"), ("r1", "/r1/map")]


def test_a_robot_may_be_named_by_any_part_of_the_namespace() -> None:
    there = info_of("/site/r1/slam/map", "/site/r2/slam/map")
    assert topics(there, robots=["r2", "r1"]) == {"r2": "/site/r2/slam/map", "r1": "/site/r1/slam/map"}


def test_any_map_in_a_robot_s_own_recording_is_its_own() -> None:
    runs = (RunPath("b", Path("b.bag")), RunPath("a", Path("a.bag")))
    found = topics(info_of("/whatever/grid"), info_of("/r7/map", "/costmap"), runs=runs)
    assert list(found.items()) == [("b", "/whatever/grid"), ("a", "/r7/map")]


def test_one_robot_in_several_recordings() -> None:
    (found,) = select((RUN, RUN), [info_of("/r1/map"), info_of("/r1/map")])
    assert found == Selected("r1", "/r1/map", (0, 1))
    assert found.topics == ("/r1/map", "/r1/map_updates")


class TestTopicsSaidOutright:
    THERE = info_of("/r1/map", "/r1/slam/map", "/r2/map", "/r2/slam/map", "/odd")

    def test_for_all(self) -> None:
        assert topics(self.THERE, choices=("/{robot}/slam/map",)) == {"r1": "/r1/slam/map", "r2": "/r2/slam/map"}

    def test_for_one(self) -> None:
        found = topics(self.THERE, choices=("r1=/r1/slam/map",))
        assert found == {"r1": "/r1/slam/map", "r2": "/r2/map"}

    def test_for_a_robot_that_no_namespace_names(self) -> None:
        assert topics(self.THERE, choices=("x=/odd",), robots=["x", "r1"]) == {"x": "/odd", "r1": "/r1/map"}

    def test_one_for_all_and_another_for_one(self) -> None:
        found = topics(self.THERE, choices=("/{robot}/slam/map", "r2=/r2/map"))
        assert found == {"r1": "/r1/slam/map", "r2": "/r2/map"}

    def test_the_name_twice_is_the_same_name(self) -> None:
        there = info_of("/r1/map_r1", "/r1/map_r2", "/r2/map_r2")
        assert topics(there, choices=("/{robot}/map_{robot}",)) == {"r1": "/r1/map_r1", "r2": "/r2/map_r2"}

    def test_characters_that_mean_something_elsewhere(self) -> None:
        assert topics(info_of("/r1.x/map"), choices=("/{robot}.x/map",)) == {"r1": "/r1.x/map"}
        with pytest.raises(UsageError):
            topics(info_of("/r1yx/map"), choices=("/{robot}.x/map",))

    def test_in_a_recording_of_one_robot(self) -> None:
        runs = (RunPath("a", Path("a.bag")), RunPath("b", Path("b.bag")))
        infos = (info_of("/map", "/old/map"), info_of("/map", "/old/map"))
        assert topics(*infos, runs=runs, choices=("/old/map",)) == {"a": "/old/map", "b": "/old/map"}
        assert topics(*infos, runs=runs, choices=("a=/map", "b=/old/map")) == {"a": "/map", "b": "/old/map"}


class TestRefusals:
    def test_no_map(self) -> None:
        with pytest.raises(InputError, match=r"run.mcap: no map, only std_msgs/msg/String; expected a topic of type"):
            topics(info_of("/chatter", msgtype="std_msgs/msg/String"))

    def test_types_that_are_no_names(self) -> None:
        """What is in place of them may be a whole definition, if the pages of a database are mixed up."""
        with pytest.raises(InputError) as refused:
            topics(info_of("/chatter", msgtype="int32 sec\nuint32 nanosec\n" * 50))
        assert str(refused.value).startswith(r"run.mcap: no map, only int32 sec\nuint32 nanosec\n")
        assert "…; expected a topic of type" in str(refused.value)
        assert len(str(refused.value)) < 300

    def test_no_map_is_left(self) -> None:
        found = (
            Loss(SkipCause.DAMAGED, "the index", "messages were found without it", 0),
            Loss(SkipCause.WRONG_CHECKSUM, "the chunk at byte 12", "its checksum is wrong", 3),
            Loss(SkipCause.DAMAGED, "byte 99", "no record", 1),
            Loss(SkipCause.WRONG_CHECKSUM, "the chunk at byte 50", "its checksum is wrong"),
        )
        with pytest.raises(InputError) as caught:
            topics(info_of(), info_of(), losses=[(), found])
        assert str(caught.value).endswith(
            "such as /r1/map; lost are at least 4 messages (wrong_checksum), 1 message (damaged), first run.mcap, "
            "the chunk at byte 12: its checksum is wrong"
        )

    def test_what_is_damaged_and_cost_nothing_is_not_why(self) -> None:
        with pytest.raises(InputError) as caught:
            topics(info_of(), losses=[(Loss(SkipCause.DAMAGED, "the index", "messages were found without it", 0),)])
        assert str(caught.value).endswith("such as /r1/map")

    def test_no_message(self) -> None:
        with pytest.raises(InputError):
            topics(info_of())

    def test_updates_only(self) -> None:
        with pytest.raises(InputError, match="only updates of parts of maps"):
            topics(info_of("/r1/map_updates", msgtype=UPDATE_TYPE))

    def test_robots_that_are_there_are_named(self) -> None:
        with pytest.raises(UsageError) as caught:
            topics(info_of("/r1/map", "/r2/map"), robots=["r9"])
        assert "there are r1 (/r1/map), r2 (/r2/map); to say whose map is whose: --topic r9=" in str(caught.value)

    @pytest.mark.parametrize("options", [{"choices": ("/{robot}/no",)}, {"choices": ("r1=/no",)}])
    def test_what_is_there_is_listed_as_flags(self, options: dict) -> None:
        with pytest.raises(UsageError) as caught:
            topics(info_of("/r1/map", "/r2/map"), **options)
        assert "--topic r1=/r1/map" in str(caught.value)

    def test_ambiguous(self) -> None:
        with pytest.raises(
            UsageError, match=r"2 map topics; choose one of: --topic r1=/r1/a/map  --topic r1=/r1/b/map"
        ):
            topics(info_of("/r1/a/map", "/r1/b/map", "/r2/map"))

    def test_shared(self) -> None:
        with pytest.raises(UsageError, match="would both be fed from /r1/map"):
            topics(info_of("/r1/map"), choices=("a=/r1/map",), robots=["r1", "a"])
