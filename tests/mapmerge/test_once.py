"""All maps at once: what may be given, and what is said of what may not."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import mapmerge
from mapmerge import ConfigError, Grid, GridError, MergeConfig, Merger, Prior, Sim2, Status
from tests.floors import office_pair


@cache
def two_maps() -> tuple[Grid, Grid]:
    pair = office_pair(1)
    return pair.target, pair.source


def test_it_is_a_merger_of_one_step():
    one, two = two_maps()
    result = mapmerge.merge({"a": one, "b": two})
    stepped = Merger(["a", "b"]).step({"a": one, "b": two}, is_last=True)
    assert result.poses == stepped.poses
    assert list(result.poses) == ["a", "b"]
    assert result.merged.same_as(stepped.merged)


def test_a_list_has_names_by_number():
    one, two = two_maps()
    result = mapmerge.merge([one, two])
    assert list(result.robots) == ["map0", "map1"]
    assert result.robots["map0"].status is Status.REFERENCE


@pytest.mark.parametrize("kind", [np.int8, np.int16, np.int64])
def test_arrays_of_whole_numbers_are_maps(kind):
    one, _ = two_maps()
    cells = one.cells.astype(kind)
    (grid,) = mapmerge.merge([cells], resolution_m=0.05).grids.values()
    assert grid.cells.dtype == np.int8
    assert np.array_equal(grid.cells, one.cells)


@pytest.mark.parametrize(
    ("cells", "resolution_m", "said"),
    [
        (np.zeros((3, 3), np.int8), None, "map0 is an array; give resolution_m"),
        (np.zeros((3, 3)), 0.1, "map0 has cells of float64; expected whole numbers"),
        (np.full((3, 3), 255, np.uint8), 0.1, "map0 has cells between 255 and 255; expected -1"),
        (np.zeros(3, np.int8), 0.1, "expected int8 \\[rows, columns\\]"),
        (np.zeros((3, 3), np.int8), 0.0, "resolution is 0.0 m"),
    ],
)
def test_arrays_that_are_no_map(cells, resolution_m, said):
    with pytest.raises(GridError, match=said):
        mapmerge.merge([cells], resolution_m=resolution_m)


def test_no_map_is_refused():
    for grids in ([], {}):
        with pytest.raises(ConfigError, match="there is no map"):
            mapmerge.merge(grids)


def test_settings_and_priors_are_those_of_a_merger():
    one, two = two_maps()
    with pytest.raises(ConfigError, match="no method"):
        mapmerge.merge([one, two], MergeConfig(method="guess"))
    placed = mapmerge.merge([one, two]).poses["map1"]
    wrong = Prior(Sim2(placed.x_m + 40.0, placed.y_m, placed.yaw_rad), 0.5, 0.5, 0.1)
    outcome = mapmerge.merge([one, two], priors={"map1": wrong}).robots["map1"]
    assert outcome.status is Status.UNMERGED
    assert "the placement given" in outcome.reason.message


def test_what_is_printed_is_short_and_says_where_and_why():
    one, two = two_maps()
    result = mapmerge.merge([one, two])
    lines = str(result).splitlines()
    assert lines[0] == "map0: reference at x 0.00 m, y 0.00 m, yaw 0.0°: its map frame is the merged frame"
    assert lines[1].startswith(f"map1: merged at {result.poses['map1']}: placed on map0: ")
    assert repr(result) == "<MergeResult map0: reference, map1: merged>"
    assert repr(one).startswith(f"<Grid of {one.cols} × {one.rows} cells of 0.05 m, corner at x ")
    assert str(Sim2(1.0, -2.0, np.pi / 2, 1.25)) == "x 1.00 m, y -2.00 m, yaw 90.0°, scale 1.250"
    # no zero has a sign, and a scale of 1 but for rounding is none
    assert str(Sim2(-0.001, -1e-9, -1e-6, 1.0 + 1e-12)) == "x 0.00 m, y 0.00 m, yaw 0.0°"
    assert Sim2(1.0, -2.0, np.pi / 2, 1.25).in_words(3) == "x 1.000 m, y -2.000 m, yaw 90.00°"


def test_all_names_are_listed_before_they_are_asked_for():
    assert set(mapmerge.__all__) <= set(dir(mapmerge))
