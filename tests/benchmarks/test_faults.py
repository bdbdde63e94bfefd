"""What becomes of damaged recordings, and whether a wrong outcome would be noticed."""

import bz2
import sys
from dataclasses import replace
from random import Random

import lz4.frame
import numpy as np
import pytest

from benchmarks.faults import __main__ as command
from benchmarks.faults import bombs, placement, remembered, whole_runs, worker
from benchmarks.faults.cases import Case, Task, cases
from benchmarks.faults.formats import FORMATS, undamaged
from benchmarks.faults.mcap_layout import closed, parsed
from benchmarks.faults.messages import MapContent
from benchmarks.faults.oracle import FAILURES, Expected, Judged, Verdict, judge
from benchmarks.faults.pool import Worker, run_all
from benchmarks.faults.printed import Counts
from benchmarks.faults.runner import Named, Ran, Used
from benchmarks.faults.table import FAULTS
from benchmarks.faults.world import (
    BARE_ROOM,
    FLOOR_FROM_MAP,
    SQUARE_ROOM,
    changed,
    drawn_map,
    messages,
    robot_map,
    robot_of,
)
from mapmerge.grid import Grid
from mapmerge.merger import Merger
from mapmerge.sim2 import Sim2
from replay.codec import decode
from replay.sources import open_source
from replay.sources.base import GRID_TYPE, RawMessage
from replay.sources.mcap.file import McapFile
from replay.sources.zstd import zstd

SEED = 7
# Variants that once ended wrongly, by seed.
FOUND = [
    (0, "mcap_none/mcap_channel_encoding_changed/0"),
    (0, "mcap_zstd/mcap_inner_record_removed/0"),
    (0, "mcap_lz4/mcap_record_removed/0"),
    (0, "mcap_zstd/bits_flipped_in_tail/0"),
    (0, "mcap_none/message_resolution_wrong/0"),
    (0, "db3_folder/message_origin_wrong/0"),
    (0, "db3/db3_row_topic_wrong/0"),
    (0, "db3/db3_topic_removed/0"),
    (0, "bag_lz4/bag_record_doubled/0"),
    (1, "db3_message_zstd/db3_pages_swapped/0"),
    (2, "mcap_none/mcap_records_swapped/1"),
    (2, "mcap_unchunked/mcap_records_swapped/0"),
    (2, "bag_lz4/bits_flipped/1"),
    (2, "mcap_no_crc/block_removed/2"),
    (5, "mcap_no_crc/block_removed/0"),
    (5, "bag_lz4_unchecked/block_removed/2"),
    (6, "mcap_folder/blocks_swapped/1"),
    (8, "mcap_no_crc/block_removed/0"),
    (11, "bag_lz4_unchecked/all_random/1"),
    (11, "mcap_ros1/block_removed/1"),
    (12, "mcap_split/mcap_record_removed/0"),
    (3, "mcap_folder/truncated/0"),
    (3, "db3_folder/db3_row_time_wrong/0"),
    (3, "db3_split/db3_pages_swapped/1"),
    (3, "db3_folder/db3_topic_wrong/2"),
    (3, "bag_bz2/tail_zeroed/0"),
]
ONE, TWO, OTHER = Used("/r1/map", 1, "aa"), Used("/r2/map", 2, "bb"), Used("/r2/map", 2, "cc")
EXPECTED = Expected(frozenset({ONE, TWO}), ("r1", "r2", "dd"), "run.mcap", ("r1", "r2"), is_checked=True)
RIGHT = Ran(used=(ONE, TWO), merged=("r1", "r2", "dd"))
LOST = Ran(used=(ONE,), merged=("r1",))


@pytest.fixture(autouse=True)
def small_bombs(monkeypatch):
    """Those that are tried take seconds to be made."""
    monkeypatch.setattr(bombs, "SIZES", (1 << 24,))
    monkeypatch.setattr(bombs, "_FILE_BYTES", 1 << 24)


def said(messages=1):
    return Named("damaged", "", 2, "the chunk at byte 7", "its checksum is wrong", messages)


def run_one(case="mcap_zstd/mcap_footer_wrong/0"):
    return worker.answer(Task(Case.named(case, SEED)))


class TestOracle:
    @pytest.mark.parametrize(
        ("ran", "verdict"),
        [
            (RIGHT, Verdict.RIGHT),
            (replace(LOST, named=(said(),)), Verdict.NAMED),
            (replace(LOST, named=(said(None),)), Verdict.NAMED),
            (replace(LOST, unused=1), Verdict.NAMED),
            (Ran(error="/x/run.mcap: it cannot be read"), Verdict.ERROR),
            (Ran(error="the clocks of r1 and r2 cannot be the same", is_usage=True), Verdict.ERROR),
            (Ran(crash="Traceback"), Verdict.CRASHED),
            (Ran(hung=True), Verdict.HUNG),
        ],
    )
    def test_tells_what_may_be(self, ran, verdict):
        assert judge(ran, EXPECTED).verdict is verdict

    @pytest.mark.parametrize(
        ("ran", "why"),
        [
            (LOST, "nothing was said"),
            (replace(LOST, used=(), named=(said(),)), "of 1 nothing was said"),
            (replace(RIGHT, used=(ONE, OTHER)), "a checksum tells"),
            (replace(RIGHT, used=(ONE, OTHER), named=(said(),)), "a checksum tells"),
            (replace(RIGHT, misplaced=("r2 is placed 3 m from where it lies",)), "3 m"),
            (replace(RIGHT, merged=("r1", "r2", "ee")), "the same messages gave"),
            (replace(RIGHT, program="it ended with 3"), "ended with 3"),
            (Ran(error="it cannot be read"), "does not name"),
            (Ran(error="the clocks of r1 cannot be read"), "does not name"),
            (Ran(error="run.mcap: it cannot\nbe read"), "not one line"),
        ],
    )
    def test_tells_what_must_not_be(self, ran, why):
        judged = judge(ran, EXPECTED)
        assert judged.verdict is Verdict.WRONG
        assert why in judged.why

    def test_believed_bytes_without_a_checksum_are_a_category_of_their_own(self):
        unchecked = replace(EXPECTED, is_checked=False)
        assert judge(replace(RIGHT, used=(ONE, OTHER)), unchecked).verdict is Verdict.UNPROTECTED
        assert judge(LOST, unchecked).verdict is Verdict.WRONG
        assert judge(LOST, replace(unchecked, leaves_no_trace=True)).verdict is Verdict.UNPROTECTED
        elsewhere = replace(LOST, topics={("/r2/mbp", "nav_msgs/msg/OccupancyGrid"): 1})
        assert judge(elsewhere, replace(unchecked, are_names_checked=False)).verdict is Verdict.UNPROTECTED
        assert judge(elsewhere, unchecked).verdict is Verdict.WRONG
        misplaced = replace(RIGHT, used=(ONE, OTHER), misplaced=("r2",))
        assert judge(misplaced, unchecked).verdict is Verdict.WRONG


@pytest.mark.parametrize(("seed", "name"), FOUND)
def test_what_once_ended_wrongly_does_not(seed, name):
    judged = worker.answer(Task(Case.named(name, seed)))
    assert judged.verdict not in FAILURES, judged.why


class TestFakeFailures:
    """Each replaces a part of the program by one that fails, and looks whether that is noticed."""

    @pytest.fixture(autouse=True)
    def known(self):
        """What is right is known before anything fails."""
        worker.undamaged_run("mcap_zstd")

    def test_the_program_as_it_is(self):
        assert run_one().verdict is Verdict.RIGHT

    def test_a_message_dropped_in_silence(self, monkeypatch):
        whole = McapFile.messages

        def some(self, topics):
            for number, raw in enumerate(whole(self, topics)):
                if number != 3:
                    yield raw

        monkeypatch.setattr(McapFile, "messages", some)
        judged = run_one()
        assert judged.verdict is Verdict.WRONG
        assert "nothing was said" in judged.why

    def test_a_message_believed_though_its_checksum_is_wrong(self, monkeypatch):
        whole = McapFile.messages

        def altered(self, topics):
            for raw in whole(self, topics):
                yield replace(raw, data=bytes(raw.data)[:-1] + b"\x05")

        monkeypatch.setattr(McapFile, "messages", altered)
        judged = run_one()
        assert judged.verdict is Verdict.WRONG
        assert "a checksum tells" in judged.why

    def test_an_exception_that_is_no_error_of_ours(self, monkeypatch):
        def broken(*given):
            raise KeyError(given)

        monkeypatch.setattr(McapFile, "messages", broken)
        judged = run_one()
        assert judged.verdict is Verdict.CRASHED
        assert "KeyError" in judged.why

    def test_maps_placed_where_they_do_not_lie(self, monkeypatch):
        step = Merger.step

        def shifted(self, grids, priors=None, *, is_last=False):
            result = step(self, grids, priors, is_last=is_last)
            robots = {
                robot: replace(found, merged_from_map=Sim2(0.5) @ found.merged_from_map)
                if robot == "r2" and found.merged_from_map
                else found
                for robot, found in result.robots.items()
            }
            return replace(result, robots=robots)

        monkeypatch.setattr(Merger, "step", shifted)
        monkeypatch.setattr(remembered, "_known", remembered.Known())
        judged = run_one()
        assert judged.verdict is Verdict.WRONG
        assert "r2 is placed 0.5" in judged.why

    def test_a_recording_that_was_changed(self, monkeypatch):
        def careless(path, **_):
            path.write_bytes(b"")
            return RIGHT

        monkeypatch.setattr(worker, "run", careless)
        with pytest.raises(AssertionError, match="was changed"):
            worker.answer(Task(Case.named("mcap_zstd/truncated/0", SEED)))

    @pytest.mark.parametrize(
        ("does", "verdict"),
        [
            ("import os; os.abort()", Verdict.CRASHED),
            ("import time; time.sleep(60)", Verdict.HUNG),
            ("pass", Verdict.CRASHED),
        ],
    )
    def test_a_process_that_dies_or_hangs(self, does, verdict):
        ready = "import pickle, sys; pickle.dump('ready', sys.stdout.buffer); sys.stdout.buffer.flush()"
        one = Worker((sys.executable, "-c", f"{ready}; pickle.load(sys.stdin.buffer); {does}"), most_s=2.0)
        assert one.run(Task(Case("mcap_zstd", "truncated", 0))).verdict is verdict

    def test_a_process_that_does_not_start_is_nobodys_outcome(self):
        with pytest.raises(RuntimeError, match="does not start"):
            Worker((sys.executable, "-c", "pass")).run(Task(Case("mcap_zstd", "truncated", 0)))


class TestPlacement:
    def test_a_map_is_known_by_its_cells_whatever_its_name_and_origin(self):
        moved = Grid(robot_map("r2", 2).cells, 0.15, Sim2(5.0, -3.0, 0.7))
        true = FLOOR_FROM_MAP["r1"].inverse() @ FLOOR_FROM_MAP["r2"] @ moved.map_from_grid.inverse()
        target = robot_map("r1", 2)
        assert placement.error_of("r1", target, "r3", moved, true) == ""
        assert placement.error_of("r1", target, "r3", moved, true @ Sim2(0.32))
        assert "m and" in placement.error_of("r1", target, "r3", moved, true @ Sim2(0.4))
        assert "°" in placement.error_of("r1", target, "r2", moved, true @ Sim2(yaw_rad=0.1))
        assert "of r3" in placement.error_of("r1", target, "r2", robot_map("r3", 2), true)

    def test_cells_that_damage_has_moved_lie_where_they_were_moved_to(self):
        cells = np.roll(robot_map("r2", 2).cells.reshape(-1), 7 * 80 - 3).reshape(66, 80)
        true = FLOOR_FROM_MAP["r1"].inverse() @ FLOOR_FROM_MAP["r2"]
        target = robot_map("r1", 2)
        assert placement.error_of("r1", target, "r1", Grid(cells, 0.15), true @ Sim2(3 * 0.15, -7 * 0.15)) == ""
        assert placement.error_of("r1", target, "r1", Grid(cells, 0.15), true)

    def test_cells_of_which_some_were_moved_lie_at_either_place(self):
        """As when bytes are missing in the middle of a map: the rest moves up, and no placement fits both."""
        whole = robot_map("r2", 2).cells.reshape(-1)
        middle = np.flatnonzero(whole >= 0)[np.count_nonzero(whole >= 0) // 2]
        cells = np.concatenate([whole[:middle], whole[middle + 12 :], np.full(12, -1, np.int8)]).reshape(66, 80)
        true = FLOOR_FROM_MAP["r1"].inverse() @ FLOOR_FROM_MAP["r2"]
        target, source = robot_map("r1", 2), Grid(cells, 0.15)
        assert placement.error_of("r1", target, "r2", source, true) == ""
        assert placement.error_of("r1", target, "r2", source, true @ Sim2(12 * 0.15)) == ""
        assert placement.error_of("r1", target, "r2", source, true @ Sim2(-6 * 0.15))
        assert placement.error_of("r1", target, "r2", source, true @ Sim2(6 * 0.15))
        assert placement.error_of("r1", target, "r2", source, true @ Sim2(yaw_rad=1.0))

    def test_another_resolution_is_another_place(self):
        wide = Grid(robot_map("r2", 2).cells, 0.2)
        true = FLOOR_FROM_MAP["r1"].inverse() @ FLOOR_FROM_MAP["r2"]
        assert placement.error_of("r1", robot_map("r1", 2), "r2", wide, true)


class TestReal:
    """Recordings of which a file beside says where maps lie."""

    ERROR = staticmethod(FORMATS["sample_mcap"].real.error_of)

    @pytest.fixture
    def last(self):
        """The last map of each robot."""
        found = {}
        for raw in FORMATS["sample_mcap"].raw(()):
            if raw.msgtype == GRID_TYPE:
                found[raw.topic.split("/")[1]] = decode(raw).grid
        return found

    def test_a_map_lies_where_the_file_says(self, last):
        true = Sim2(28.162, 0.906, 2.18)
        target, source = ("r1", last["r1"]), ("r2", last["r2"])
        assert self.ERROR(target, source, true) == ""
        assert self.ERROR(source, target, true.inverse()) == ""
        assert "m and" in self.ERROR(target, source, Sim2(0.8) @ true)
        assert self.ERROR(target, source, true.inverse())

    def test_it_is_known_by_its_cells_whatever_its_name_corner_and_shift(self, last):
        true = Sim2(28.162, 0.906, 2.18)
        cells, cell_m = last["r2"].cells, last["r2"].resolution_m
        moved = Grid(np.roll(cells.reshape(-1), 40).reshape(cells.shape), cell_m, last["r2"].map_from_grid)
        corner = Grid(cells, cell_m, Sim2(3.0, 4.0, 0.5))
        target = ("r1", last["r1"])
        assert self.ERROR(target, ("r7", last["r2"]), true) == ""
        assert self.ERROR(target, ("r2", corner), true) != ""
        assert (
            self.ERROR(target, ("r2", corner), true @ last["r2"].map_from_grid @ corner.map_from_grid.inverse()) == ""
        )
        assert self.ERROR(target, ("r2", moved), true @ Sim2(-40 * cell_m)) == ""
        assert self.ERROR(target, ("r2", moved), true) != ""


class TestFormats:
    @pytest.mark.parametrize("name", FORMATS)
    def test_hold_what_is_recorded(self, name, tmp_path):
        with open_source(undamaged(name).write(tmp_path)) as source:
            topics = [topic.name for topic in source.info.topics]
            found = [replace(raw, data=bytes(raw.data)) for raw in source.messages(topics)]
        assert found == FORMATS[name].raw(messages())

    def test_an_mcap_file_is_the_same_when_written_again(self):
        data = undamaged("mcap_zstd").files["run.mcap"]
        assert closed(parsed(data)) != data  # the offset of offsets is left out
        assert parsed(closed(parsed(data)))[:-1] == parsed(data)[:-1]


class TestCases:
    def test_are_the_same_for_the_same_name(self):
        for case in cases_of(40):
            one, again = case.variant(), Case.named(case.name, SEED).variant()
            assert (one is None) == (again is None)
            assert one is None or (one.recording, one.told) == (again.recording, again.told)

    def test_every_fault_changes_something(self):
        for fault, row in FAULTS.items():
            cases_of_it = (Case(kind, fault, number, SEED) for number in range(3) for kind in FORMATS)
            variants = ((each.format, each.variant()) for each in cases_of_it if row.fits(FORMATS[each.format]))
            assert any(each and each.recording != undamaged(kind) for kind, each in variants), fault

    @pytest.mark.parametrize("name", ["", "mcap_zstd/truncated", "mcap_zstd/none/1", "no/truncated/1", "db3/zeroed/x"])
    def test_a_name_that_is_none(self, name):
        with pytest.raises(ValueError, match="is no case"):
            Case.named(name, SEED)


class TestBombs:
    @pytest.mark.parametrize(
        ("zeros", "decompress"),
        [
            (bombs.zeros_zstd, zstd.decompress),
            (bombs.zeros_lz4, lz4.frame.decompress),
            (bombs.zeros_bz2, bz2.decompress),
        ],
    )
    def test_are_small_and_grow(self, zeros, decompress):
        size = 1 << 24
        assert decompress(zeros(size)) == bytes(size)
        assert len(zeros(size)) < size // 100

    @pytest.mark.parametrize("kind", [name for name, each in FORMATS.items() if each.compression and not each.real])
    def test_take_the_place_of_something_in_every_format_that_is_compressed(self, kind):
        judged = worker.answer(Task(Case(kind, "bomb", 0, SEED)))
        assert judged.verdict in {Verdict.RIGHT, Verdict.NAMED, Verdict.ERROR}, judged.why
        assert Case(kind, "bomb", 0, SEED).variant().recording != undamaged(kind)


class TestOddMaps:
    TRUE = FLOOR_FROM_MAP["r1"].inverse() @ FLOOR_FROM_MAP["r2"]

    def maps(self, name, number=0):
        told = Case("mcap_none", name, number, SEED).variant().told
        return {
            robot_of(each.topic): Grid(
                np.frombuffer(each.content.cells, np.int8).reshape(each.content.height, each.content.width), 0.15
            )
            for each in told
            if isinstance(each.content, MapContent)
        }

    def test_symmetric_rooms_look_the_same_turned_by_half_and_lie_at_one_place(self):
        for walls in (BARE_ROOM, SQUARE_ROOM):
            room = drawn_map("r1", 2, walls).cells
            rows, cols = np.nonzero(room >= 0)
            inside = room[rows.min() : rows.max() + 1, cols.min() : cols.max() + 1]
            turned = inside[::-1, ::-1]
            assert np.mean((inside == 0) == (turned == 0)) > 0.9
            target, source = Grid(room, 0.15), drawn_map("r2", 2, walls)
            assert placement.error_of("r1", target, "r2", source, self.TRUE) == ""
            centre = Sim2(4.5, 3.0)
            about = FLOOR_FROM_MAP["r1"].inverse() @ centre @ Sim2(yaw_rad=np.pi) @ centre.inverse()
            assert placement.error_of("r1", target, "r2", source, about @ FLOOR_FROM_MAP["r2"])

    def test_identical_maps_lie_on_each_other(self):
        one = robot_map("r1", 2)
        assert placement.error_of("r1", one, "r2", one, Sim2()) == ""
        found = self.maps("maps_identical")
        same = [(a, b) for a in found for b in found if a < b and np.array_equal(found[a].cells, found[b].cells)]
        assert len(same) == 1

    def test_a_mirrored_map_lies_nowhere_else(self):
        mirrored = Grid(robot_map("r2", 2).cells[::-1], 0.15)
        assert placement.error_of("r1", robot_map("r1", 2), "r2", mirrored, Sim2(3.0, 1.0, 0.5))
        changed_ones = [
            robot
            for robot, grid in self.maps("maps_mirrored").items()
            if np.array_equal(grid.cells[::-1], robot_map(robot, 2).cells)
        ]
        assert len(changed_ones) == 1

    def test_a_map_over_the_memory_is_named(self):
        judged = worker.answer(Task(Case("mcap_zstd", "message_over_memory", 0, SEED), program=True))
        assert judged.verdict is Verdict.NAMED
        assert "over_memory" in judged.why


class TestWholeRuns:
    @pytest.mark.parametrize("name", ["run_interrupted", "run_on_small_disk", "run_on_read_only_disk"])
    def test_end_in_one_line(self, name, tmp_path):
        judged = whole_runs.MISFORTUNES[name](Random(3), tmp_path)  # noqa: S311
        if judged is None:
            pytest.skip("nobody may have a disk of their own here")
        assert judged.verdict in {Verdict.ERROR, Verdict.RIGHT}, judged.why

    def test_none_writes_over_its_input(self, tmp_path):
        for seed in range(4):
            judged = whole_runs.into_its_input(Random(seed), tmp_path / str(seed))  # noqa: S311
            assert judged.verdict is Verdict.ERROR
            assert "is an input" in judged.why

    def test_are_tried_as_often_as_is_said(self, monkeypatch):
        def never(*_):
            return None

        def always(*_):
            return Judged(Verdict.RIGHT)

        monkeypatch.setattr(whole_runs, "MISFORTUNES", {"one": never, "other": always})
        monkeypatch.setattr(whole_runs, "killed_runs", lambda *_: [])
        assert [name for name, _ in whole_runs.tried(3, SEED)] == ["other"] * 3
        assert list(whole_runs.tried(0, SEED)) == []


def cases_of(count):
    found = cases(tuple(FORMATS), tuple(FAULTS), SEED)
    return [next(found) for _ in range(count)]


class TestCommand:
    def test_a_share_of_the_faults_ends_well(self, capsys):
        assert command.main(["--tries", "120", "--seed", str(SEED), "--jobs", "2", "--by-format"]) == 0
        *_, total, _, verdict = capsys.readouterr().out.splitlines()
        assert cells(total)[0] == "all"
        assert cells(total)[-4:-1] == ["0", "0", "0"]
        assert int(cells(total)[1]) > 100
        assert verdict.startswith("holds")

    def test_a_failure_is_said_with_its_name_kept_and_counted(self, capsys, tmp_path, monkeypatch):
        class Failing:
            def run(self, task):
                return Judged(Verdict.HUNG, "it was stopped") if task.case.number else Judged(Verdict.RIGHT)

            def close(self):
                pass

        monkeypatch.setattr(command, "run_all", lambda tasks, jobs: run_all(tasks, jobs, Failing))
        given = ["--tries", "2", "--formats", "db3", "--faults", "zeroed", "--jobs", "1", "--keep", str(tmp_path)]
        assert command.main(given) == 1
        shown = capsys.readouterr().out
        assert "hung: --seed 0 --replay db3/zeroed/1: it was stopped" in shown
        assert "FAILS  crashed, hung or wrong, of 2: 1" in shown
        assert (tmp_path / "db3_zeroed_1" / "run.db3").is_file()

    def test_one_case_again(self, capsys, tmp_path):
        assert command.main(["--replay", "bag_none/emptied/0", "--keep", str(tmp_path)]) == 0
        assert capsys.readouterr().out.startswith("bag_none/emptied/0: clear error\n")
        assert (tmp_path / "bag_none_emptied_0" / "run.bag").is_file()

    def test_nothing_new_is_begun_after_the_time(self, capsys):
        assert command.main(["--seconds", "1e-9", "--jobs", "1"]) == 0
        assert "of 0: 0" in capsys.readouterr().out


def test_counts_are_of_faults_or_of_formats():
    counts = Counts()
    for kind, fault, verdict in (
        ("whole runs", "run_killed", Verdict.RIGHT),
        ("db3", "zeroed", Verdict.WRONG),
        ("bag_none", "zeroed", Verdict.RIGHT),
    ):
        counts.add(Case(kind, fault, 0), verdict)
    assert (counts.tries, counts.failures) == (3, 1)
    assert [cells(line)[:3] for line in counts.lines()][2:] == [
        ["zeroed", "2", "1"],
        ["run_killed", "1", "1"],
        ["all", "3", "2"],
    ]
    assert [cells(line)[::8] for line in counts.lines_of_formats()][2:] == [
        ["bag_none", "0"],
        ["db3", "1"],
        ["whole runs", "0"],
        ["all", "1"],
    ]


def test_the_table_is_markdown():
    counts = Counts()
    counts.add(Case("db3", "zeroed", 0), Verdict.NAMED)
    head, rule, *_ = table = list(counts.lines())
    assert cells(head)[1:] == ["tries", "right result", "named loss", "clear error", "unprotected", *FAILURES]
    assert set("".join(cells(rule))) == {"-", ":"}
    assert len({line.count("|") for line in table}) == 1


def cells(line):
    """Return the cells of a row of a table in Markdown."""
    return [each.strip() for each in line.split("|")[1:-1]]


@pytest.mark.parametrize(
    ("status", "said", "verdict"),
    [
        (0, "", Verdict.RIGHT),
        (3, "replay: error: no space is left", Verdict.ERROR),
        (3, "Traceback", Verdict.CRASHED),
        (-6, "", Verdict.CRASHED),
        (None, "", Verdict.HUNG),
        (3, "replay: what now", Verdict.WRONG),
    ],
)
def test_whole_runs_are_judged_by_how_they_end_and_what_they_leave(status, said, verdict, tmp_path):
    (tmp_path / "in").mkdir()
    (tmp_path / "out").mkdir()
    (tmp_path / "in" / "run.mcap").write_bytes(whole_runs.SAMPLE.read_bytes())
    if status == 0:
        for name in whole_runs.FINALS:
            (tmp_path / "out" / name).touch()
    ended = whole_runs.Ended(status, said)
    assert whole_runs.judged(ended, tmp_path).verdict is verdict
    (tmp_path / "out" / "out.mcap.partial").touch()
    left = whole_runs.judged(ended, tmp_path)
    assert left.verdict is (Verdict.WRONG if status in {0, 3} and said != "Traceback" else verdict)


def test_equal_steps_are_merged_once(monkeypatch):
    merges = []
    step = Merger.step
    monkeypatch.setattr(Merger, "step", lambda *given, **named: merges.append(1) or step(*given, **named))
    monkeypatch.setattr(remembered, "_known", remembered.Known())
    for _ in range(2):
        worker.undamaged_run.cache_clear()
        worker.undamaged_run("mcap_none")
    assert len(merges) == len({each.log_time_ns for each in messages() if each.topic != "/chatter"})


def test_messages_are_laid_out_as_the_library_does():
    for each in messages():
        if each.topic != "/chatter":
            one, other = (
                decode(RawMessage(each.topic, each.msgtype, kind, 1, each.data(kind))) for kind in ("cdr", "ros1")
            )
            assert one.stamp_ns == other.stamp_ns == each.content.stamp_ns
    grid = decode(RawMessage("/m", messages()[0].msgtype, "cdr", 1, messages()[0].data("cdr"))).grid
    assert np.array_equal(grid.cells, robot_map("r1", 0).cells)
    assert changed(messages()[0], width=3).content.width == 3
