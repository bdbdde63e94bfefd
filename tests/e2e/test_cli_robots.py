"""Which robots are merged, and what is said when that is not clear."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.bags import Recorded, write_bare_db3, write_mcap, write_rosbag1
from tests.outputs import topics
from tests.program import Program
from tests.runs import growing, in_log_order, seen


def flags(text: str) -> list[str]:
    """Return the flags to paste that a message lists."""
    return re.findall(r"--topic (\S+=\S+)", text)


def of_one_robot(robot: str, topic: str = "/map") -> list[Recorded]:
    return growing(robot, topic=topic)


@pytest.fixture
def three(tmp_path: Path) -> Path:
    messages = in_log_order(growing("r1"), growing("r2", 2.0), growing("r3", 4.0))
    return write_mcap(tmp_path / "three.mcap", messages)


class TestChoice:
    def test_a_name_that_is_nearly_right(self, replay: Program, two: Path) -> None:
        assert "there is no map of robot 'R1'; did you mean 'r1'?" in replay.merge(two, "--robots", "R1,r2").error

    def test_a_folder_of_bags(self, replay: Program, tmp_path: Path) -> None:
        one = tmp_path / "bags" / "alpha"
        one.mkdir(parents=True)
        (one / "metadata.yaml").write_text("")
        assert f"but holds some; give these, such as {one}" in replay.merge(one.parent).error

    def test_all_in_order_of_name_and_said(self, replay: Program, two: Path) -> None:
        ran = replay.merge(two)
        assert list(ran.robots) == ["r1", "r2"]
        assert ran.err.splitlines()[0] == "merging r2 (/r2/map) into r1 (/r1/map), the reference"

    def test_those_asked_for_and_not_said(self, replay: Program, three: Path) -> None:
        ran = replay.merge(three, "--robots", "r3, r1")
        assert ran.report["reference"] == "r3"
        assert ran.statuses == {"r3": "reference", "r1": "merged"}
        assert "the reference" not in ran.err

    def test_one_robot_alone(self, replay: Program, two: Path) -> None:
        ran = replay.merge(two, "--robots", "r2")
        assert ran.statuses == {"r2": "reference"}

    def test_a_recording_a_robot_in_the_order_given(self, replay: Program, tmp_path: Path) -> None:
        b = write_rosbag1(tmp_path / "first.bag", of_one_robot("r2"))
        a = write_mcap(tmp_path / "second.mcap", of_one_robot("r1", "/slam/occupancy"))
        ran = replay.merge(f"bravo={b}", f"alpha={a}")
        assert ran.statuses == {"bravo": "reference", "alpha": "merged"}
        assert "merging alpha (/slam/occupancy) into bravo (/map)" in ran.err

    def test_robots_may_be_split_over_recordings(self, replay: Program, tmp_path: Path) -> None:
        one, *rest = of_one_robot("r1")
        parts = [write_mcap(tmp_path / "1.mcap", [one]), write_rosbag1(tmp_path / "2.bag", rest)]
        ran = replay.merge(*(f"r1={part}" for part in parts))
        assert ran.robots["r1"]["updates"] == 3
        assert [item["messages"] for item in ran.report["inputs"]] == [1, 2]

    def test_bags_are_named_by_their_file(self, replay: Program, tmp_path: Path) -> None:
        write_rosbag1(tmp_path / "alpha.bag", of_one_robot("r1"))
        write_mcap(tmp_path / "bravo.mcap", of_one_robot("r2"))
        ran = replay.merge("bravo.mcap", "alpha.bag")
        assert ran.statuses == {"alpha": "reference", "bravo": "merged"}

    def test_costmaps_are_no_maps(self, replay: Program, tmp_path: Path) -> None:
        others = [
            seen("r1", 1.0, topic=f"/r1/{name}")
            for name in ("global_costmap/costmap", "local_costmap/costmap", "keepout_mask", "speed_filter_mask")
        ]
        messages = in_log_order(growing("r1"), growing("r2"), others)
        ran = replay.merge(write_mcap(tmp_path / "run.mcap", messages))
        assert {robot: found["map_topic"] for robot, found in ran.robots.items()} == {
            "r1": "/r1/map",
            "r2": "/r2/map",
        }


class TestTopic:
    def test_for_all_robots(self, replay: Program, tmp_path: Path) -> None:
        messages = in_log_order(
            *(growing(robot, topic=f"/{robot}/slam/map") for robot in ("r1", "r2")),
            [seen("r1", 1.0, topic="/r1/old/map"), seen("r2", 1.0, topic="/r2/old/map")],
        )
        run = write_mcap(tmp_path / "run.mcap", messages)
        assert flags(replay.merge(run).error) == ["r1=/r1/old/map", "r1=/r1/slam/map"]
        for choice in ((), ("--robots", "r1,r2")):
            ran = replay.merge(run, "--topic", "/{robot}/slam/map", *choice)
            assert ran.statuses == {"r1": "reference", "r2": "merged"}

    @pytest.mark.parametrize("pattern", ["/maps/{robot}", "/fleet/{robot}/grid", "/{robot}_map"])
    @pytest.mark.parametrize("choice", [(), ("--robots", "r1,r2")])
    def test_wherever_the_name_stands(
        self, replay: Program, tmp_path: Path, pattern: str, choice: tuple[str, ...]
    ) -> None:
        messages = in_log_order(*(growing(robot, topic=pattern.replace("{robot}", robot)) for robot in ("r1", "r2")))
        ran = replay.merge(write_mcap(tmp_path / "run.mcap", messages), "--topic", pattern, *choice)
        assert ran.statuses == {"r1": "reference", "r2": "merged"}

    def test_for_one_robot(self, replay: Program, tmp_path: Path) -> None:
        messages = in_log_order(growing("r1"), growing("r2", topic="/odd/place"))
        run = write_mcap(tmp_path / "run.mcap", messages)
        ran = replay.merge(run, "--topic", "r2=/odd/place", "--robots", "r1,r2")
        assert ran.robots["r2"]["map_topic"] == "/odd/place"
        assert ran.statuses["r2"] == "merged"

    def test_a_costmap_if_it_is_asked_for(self, replay: Program, tmp_path: Path) -> None:
        messages = in_log_order(growing("r1"), growing("r1", topic="/r1/costmap"), growing("r2"))
        ran = replay.merge(write_mcap(tmp_path / "run.mcap", messages), "--topic", "r1=/r1/costmap")
        assert ran.robots["r1"]["map_topic"] == "/r1/costmap"

    @pytest.mark.parametrize("pattern", ["/{robot}/nothing", "map", "/nowhere", "r1=/nowhere", "{robot}", "r9="])
    def test_that_is_not_there(self, replay: Program, two: Path, pattern: str) -> None:
        ran = replay.merge(two, "--topic", pattern)
        assert ran.status == 2
        assert "/r1/map" in ran.error


class TestUnclear:
    def test_an_unknown_robot(self, replay: Program, two: Path) -> None:
        ran = replay.merge(two, "--robots", "r1,r9")
        assert ran.status == 2
        assert "'r9'" in ran.error
        assert "there are r1 (/r1/map), r2 (/r2/map)" in ran.error
        (flag,) = flags(ran.error)
        assert replay.merge(two, "--topic", flag, "--robots", "r9,r2").statuses == {"r9": "reference", "r2": "merged"}

    def test_what_is_listed_can_be_pasted(self, replay: Program, two: Path) -> None:
        error = replay.merge(two, "--topic", "/nowhere").error
        pasted = [part for flag in flags(error) for part in ("--topic", flag)]
        assert replay.merge(two, *pasted).statuses == {"r1": "reference", "r2": "merged"}

    def test_an_ambiguous_topic(self, replay: Program, tmp_path: Path) -> None:
        messages = in_log_order(
            growing("r1", topic="/r1/slam/map"), growing("r1", topic="/r1/server/map"), growing("r2")
        )
        run = write_mcap(tmp_path / "run.mcap", messages)
        ran = replay.merge(run)
        assert ran.status == 2
        found = flags(ran.error)
        assert found == ["r1=/r1/server/map", "r1=/r1/slam/map"]
        assert replay.merge(run, "--topic", found[1]).robots["r1"]["map_topic"] == "/r1/slam/map"

    def test_an_ambiguous_recording_of_one_robot(self, replay: Program, two: Path) -> None:
        ran = replay.merge(f"a={two}")
        assert flags(ran.error) == ["a=/r1/map", "a=/r2/map"]

    def test_two_robots_of_one_topic(self, replay: Program, two: Path) -> None:
        ran = replay.merge(two, "--topic", "a=/r1/map", "--robots", "r1,a")
        assert ran.status == 2
        assert "would both be fed from /r1/map" in ran.error

    def test_no_map_at_all(self, replay: Program, tmp_path: Path) -> None:
        talk = Recorded("/chatter", "std_msgs/msg/String", 5, {"data": "no map"})
        ran = replay.merge(write_bare_db3(tmp_path / "talk.db3", [talk]))
        assert ran.status == 2
        assert "no map, only std_msgs/msg/String; expected a topic of type nav_msgs/msg/OccupancyGrid" in ran.error


class TestNames:
    """A robot's name is a part of topics: no two may become one."""

    def test_characters_that_topics_do_not_allow(self, replay: Program, tmp_path: Path) -> None:
        for robot in ("r1", "r2"):
            write_mcap(tmp_path / f"{robot}.mcap", of_one_robot(robot))
        ran = replay.merge("7-up=r1.mcap", "r.2=r2.mcap", "--copy-maps")
        assert {"/_7_up/map", "/r_2/map"} <= topics(ran.mcap).keys()

    def test_that_become_alike(self, replay: Program, tmp_path: Path) -> None:
        for robot in ("r1", "r2"):
            write_mcap(tmp_path / f"{robot}.mcap", of_one_robot(robot))
        ran = replay.merge("r-1=r1.mcap", "r_1=r2.mcap", "--copy-maps")
        assert len([topic for topic in topics(ran.mcap) if topic.endswith("/map")]) == 3

    def test_a_robot_that_is_called_as_the_outcome(self, replay: Program, two: Path) -> None:
        """As when what a run wrote is merged again."""
        first = replay.merge(two, "--copy-maps").mcap.rename(replay.folder / "again.mcap")
        ran = replay.merge(first, "--copy-maps", "--robots", "merged,r2")
        assert ran.statuses == {"merged": "reference", "r2": "merged"}
        assert len([topic for topic in topics(ran.mcap) if topic.endswith("/map")]) == 3


class TestSeveralRecordings:
    def test_two_at_one_time_are_not_one_robot(self, replay: Program, tmp_path: Path) -> None:
        """As two buildings whose robots have the same names: taken for one, the map would jump between them."""
        one = write_mcap(tmp_path / "one.mcap", growing("r1"))
        other = write_mcap(tmp_path / "other.mcap", growing("r1", 5.0))
        for runs in ((one, other), (one, one), (f"a={one}", f"a={other}")):
            ran = replay.merge(*runs)
            assert ran.status == 2
            assert "at the same times; if these are two robots, name them, as a=one.mcap b=" in ran.error
        assert replay.merge(f"a={one}", f"b={other}").statuses["a"] == "reference"

    def test_parts_follow_each_other(self, replay: Program, tmp_path: Path) -> None:
        parts = [write_mcap(tmp_path / f"part_{part}.mcap", growing("r1", 60.0 * part)) for part in (0, 1)]
        ran = replay.merge(*parts)
        assert (ran.status, ran.statuses) == (0, {"r1": "reference"})
        assert [item["messages"] for item in ran.report["inputs"]] == [3, 3]


def test_map_topics_that_are_left_out_are_said(replay: Program, tmp_path: Path) -> None:
    messages = in_log_order(growing("r2"), growing("r1", 1.0, topic="/map"))
    run = write_mcap(tmp_path / "run.mcap", messages)
    said = "not used: /map; to use one, say whose it is, as --topic other=/map"
    assert said in replay.merge(run).err
    assert said in replay("info", run).out
    assert replay.merge(run, "--topic", "other=/map", "--force").statuses.keys() == {"other", "r2"}


def test_what_is_said_of_a_map_topic_that_is_left_out_brings_its_robot(replay: Program, two: Path) -> None:
    first = replay.merge(two, "--topic", "/r1/map")
    assert "not used: /r2/map; to use one, say whose it is, as --topic r2=/r2/map" in first.err
    both = replay.merge(two, "--topic", "/r1/map", "--topic", "r2=/r2/map", "--force")
    assert both.statuses == {"r1": "reference", "r2": "merged"}


def test_no_map_takes_the_place_of_one_that_was_named(replay: Program, two: Path) -> None:
    error = replay.merge(two, "--topic", "/r1/map", "--topic", "r1=/r2/map").error
    assert error.startswith("--topic /r1/map: it is not used beside --topic r1=/r2/map; say whose it is")


def test_the_merged_map_of_an_earlier_run_is_no_robot(replay: Program, two: Path, tmp_path: Path) -> None:
    first = tmp_path / "first.mcap"
    assert replay("merge", two, "--copy-maps", "--no-rrd", "-o", first).status == 0
    again = replay.merge(first)
    assert again.statuses == {"r1": "reference", "r2": "merged"}
    assert "not used: /merged/map" in again.err


def test_a_merged_map_is_merged_where_it_is_the_only_one(replay: Program, two: Path, tmp_path: Path) -> None:
    first = tmp_path / "first.mcap"
    assert replay("merge", two, "--no-rrd", "-o", first).status == 0
    again = replay.merge(f"floor={first}", two)
    assert again.statuses == {"floor": "reference", "r1": "merged", "r2": "merged"}
