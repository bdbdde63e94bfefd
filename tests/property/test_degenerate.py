"""Maps that show next to nothing, or the same from several sides: no method fails, and what is refused has a reason."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mapmerge.config import MergeConfig
from mapmerge.grid import Grid
from mapmerge.match import MATCHERS
from mapmerge.merger import Merger
from mapmerge.outcome import Status
from mapmerge.render import render
from mapmerge.sim2 import Sim2
from tests.floors import flat

FEW = settings().max_examples // 3
PLACES = [Sim2(), Sim2(12.3, -4.5, 0.7), Sim2(9e7, -9e7, -2.0), Sim2(0.0, 0.0, math.pi)]


def cells(rows, cols, value):
    return np.full((rows, cols), value, np.int8)


def one_wall(rows, cols):
    made = cells(rows, cols, 0)
    made[rows // 2] = 100
    return made


def room(side):
    made = cells(side, side, 0)
    made[[0, -1]] = made[:, [0, -1]] = 100
    return made


def disc(side):
    row, col = np.mgrid[:side, :side] - (side - 1) / 2
    away = np.hypot(row, col) - (side / 2 - 2)
    return np.where(np.abs(away) < 1, 100, np.where(away < 0, 0, -1)).astype(np.int8)


def checkers(side):
    return (np.indices((side, side)).sum(axis=0) % 2 * 100).astype(np.int8)


SHAPES = {
    "nothing": cells(0, 0, 0),
    "no rows": cells(0, 7, 0),
    "all unknown": cells(80, 90, -1),
    "all free": cells(80, 90, 0),
    "all occupied": cells(80, 90, 100),
    "neither": cells(80, 90, 45),
    "one cell": cells(1, 1, 100),
    "one known cell": np.pad(cells(1, 1, 100), 40, constant_values=-1),
    "one row": cells(1, 200, 100),
    "one column": cells(200, 1, 100),
    "two cells far apart": np.diag([100, *[-1] * 150, 100]).astype(np.int8) | np.int8(-1) * ~np.eye(152, dtype=bool),
    "one wall": one_wall(60, 140),
    "a square room": room(120),
    "a round room": disc(160),
    "checkers": checkers(100),
}
grids = st.builds(
    lambda name, resolution_m, place: Grid(SHAPES[name], resolution_m, place),
    st.sampled_from(sorted(SHAPES)),
    st.sampled_from([0.0001, 0.02, 0.05, 0.3, 10.0]),
    st.sampled_from(PLACES),
)


@pytest.mark.parametrize("method", sorted(MATCHERS))
@pytest.mark.parametrize("scale", ["metadata", "free"])
def test_no_method_fails(method, scale):
    @settings(max_examples=FEW)
    @given(grids, st.one_of(grids, st.just(flat())), st.booleans())
    def check(one, other, grows):
        merger = Merger(["a", "b"], MergeConfig(method=method, scale=scale))
        if grows:
            merger.step({"a": one, "b": Grid(other.cells[: other.rows // 2], other.resolution_m, other.map_from_grid)})
        result = merger.step({"a": one, "b": other}, is_last=True)
        for robot, outcome in result.robots.items():
            assert outcome.reason.message
            assert (outcome.merged_from_map is None) == (outcome.status in (Status.NO_MAP, Status.UNMERGED)), robot
            if outcome.merged_from_map is not None:
                assert np.isfinite(outcome.merged_from_map.matrix).all()
        for pair in result.pairs:
            for evidence in merger.explain(pair):
                render(evidence)

    check()


@pytest.mark.parametrize("name", ["a square room", "a round room", "one wall", "checkers", "all free", "all occupied"])
@pytest.mark.parametrize("turn", [0, 1, 2])
def test_what_looks_the_same_from_several_sides_is_refused(name, turn):
    """By the default method, which alone weighs placements against each other."""
    grid = Grid(SHAPES[name], 0.05)
    result = Merger(["a", "b"]).step({"a": grid, "b": Grid(np.rot90(grid.cells, turn).copy(), 0.05)}, is_last=True)
    assert result.robots["b"].status is Status.UNMERGED


@pytest.mark.parametrize("place", PLACES)
def test_a_map_fits_its_copy_where_it_lies(place):
    grid = flat()
    copy = Grid(grid.cells.copy(), grid.resolution_m, place @ grid.map_from_grid)
    found = Merger(["a", "b"]).step({"a": grid, "b": copy}, is_last=True).robots["b"]
    assert found.status is Status.MERGED
    error = found.merged_from_map @ place
    at_m = grid.middle_m
    assert error.is_close(Sim2(), distance_m=0.01, angle_rad=1e-3, at_m=at_m)


@pytest.mark.parametrize("method", sorted(MATCHERS))
@pytest.mark.parametrize("axis", [0, 1])
def test_a_mirrored_map_is_not_placed(method, axis):
    grid = flat(ragged=1)
    mirrored = Grid(np.flip(grid.cells, axis).copy(), grid.resolution_m)
    result = Merger(["a", "b"], MergeConfig(method=method)).step({"a": grid, "b": mirrored}, is_last=True)
    assert result.robots["b"].status is Status.UNMERGED
