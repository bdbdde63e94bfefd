"""What speed is measured on, and how."""

import numpy as np
import pytest

from benchmarks.cases import cases
from benchmarks.large import large_pair
from benchmarks.long_mission import Mission
from benchmarks.made_once import recorded
from benchmarks.methods import DEFAULT, load_method
from benchmarks.speed import alone, child, cold, pairs, warm
from benchmarks.speed.__main__ import SECTIONS, main, show
from benchmarks.speed.merging import merger
from benchmarks.speed.options import Options
from benchmarks.speed.printed import Table, at_most
from benchmarks.speed.replaying import last_messages, map_topics, mean_cells, replay_s
from benchmarks.speed.timing import timed
from replay.codec import decode


@pytest.fixture(scope="module")
def pair():
    return large_pair(260)


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """Sizes at which each section takes a moment."""
    return Options(
        work=tmp_path_factory.mktemp("work"),
        rounds=1,
        sides=(200, 240),
        share=0.01,
        warm_sides=(200, 240),
        side=240,
        updates=3,
        memory_side=200,
        memory_updates=(2, 4),
        growth_sides=(200, 240),
        growth_robots=(2, 3),
        growth_side=200,
        growth_updates=2,
    )


@pytest.fixture(scope="module")
def mission(small):
    return recorded(Mission(2, small.updates, small.side), small.work)


class TestLargePair:
    def test_is_of_one_place_and_can_be_matched(self, pair):
        target, source = pair
        for grid in pair:
            assert min(grid.cells.shape) > 130
            assert set(np.unique(grid.cells)) == {-1, 0, 100}
        assert not target.same_as(source)
        assert load_method(DEFAULT)(*pair).accepted

    def test_is_the_same_for_the_same_seed(self, pair):
        assert all(one.same_as(other) for one, other in zip(pair, large_pair(260), strict=True))


class TestSections:
    def test_cold_says_sizes_times_and_ratios(self, pair):
        columns = cold.line(*pair, rounds=1).split()
        target, source = ("×".join(map(str, grid.cells.shape[::-1])) for grid in pair)
        assert columns[:3] == [target, "and", source]
        assert columns[4] == "ms"
        assert all(float(ratio) > 0.0 for ratio in columns[5:8])
        assert columns[8] == "accepted"

    @pytest.mark.parametrize(
        ("name", "rows", "targets"),
        [("cold", 2, 0), ("warm", 2, 1), ("replay", 1, 1), ("memory", 2, 1), ("startup", 3, 1), ("growth", 4, 0)],
    )
    def test_print_a_row_for_each_size_and_what_must_hold(self, name, rows, targets, small, capsys):
        show([name], small)
        _, title, _, header, *lines = capsys.readouterr().out.splitlines()
        assert title == SECTIONS[name][0]
        judged = [line for line in lines if line.startswith(("holds  ", "FAILS  "))]
        table = [line for line in lines if line and line not in judged]
        assert (len(table), len(judged)) == (rows, targets)
        assert all(len(line) <= len(header) for line in table)

    def test_pairs_are_those_of_the_truth_bench(self, small, monkeypatch):
        monkeypatch.setattr(pairs, "cases", lambda share: cases(share)[:1])
        (found,) = pairs.measured(small)
        assert found.related == "same place"
        assert found.sifts == found.match_s / found.sift_s > 0.0

    def test_pairs_that_took_a_second_look_are_held_against_the_others(self, small, monkeypatch):
        timed_pairs = [
            pairs.Timed("same place", 1.0, 1.0, looked_twice=False),
            pairs.Timed("same place", 2.0, 1.0, looked_twice=False),
            pairs.Timed("same place", 3.0, 1.0, looked_twice=False),
            pairs.Timed("next floor", 8.0, 1.0, looked_twice=True),
        ]
        monkeypatch.setattr(pairs, "measured", lambda _: iter(timed_pairs))
        header, *rows, judged = pairs.lines(small)
        assert [row.split()[-1] for row in rows] == ["25%", "0%", "100%", "0%", "100%"]
        assert all(len(row) == len(header) for row in rows)
        assert judged == "FAILS  a second look, to a match that is clear at first, at most 3: 4.00"

    def test_a_second_look_is_noticed(self):
        one, other = large_pair(400)
        strange = large_pair(300, seed=3)[1]
        assert not pairs.takes_a_second_look(one, other)
        assert pairs.takes_a_second_look(one, strange)

    def test_the_command_runs_those_that_are_asked_for(self, capsys, tmp_path, monkeypatch):
        monkeypatch.setenv("REPLAY_DATA", str(tmp_path))
        main(["--sections", "cold", "memory", "--sides", "200", "--rounds", "1", "--memory-side", "200",
              "--memory-updates", "2", "--work", str(tmp_path / "kept")])  # fmt: skip
        said = capsys.readouterr().out
        assert all((SECTIONS[name][0] in said) == (name in ("cold", "memory")) for name in SECTIONS)
        assert list((tmp_path / "kept").glob("mission_2x2_200*.mcap"))

    @pytest.mark.parametrize("arguments", [["--rounds", "0"], ["--share", "0"], ["--sections", "none"]])
    def test_the_command_refuses_what_cannot_be_measured(self, arguments):
        with pytest.raises(SystemExit):
            main(arguments)


class TestWhatIsMeasured:
    def test_contestants_take_turns_and_the_first_round_does_not_count(self):
        runs = []
        seconds = timed({"a": lambda: runs.append("a"), "b": lambda: runs.append("b")}, rounds=2)
        assert runs == ["a", "b"] * 3
        assert set(seconds) == {"a", "b"}

    def test_a_program_has_its_own_peak_and_fails_aloud(self, mission, tmp_path):
        arguments = ["merge", str(mission), "-o", str(tmp_path / "out.mcap"), "--no-rrd"]
        ended = child.replay(arguments)
        assert ended.peak_bytes > 2**20
        assert (tmp_path / "out.mcap").exists()
        with pytest.raises(RuntimeError, match="there is already"):
            child.replay(arguments)

    def test_a_replay_writes_what_is_written_again_alone(self, mission, tmp_path):
        merged, copy = tmp_path / "merged.mcap", tmp_path / "copy.mcap"
        assert replay_s(mission, merged) > 0.0
        assert alone.write_s(merged, copy) > 0.0
        written, again = (last_messages(path, 100) for path in (merged, copy))
        assert [bytes(raw.data) for raw in written] == [bytes(raw.data) for raw in again]
        assert len(written) > 1

    def test_maps_are_counted(self, mission, small):
        assert map_topics(mission) == {"/r1/map": small.updates, "/r2/map": small.updates}
        assert alone.read_s(mission, map_topics(mission)) > 0.0
        assert mean_cells(mission) / np.mean([decode(raw).grid.cells.size for raw in last_messages(mission, 6)]) > 0.5

    def test_the_merger_goes_on_from_map_to_map(self, mission):
        take = merger(["r1", "r2"])
        for raw in last_messages(mission, 4):
            result = take({raw.topic.split("/")[1]: decode(raw).grid})
        assert result.robots["r2"].merged_from_map is not None

    def test_robots_drive_as_far_between_two_maps_of_any_size(self):
        options = Options(work=None)
        assert warm.mission_of(2000, options).updates == 300
        assert warm.mission_of(1000, options).updates == 75
        assert warm.mission_of(400, options).updates == 40


class TestPrinted:
    def test_columns_are_aligned(self):
        table = Table(8, ("name", "number of them", "time"))
        assert table.header.endswith("      time")
        assert len(table.header) == len(table.row("a", "1", "2 ms"))

    def test_a_target_holds_or_fails(self):
        assert at_most("ratio", 2.0, 2.0) == "holds  ratio, at most 2: 2.00"
        assert at_most("ratio", 2.1, 2.0).startswith("FAILS")
