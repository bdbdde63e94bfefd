"""Maps as robots record them: parts, repeats, growth, restarts, and messages that no map can be."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Rosbag1Writer

from mapmerge.grid import Grid
from mapmerge.sim2 import Sim2
from replay.codec import ros1_typestore
from replay.skip_cause import SkipCause
from tests.bags import Recorded, as_ros1, chunks, damage, write_mcap, write_rosbag1, write_rosbag2
from tests.outputs import maps, raw, reports, same_map, transforms
from tests.program import Program
from tests.runs import (
    FLOOR_FROM_MAP,
    at,
    bad_messages,
    bare_room,
    begun_anew,
    flat_map,
    growing,
    in_log_order,
    is_right,
    reference_from,
    seen,
    two_robots,
    updated,
)


def padded(grid: Grid, cells: int) -> Grid:
    """Return the same map on a larger grid: its origin moves."""
    corner = Sim2(-cells * grid.resolution_m, -cells * grid.resolution_m)
    return Grid(np.pad(grid.cells, cells, constant_values=-1), grid.resolution_m, grid.map_from_grid @ corner)


def turned(grid: Grid) -> Grid:
    """Return the same map with the grid turned by 90° in the map frame."""
    corner = Sim2(grid.cols * grid.resolution_m, 0.0, np.pi / 2)
    return Grid(np.rot90(grid.cells), grid.resolution_m, grid.map_from_grid @ corner)


@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("run.bag", lambda path: write_rosbag1(path, two_robots(), "bz2")),
        ("run.mcap", lambda path: write_mcap(path, two_robots())),
    ],
)
def test_where_damage_left_no_map_the_error_says_so(replay: Program, tmp_path: Path, name: str, write) -> None:
    run = write(tmp_path / name)
    for chunk in chunks(run):
        damage(run, chunk)
    # with its index it would seem to have maps
    run.write_bytes(run.read_bytes()[:-20])
    ran = replay.merge(run)
    assert ran.status == 2
    assert re.search(rf"; lost are .*\d+ messages? \(\w+\), .*first {name}, the chunk at byte \d+: ", ran.error)
    assert "; lost are " in replay("info", run).out


@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("run.bag", lambda path: write_rosbag1(path, two_robots(), "bz2")),
        ("run.mcap", lambda path: write_mcap(path, two_robots())),
    ],
)
def test_where_all_maps_are_lost_though_an_index_has_them(replay: Program, tmp_path: Path, name: str, write) -> None:
    run = write(tmp_path / name)
    for chunk in chunks(run):
        damage(run, chunk)
    check_none(replay, run, f"first {name}, the chunk at byte ")


def check_none(replay: Program, run: Path, words: str) -> None:
    """Check that of a recording of r1 and r2 no map can be used, and that all say so."""
    ran = replay.merge(run)
    assert ran.status == 2
    assert ran.error.startswith(f"{run}: no map of /r1/map, /r2/map can be used; lost are ")
    assert words in ran.error
    assert not list(run.parent.glob("out*"))
    assert f"nothing would be merged: {ran.error}" in replay("info", run).out.splitlines()


def test_a_topic_that_is_only_announced_is_no_map(replay: Program, tmp_path: Path) -> None:
    with Rosbag1Writer(tmp_path / "run.bag") as writer:
        for each in (seen("r1", 0.0), seen("r2", 1.0)):
            connection = writer.add_connection(each.topic, each.msgtype, typestore=ros1_typestore())
            if each.topic == "/r2/map":
                writer.write(connection, each.log_time_ns, as_ros1(each))
    ran = replay.merge(tmp_path / "run.bag", "--robots", "r1")
    assert ran.status == 2
    assert "no map of /r1/map can be used; there is none at these times; give other maps with --topic" in ran.error


def test_only_updates_are_no_map(replay: Program, tmp_path: Path) -> None:
    parts = [updated("r1", seconds, 0, 0, TestUpdates.PART) for seconds in (1.0, 2.0)]
    run = write_mcap(tmp_path / "run.mcap", [seen("r1", 0.0, resolution=0.0), *parts])
    ran = replay.merge(run)
    assert (ran.status, "lost are 1 message (bad_resolution)" in ran.error) == (2, True)


def test_no_map_that_fits_into_memory(replay: Program, tmp_path: Path) -> None:
    grown = Grid(np.zeros((1200, 1200), np.int8), 0.1)
    run = write_mcap(tmp_path / "run.mcap", [seen(robot, 0.0, grown) for robot in ("r1", "r2")])
    ran = replay.merge(run, "--max-memory", "2MB")
    assert ran.status == 2
    last = ran.err.splitlines()[-1]
    assert last.startswith(f"replay: error: {run}: no map of /r1/map, /r2/map can be used; lost are ")
    assert "(over_memory)" in last
    assert not list(tmp_path.glob("out*"))


@pytest.mark.parametrize(
    ("lost", "words"),
    [
        ("r1", "nothing would be merged: no map of r1 (/r1/map) can be used"),
        ("r2", "would be merged: r3 (/r3/map) into r1 (/r1/map), the reference; no map of r2 (/r2/map) can be used"),
    ],
)
def test_info_names_a_robot_of_which_no_map_can_be_used(replay: Program, tmp_path: Path, lost: str, words: str) -> None:
    robots = ("r1", "r2", "r3")
    messages = [seen(robot, 0.0, **({"resolution": 0.0} if robot == lost else {})) for robot in robots]
    assert replay("info", write_mcap(tmp_path / "run.mcap", messages)).out.splitlines()[-1] == words


def test_a_robot_whose_maps_are_lost_with_a_part_says_so(replay: Program, tmp_path: Path) -> None:
    talk = Recorded("/chatter", "std_msgs/msg/String", growing("r2")[-1].log_time_ns, {"data": "x" * 9000})
    run = write_mcap(tmp_path / "run.mcap", [*growing("r2"), talk, *growing("r1", 50.0)], chunk_bytes=40_000)
    first, *_ = chunks(run)
    assert first.topics == {"/r2/map", "/chatter"}
    damage(run, first)
    found = replay.merge(run).robots["r2"]["reason"]
    assert found == {"code": "no_map", "message": "no map that can be used yet, and parts of the recording are lost"}


def test_cells_that_mean_nothing_are_named_once_a_topic(replay: Program, tmp_path: Path) -> None:
    cells = flat_map("r2").cells.reshape(-1).copy()
    cells[:3000] = [101, 127, -128] * 1000  # of 12 000
    few = flat_map("r1").cells.reshape(-1).copy()
    few[:20] = 111
    part = updated("r1", 5.0, 0, 0, np.full((2, 2), -5, np.int8))
    messages = [seen("r1", 0.0), *(seen("r2", float(second), data=cells) for second in (1, 2, 3)), part]
    run = write_mcap(tmp_path / "run.mcap", [*messages, seen("r1", 6.0, data=few)])
    ran = replay.merge(run, "--strict")
    expected = {
        ("r2", f"run.mcap: /r2/map at {at(1.0)} ns: 25%"),
        ("r1", f"run.mcap: /r1/map_updates at {at(5.0)} ns: 100%"),
        ("r1", f"run.mcap: /r1/map at {at(6.0)} ns: less than 1%"),
    }
    words = " of the cells are outside −1 to 100: such cells are taken as unknown"
    assert len(ran.report["notes"]) == len(expected)
    assert {(each["robot"], each["message"].removesuffix(words)) for each in ran.report["notes"]} == expected
    assert ran.err.count(words) == len(expected)
    assert ran.report["skipped"] == {}


def test_metadata_that_cannot_be_read_is_named(replay: Program, tmp_path: Path) -> None:
    run = write_rosbag2(tmp_path / "run", two_robots())
    (run / "metadata.yaml").write_text("rosbag2_bagfile_information: [")
    ran = replay.merge(run)
    assert ran.statuses == {"r1": "reference", "r2": "merged"}
    ((cause, place, lost),) = [(each["cause"], each["place"], each["messages"]) for each in ran.report["skipped_at"]]
    assert (cause, place, lost) == ("damaged", "metadata.yaml", 0)
    assert "(run, metadata.yaml): damaged: it cannot be read (ParserError" in ran.err
    assert "(metadata.yaml): damaged: it cannot be read (ParserError" in replay("info", run).out


class TestUpdates:
    PART = np.full((5, 3), 100, np.int8)

    def test_are_applied_to_the_last_map(self, replay: Program, tmp_path: Path) -> None:
        messages = [*growing("r1"), updated("r1", 21.0, 30, 40, self.PART)]
        ran = replay.merge(write_mcap(tmp_path / "run.mcap", messages), "--copy-maps")
        expected = flat_map("r1").cells.copy()
        expected[40:45, 30:33] = 100
        assert same_map(maps(ran.mcap, "/r1/map")[-1].grid, Grid(expected, 0.1))
        assert ran.robots["r1"]["updates"] == 4
        assert not same_map(maps(ran.mcap)[-1].grid, maps(ran.mcap)[-2].grid)

    def test_a_map_that_grows_by_updates_alone_is_merged(self, replay: Program, tmp_path: Path) -> None:
        known, whole = flat_map("r2", 5.0), flat_map("r2")
        messages = in_log_order(
            [seen("r1", 0.0), seen("r2", 0.0, known)],
            [updated("r2", 1.0 + row, 0, row, whole.cells[row : row + 20]) for row in range(0, whole.rows, 20)],
        )
        ran = replay.merge(write_rosbag1(tmp_path / "run.bag", messages), "--copy-maps")
        assert ran.statuses["r2"] == "merged"
        assert same_map(maps(ran.mcap, "/r2/map")[-1].grid, whole)

    def test_before_any_map_and_outside_it_are_skipped(self, replay: Program, tmp_path: Path) -> None:
        messages = [
            updated("r1", 0.0, 0, 0, self.PART),
            seen("r1", 1.0),
            *(
                updated("r1", 2.0 + index, col, row, self.PART)
                for index, (col, row) in enumerate([(-1, 0), (0, -1), (118, 0), (0, 96)])
            ),
            updated("r1", 9.0, 117, 95, self.PART),
        ]
        run = write_mcap(tmp_path / "run.mcap", messages)
        ran = replay.merge(run)
        assert ran.report["skipped"] == {"update_before_grid": 1, "update_outside_grid": 4}
        assert ran.robots["r1"]["updates"] == 2
        assert "5 messages skipped: 1 update_before_grid, 4 update_outside_grid" in ran.err
        assert ran.err.count("skipped a message (run.mcap, /r1/map_updates") == 5

    @pytest.mark.parametrize(("seconds", "col"), [(0.0, 0), (2.0, 118)])
    def test_and_fatal_with_strict(self, replay: Program, tmp_path: Path, seconds: float, col: int) -> None:
        messages = in_log_order([seen("r1", 1.0)], [updated("r1", seconds, col, 0, self.PART)])
        ran = replay.merge(write_mcap(tmp_path / "run.mcap", messages), "--strict", "--robots", "r1")
        assert ran.status == 2
        assert "run.mcap: /r1/map_updates at" in ran.error
        assert not ran.mcap.exists()

    def test_a_smaller_map_takes_no_update_of_the_larger(self, replay: Program, tmp_path: Path) -> None:
        messages = [seen("r1", 0.0), seen("r1", 1.0, bare_room()), updated("r1", 2.0, 100, 50, self.PART)]
        ran = replay.merge(write_mcap(tmp_path / "run.mcap", messages))
        assert ran.report["skipped"] == {"update_outside_grid": 1}


class TestBadMessages:
    CAUSES = tuple(bad_messages("r1", 0.0))

    def test_every_cause_is_tested(self) -> None:
        elsewhere = {
            SkipCause.UPDATE_BEFORE_GRID,
            SkipCause.UPDATE_OUTSIDE_GRID,
            SkipCause.BAD_TIME,
            SkipCause.BAD_TRANSFORM,
        }
        of_recordings = {
            SkipCause.OVER_MEMORY,
            SkipCause.ENDS_EARLY,
            SkipCause.DAMAGED,
            SkipCause.WRONG_CHECKSUM,
            SkipCause.MISSING_PART,
            SkipCause.UNKNOWN_TYPE,
        }
        assert set(self.CAUSES) == set(SkipCause) - elsewhere - of_recordings

    def test_are_skipped_and_counted(self, replay: Program, tmp_path: Path) -> None:
        messages = in_log_order(two_robots(), list(bad_messages("r2", 11.5).values()))
        ran = replay.merge(write_mcap(tmp_path / "run.mcap", messages))
        assert ran.report["skipped"] == dict.fromkeys(sorted(self.CAUSES), 1)
        assert ran.statuses == {"r1": "reference", "r2": "merged"}
        assert ran.robots["r2"]["updates"] == 3
        assert ran.err.count("skipped a message (run.mcap, /r2/map at ") == len(self.CAUSES)

    @pytest.mark.parametrize("cause", CAUSES)
    @pytest.mark.parametrize("write", [write_mcap, write_rosbag1])
    def test_are_fatal_with_strict(self, replay: Program, tmp_path: Path, cause: str, write) -> None:
        messages = in_log_order(growing("r1"), [bad_messages("r1", 11.0)[cause]])
        ran = replay.merge(write(tmp_path / "run.bag", messages), "--strict", "--robots", "r1")
        assert ran.status == 2
        assert ran.error.startswith("run.bag: /r1/map at 2023-11-14 22:13:")
        assert not list(tmp_path.glob("out*"))

    @pytest.mark.parametrize("resolution", [0.0, -0.05, float("nan"), float("inf")])
    def test_a_resolution_that_is_none(self, replay: Program, tmp_path: Path, resolution: float) -> None:
        messages = [*growing("r1"), seen("r2", 5.0, resolution=resolution)]
        ran = replay.merge(write_mcap(tmp_path / "run.mcap", messages))
        assert ran.report["skipped"] == {"bad_resolution": 1}
        assert re.search(f"the resolution is {resolution}.* m; a positive number was expected", ran.err)

    def test_a_robot_with_nothing_else_has_no_map(self, replay: Program, tmp_path: Path) -> None:
        messages = in_log_order(growing("r1"), list(bad_messages("r2", 1.5).values()))
        ran = replay.merge(write_mcap(tmp_path / "run.mcap", messages), images="changed")
        found = ran.robots["r2"]
        assert (found["status"], found["reason"]["code"], found["updates"]) == ("no_map", "no_map", 0)
        assert (found["map_topic"], found["map_frame"]) == ("/r2/map", "r2/map")
        assert ran.report["inputs"][0]["late"] == 0
        assert "messages are skipped: 1 bad_origin, 1 bad_resolution, 1 empty" in found["reason"]["message"]
        assert [ran.robots["r1"]["updates"], len(maps(ran.mcap))] == [3, 3]

    def test_no_robot_with_anything_else(self, replay: Program, tmp_path: Path) -> None:
        messages = in_log_order(*(list(bad_messages(robot, 0.0).values()) for robot in ("r1", "r2")))
        check_none(replay, write_mcap(tmp_path / "run.mcap", messages), "2 messages (size_mismatch), 2 messages (")

    def test_a_topic_without_any_message(self, replay: Program, tmp_path: Path) -> None:
        """As in a recording of a robot whose SLAM never came up."""
        messages = in_log_order(growing("r1"), [seen("r2", 100.0)])
        ran = replay.merge(write_mcap(tmp_path / "run.mcap", messages), "--stop", "50")
        assert (ran.status, ran.statuses["r2"]) == (0, "no_map")


class TestMapsThatChange:
    def check(self, replay: Program, tmp_path: Path, *latest: Grid) -> None:
        """Check that these maps of r2, one after another, end where the truth says."""
        messages = [seen("r1", 0.0), *(seen("r2", 1.0 + index, grid) for index, grid in enumerate(latest))]
        ran = replay.merge(write_rosbag2(tmp_path / "run", messages), "--copy-maps")
        assert ran.robots["r2"]["updates"] == len(latest)
        assert is_right(ran.robots["r2"]["merged_from_map"], reference_from("r2"))
        assert same_map(maps(ran.mcap, "/r2/map")[-1].grid, latest[-1])

    def test_origin_and_size(self, replay: Program, tmp_path: Path) -> None:
        small, large = flat_map("r2", 7.0), flat_map("r2")
        self.check(replay, tmp_path, small, padded(large, 13), large.cropped_to_known())

    def test_resolution(self, replay: Program, tmp_path: Path) -> None:
        self.check(replay, tmp_path, flat_map("r2"), flat_map("r2", resolution_m=0.05))

    def test_a_turned_origin(self, replay: Program, tmp_path: Path) -> None:
        self.check(replay, tmp_path, flat_map("r2"), turned(flat_map("r2")))

    def test_of_the_reference(self, replay: Program, tmp_path: Path) -> None:
        """The merged frame never moves, and the cells are those of the reference's lattice as it is now."""
        fine = flat_map("r1", resolution_m=0.05)
        grids = [flat_map("r1"), padded(flat_map("r1"), 9), turned(flat_map("r1")), fine]
        messages = [seen("r2", 0.0), *(seen("r1", 1.0 + index, grid) for index, grid in enumerate(grids))]
        ran = replay.merge(write_mcap(tmp_path / "run.mcap", messages))
        for grid, (time_ns, report) in zip(grids, reports(ran.mcap)[1:], strict=True):
            written = [each for each in maps(ran.mcap) if each.stamp_ns <= time_ns][-1]
            assert is_right(report["robots"]["r2"]["merged_from_map"], reference_from("r2"))
            assert written.frame_id == "merged"
            assert written.grid.resolution_m == grid.resolution_m
            shift = grid.map_from_grid.inverse() @ written.grid.map_from_grid
            assert shift.yaw_rad == pytest.approx(0.0, abs=1e-9)
            steps = np.array([shift.x_m, shift.y_m]) / grid.resolution_m
            assert steps == pytest.approx(np.round(steps), abs=1e-6)

    def test_graded_values(self, replay: Program, tmp_path: Path) -> None:
        random = np.random.default_rng(4)

        def graded(grid: Grid) -> Grid:
            noise = random.integers(0, 20, grid.cells.shape)
            cells = np.select([grid.cells == 0, grid.cells == 100], [noise, 100 - noise], -1)
            return Grid(cells.astype(np.int8), grid.resolution_m, grid.map_from_grid)

        messages = [seen("r1", 0.0, graded(flat_map("r1"))), seen("r2", 1.0, graded(flat_map("r2")))]
        ran = replay.merge(write_mcap(tmp_path / "run.mcap", messages))
        assert is_right(ran.robots["r2"]["merged_from_map"], reference_from("r2"))
        assert len(np.unique(maps(ran.mcap)[-1].grid.cells)) > 20


class TestRepeats:
    def test_are_no_update_and_no_work(self, replay: Program, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        matched = []
        from mapmerge.match.correlation import CorrelationMatcher

        match = CorrelationMatcher.match

        def counted(self, *arguments):
            matched.append(1)
            return match(self, *arguments)

        monkeypatch.setattr(CorrelationMatcher, "match", counted)
        messages = in_log_order(*([seen(robot, seconds) for seconds in range(6)] for robot in ("r1", "r2")))
        ran = replay.merge(write_mcap(tmp_path / "run.mcap", messages), "--copy-maps", images="changed")
        assert len(matched) == 1
        assert (ran.report["updates"], ran.robots["r1"]["updates"], ran.robots["r2"]["updates"]) == (2, 1, 1)
        assert [len(maps(ran.mcap, topic)) for topic in ("/merged/map", "/r1/map", "/r2/map")] == [1, 1, 1]
        assert len(raw(ran.mcap, "/merged/images/r2/overlay")) == 1
        assert (len(raw(ran.mcap, "/tf")), len(reports(ran.mcap))) == (6, 2)

    def test_every_image_if_all_are_asked_for(self, replay: Program, tmp_path: Path) -> None:
        messages = in_log_order(*([seen(robot, seconds) for seconds in range(3)] for robot in ("r1", "r2")))
        ran = replay.merge(write_mcap(tmp_path / "run.mcap", messages), images="all")
        assert len(raw(ran.mcap, "/merged/images/r2/overlay")) == 3


class TestRestart:
    def test_of_a_robot(self, replay: Program, tmp_path: Path) -> None:
        messages = [
            seen("r1", 0.0),
            seen("r2", 1.0),
            seen("r2", 2.0, begun_anew(flat_map("r2", 1.0))),
            seen("r2", 3.0, begun_anew(flat_map("r2"))),
        ]
        ran = replay.merge(write_mcap(tmp_path / "run.mcap", messages))
        history = [(change["robot"], change["event"], change["stamp_ns"]) for change in ran.report["history"]]
        first, *_ = messages
        assert [(robot, event, (ns - first.log_time_ns) // 10**9) for robot, event, ns in history] == [
            ("r2", "placed", 1),
            ("r2", "jumped", 2),
            ("r2", "withdrawn", 2),
            ("r2", "placed", 3),
        ]
        anew_from_r2 = Sim2(3.0, -2.0, 1.0)
        expected = reference_from("r2") @ anew_from_r2.inverse()
        assert is_right(ran.robots["r2"]["merged_from_map"], expected, anew_from_r2.apply_point(5.0, 4.0))
        assert ran.robots["r2"]["first_merged_stamp_ns"] == messages[1].log_time_ns
        frames = [set(found) for _, found in transforms(ran.mcap)]
        assert frames == [{"r1/map"}, {"r1/map", "r2/map"}, {"r1/map"}, {"r1/map", "r2/map"}]

    def test_of_the_reference(self, replay: Program, tmp_path: Path) -> None:
        """The merged frame is the reference's map frame, whatever that is."""
        messages = [seen("r1", 0.0), seen("r2", 1.0), seen("r1", 2.0, begun_anew(flat_map("r1")))]
        ran = replay.merge(write_mcap(tmp_path / "run.mcap", messages))
        expected = Sim2(3.0, -2.0, 1.0) @ reference_from("r2")
        assert is_right(ran.robots["r2"]["merged_from_map"], expected)
        events = [(change["robot"], change["event"]) for change in ran.report["history"]]
        assert events == [("r2", "placed"), ("r1", "jumped"), ("r2", "moved")]


class TestFrames:
    @pytest.mark.parametrize(
        ("recorded", "expected"),
        [
            (("map", "map"), ("r1/map", "r2/map")),
            (("/map", "map"), ("r1/map", "r2/map")),
            (("r1/map", "r2/map"), ("r1/map", "r2/map")),
            (("/r1/map", "/r2_odom"), ("r1/map", "r2_odom")),
            (("map", "odom"), ("map", "odom")),
            (("", ""), ("r1/map", "r2/map")),
            (("merged", "map"), ("r1/merged", "map")),
        ],
    )
    def test_are_unique_in_all_outputs(
        self, replay: Program, tmp_path: Path, recorded: tuple[str, str], expected: tuple[str, str]
    ) -> None:
        messages = [seen("r1", 0.0, frame=recorded[0]), seen("r2", 1.0, frame=recorded[1])]
        ran = replay.merge(write_mcap(tmp_path / "run.mcap", messages), "--copy-maps")
        assert tuple(robot["map_frame"] for robot in ran.robots.values()) == expected
        assert set(list(transforms(ran.mcap))[-1][1]) == set(expected)
        for robot, frame in zip(("r1", "r2"), expected, strict=True):
            assert {each.frame_id for each in maps(ran.mcap, f"/{robot}/map")} == {frame}

    def test_one_robot_s_frame_may_look_like_another_s(self, replay: Program, tmp_path: Path) -> None:
        messages = [seen("r1", 0.0, frame="map"), seen("r2", 1.0, frame="map"), seen("r3", 2.0, frame="r1/map")]
        ran = replay.merge(write_mcap(tmp_path / "run.mcap", messages))
        found = [robot["map_frame"] for robot in ran.robots.values()]
        assert len(set(found)) == 3


class TestUnplaced:
    def test_is_shown_beside(self, replay: Program, tmp_path: Path) -> None:
        messages = in_log_order(two_robots(), [seen("r3", 30.0, bare_room())])
        ran = replay.merge(write_mcap(tmp_path / "run.mcap", messages), "--copy-maps", images="changed")
        found = ran.robots["r3"]
        assert found["status"] == "unmerged"
        assert found["merged_from_map"] is None
        assert found["reason"]["code"] in {"too_little_structure", "too_little_overlap", "ambiguous"}
        assert re.match(r"not placed on r[12]: ", found["reason"]["message"])
        assert same_map(maps(ran.mcap, "/r3/map")[0].grid, bare_room())
        assert list(transforms(ran.mcap))[-1][1].keys() == {"r1/map", "r2/map"}

    def test_shows_its_best_refused_candidate(self, replay: Program, tmp_path: Path) -> None:
        messages = [seen("r1", 0.0, flat_map("r1", 1.0)), seen("r2", 1.0)]
        ran = replay.merge(write_mcap(tmp_path / "run.mcap", messages), images="changed")
        (pair,) = ran.report["pairs"]
        found = ran.robots["r2"]
        assert (found["status"], pair["accepted"]) == ("unmerged", False)
        assert pair["a_from_b"] is not None
        for name in ("acceptance", "overlap_m2", "overlap_fraction"):
            assert found[name] == pair["scores"][name]
        assert raw(ran.mcap, "/merged/images/r2/overlay")

    def test_a_reference_that_is_unknown_everywhere(self, replay: Program, tmp_path: Path) -> None:
        nothing = Grid(np.full((20, 30), -1, np.int8), 0.1)
        messages = [seen("r1", 0.0, nothing), seen("r2", 1.0)]
        ran = replay.merge(write_mcap(tmp_path / "run.mcap", messages), images="all")
        assert ran.statuses == {"r1": "no_map", "r2": "unmerged"}
        assert ran.robots["r2"]["reason"]["code"] == "no_reference_map"


def test_every_robot_may_be_the_reference(replay: Program, tmp_path: Path) -> None:
    messages = in_log_order(*(growing(robot) for robot in FLOOR_FROM_MAP))
    run = write_mcap(tmp_path / "run.mcap", messages)
    for reference in FLOOR_FROM_MAP:
        others = [robot for robot in FLOOR_FROM_MAP if robot != reference]
        ran = replay.merge(run, "--robots", ",".join([reference, *others]))
        assert ran.robots[reference]["merged_from_map"] == {"x_m": 0.0, "y_m": 0.0, "yaw_rad": 0.0, "scale": 1.0}
        for robot in others:
            assert is_right(ran.robots[robot]["merged_from_map"], reference_from(robot, reference))
