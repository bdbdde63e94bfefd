"""What speed is measured on, and how."""

import numpy as np
import pytest

from benchmarks import speed
from benchmarks.large import large_pair
from benchmarks.methods import DEFAULT, load_method


@pytest.fixture(scope="module")
def pair():
    return large_pair(260)


def test_large_maps_are_of_one_place_and_can_be_matched(pair):
    target, source = pair
    for grid in pair:
        assert min(grid.cells.shape) > 130
        assert set(np.unique(grid.cells)) == {-1, 0, 100}
    assert not target.same_as(source)
    assert load_method(DEFAULT)(*pair).accepted


def test_the_same_seed_gives_the_same_maps(pair):
    assert all(one.same_as(other) for one, other in zip(pair, large_pair(260), strict=True))


def test_a_line_says_sizes_times_and_ratios(pair):
    columns = speed.line(*pair, rounds=1).split()
    target, source = ("×".join(map(str, grid.cells.shape[::-1])) for grid in pair)
    assert columns[:3] == [target, "and", source]
    assert columns[4] == "ms"
    assert all(float(ratio) > 0.0 for ratio in columns[5:8])
    assert columns[8] == "accepted"
    assert len(speed.header().split("  ")) > 4


def test_contestants_take_turns_and_the_first_round_does_not_count():
    runs = []
    seconds = speed.timed({"a": lambda: runs.append("a"), "b": lambda: runs.append("b")}, rounds=2)
    assert runs == ["a", "b"] * 3
    assert set(seconds) == {"a", "b"}


def test_all_sizes_are_printed(capsys):
    speed.main(["--sides", "200", "240", "--rounds", "1"])
    assert len(capsys.readouterr().out.splitlines()) == 3
