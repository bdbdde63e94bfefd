"""Laws of fusion."""

import math
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from mapmerge import fuse as fuse_module
from mapmerge.config import CellConfig
from mapmerge.fuse import Canvas, fuse
from mapmerge.grid import Grid
from mapmerge.sim2 import IDENTITY, Sim2
from mapmerge.warp import Layer

CELLS = CellConfig()
values = st.integers(-1, 100)
shapes = st.tuples(st.integers(1, 12), st.integers(1, 12))
cells = hnp.arrays(np.int8, shapes, elements=values)
poses = st.builds(Sim2, st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.floats(-4.0, 4.0))
resolutions = st.sampled_from([0.1, 0.05, 0.08, 0.2, 0.03])
grids = st.builds(Grid, cells, st.just(0.1), poses)
LATTICE = Grid(np.zeros((1, 1), np.int8), 0.1)
HALF_A_CELL_OFF = Layer(Grid(np.zeros((3, 1), np.int8), 0.1), Sim2(y_m=0.25))
FINER = Layer(Grid(np.diag(np.array([1, 0, 0, 1], np.int8)) - np.int8(1), 0.09), IDENTITY)
TURNED_LATTICE = Grid(np.zeros((1, 1), np.int8), 0.1, Sim2(0.03, 0.02, 1.0))
layers = st.lists(st.builds(Layer, st.builds(Grid, cells, resolutions, poses), poses), min_size=1, max_size=4)


def entropy(p):
    return -(p * math.log(p) + (1 - p) * math.log(1 - p))


def papers_filter(first, second):
    """Equations 12 to 14 for two known cells, in percent: of p1, p2 and the combined p, that of the lowest entropy.

    None where the filter cannot choose between occupied and free.
    """
    p1, p2 = (min(max(value / 100, 0.01), 0.99) for value in (first, second))
    odds = math.log(p1 / (1 - p1)) + math.log(p2 / (1 - p2))
    choices = (p1, p2, 1 / (1 + math.exp(-odds)))
    lowest = min(map(entropy, choices))
    kept = [p for p in choices if math.isclose(entropy(p), lowest, abs_tol=1e-9)]
    if max(kept) - min(kept) > 1e-6 or math.isclose(kept[0], 0.5):
        return None
    return 100 * kept[0]


@pytest.mark.parametrize("first", range(-1, 101))
def test_two_maps_are_fused_by_the_papers_entropy_filter(first):
    row = np.arange(-1, 101, dtype=np.int8)[None]
    # a cell on either side that both know keeps the maps' borders where they are
    pair = [Grid(np.pad(line, ((0, 0), (1, 1))), 0.1) for line in (row, np.full_like(row, first))]
    merged = fuse([Layer(grid, IDENTITY) for grid in pair], pair[0], CELLS).grid.cells[0, 1:-1].tolist()
    for second, value in zip(range(-1, 101), merged, strict=True):
        if min(first, second) < 0:
            assert value == max(first, second)
            continue
        papers = papers_filter(first, second)
        assert value == -1 if papers is None else abs(value - papers) <= 0.5 + 1e-4


@given(layers, grids, st.randoms())
def test_the_order_of_the_maps_does_not_matter(placed, lattice, random):
    order = list(range(len(placed)))
    random.shuffle(order)
    first = fuse(placed, lattice, CELLS)
    second = fuse([placed[index] for index in order], lattice, CELLS)
    assert second.grid.same_as(first.grid)
    assert second.agreements == tuple(first.agreements[index] for index in order)


@given(layers, grids)
@example([FINER], TURNED_LATTICE)
def test_no_cell_comes_from_nowhere(placed, lattice):
    """A merged cell that is known has a known cell of a map within a diagonal of the coarser one's cells."""
    merged = fuse(placed, lattice, CELLS).grid
    points_m = merged.centres_m(merged.known)
    nearest_m = np.full(len(points_m), np.inf)
    for layer in placed:
        known_m = layer.merged_from_map.apply(layer.grid.centres_m(layer.grid.known))
        if len(known_m) and len(points_m):
            away_m = np.hypot(*(points_m[:, None] - known_m[None]).transpose(2, 0, 1)).min(axis=1)
            reach_m = math.sqrt(2) * max(layer.grid.resolution_m, lattice.resolution_m)
            nearest_m = np.minimum(nearest_m, away_m - reach_m)
    assert (nearest_m <= 1e-9).all()


@given(layers, grids)
def test_values_stay_in_range_and_agreements_are_shares(placed, lattice):
    fusion = fuse(placed, lattice, CELLS)
    assert np.isin(fusion.grid.cells, np.arange(-1, 101)).all()
    for agreement in fusion.agreements:
        assert 0.0 <= agreement.acceptance <= 1.0
        assert 0.0 <= agreement.overlap_fraction <= 1.0
        assert agreement.overlap_m2 >= 0.0


@given(layers, grids, st.integers(1, 9))
@example([HALF_A_CELL_OFF], LATTICE, 1)
def test_tiles_do_not_matter(placed, lattice, tile):
    whole = fuse(placed, lattice, CELLS)
    with patch.object(fuse_module, "TILE_CELLS", tile):
        tiled = fuse(placed, lattice, CELLS)
    assert tiled.grid.same_as(whole.grid)
    assert tiled.agreements == whole.agreements


@given(grids)
def test_a_map_alone_is_itself(grid):
    merged = fuse([Layer(grid, IDENTITY)], grid, CELLS).grid
    np.testing.assert_array_equal(merged.cells, grid.cropped_to_known().cells)


@given(grids, st.integers(2, 5))
def test_copies_of_a_map_agree(grid, count):
    fusion = fuse([Layer(grid, IDENTITY)] * count, grid, CELLS)
    has_classed = ((grid.cells >= 65) | ((grid.cells >= 0) & (grid.cells <= 25))).any()
    for agreement in fusion.agreements:
        assert agreement.acceptance == (1.0 if has_classed else 0.0)
        assert agreement.overlap_m2 == pytest.approx(grid.known_area_m2)


@st.composite
def histories(draw):
    """Return layers by name at some times: maps that change in a part, grow, move, come and go."""
    rng = np.random.default_rng(draw(st.integers(0, 10_000)))
    poses = [IDENTITY, Sim2(0.31, -0.2, 0.4), Sim2(-1.0, 0.5, -2.0), Sim2(0.5, 0.25), Sim2(2.0, 0.0, 0.0, 1.3)]
    resolutions = {name: draw(st.sampled_from([0.05, 0.05, 0.1, 0.025])) for name in "abc"}
    cells = {name: rng.choice([-1, 0, 30, 100], (40, 50)).astype(np.int8) for name in "abc"}
    corners = dict.fromkeys("abc", (0, 0))
    placed = {name: draw(st.sampled_from(poses)) for name in "abc"}
    grids = {}
    times = []
    for _ in range(draw(st.integers(1, 5))):
        for name in sorted(draw(st.sets(st.sampled_from("abc"))) | (set() if grids else set("abc"))):
            what = draw(st.sampled_from(["part", "grow", "move", "same"]))
            if what == "part":
                cells[name] = cells[name].copy()
                cells[name][5:20, 7:30] = rng.choice([-1, 0, 80], (15, 23))
            elif what == "grow":
                margins = rng.integers(0, 6, (2, 2))
                cells[name] = np.pad(cells[name], margins, constant_values=-1)
                corners[name] = corners[name][0] + int(margins[0, 0]), corners[name][1] + int(margins[1, 0])
                cells[name][:4] = rng.choice([-1, 0, 100], (4, cells[name].shape[1]))
            elif what == "move":
                placed[name] = draw(st.sampled_from(poses))
            resolution_m = resolutions[name]
            origin = Sim2(-corners[name][1] * resolution_m, -corners[name][0] * resolution_m)
            grids[name] = Grid(cells[name].copy(), resolution_m, Sim2(yaw_rad=0.3) @ origin)
        shown = draw(st.sets(st.sampled_from("abc"), min_size=1))
        times.append({name: Layer(grids[name], placed[name]) for name in sorted(shown)})
    return times, resolutions


@given(histories())
def test_a_canvas_that_is_kept_up_to_date_is_what_is_fused_anew(history):
    times, resolutions = history
    lattice = Grid(np.zeros((3, 3), np.int8), resolutions["a"], Sim2(0.02, 0.01))
    canvas = Canvas(CELLS)
    for layers in times:
        kept, anew = canvas.update(layers, lattice), Canvas(CELLS).update(layers, lattice)
        assert kept.agreements == anew.agreements
        np.testing.assert_array_equal(kept.grid.cells, anew.grid.cells)
        assert kept.grid.map_from_grid == anew.grid.map_from_grid
        assert canvas.update(layers, lattice).grid is kept.grid


@given(layers, grids, cells, poses, st.sampled_from([0.05, 0.1, 0.2]))
def test_what_is_unknown_is_neutral(placed, lattice, blank, pose, resolution_m):
    """A map in which nothing is known changes no cell and no agreement."""
    nothing = Layer(Grid(np.full_like(blank, -1), resolution_m), pose)
    first, second = fuse(placed, lattice, CELLS), fuse([*placed, nothing], lattice, CELLS)
    assert second.grid.same_as(first.grid)
    assert second.agreements[:-1] == first.agreements
    assert second.agreements[-1].overlap_m2 == 0.0


@given(st.lists(hnp.arrays(np.int8, (5, 7), elements=values), min_size=1, max_size=5))
def test_every_cell_is_what_more_says(arrays):
    """On the same cells: unknown only where all are or none prevails, else on the side with the larger log odds."""
    stack = np.stack([np.pad(array, 1) for array in arrays])
    merged = fuse([Layer(Grid(each, 0.1), IDENTITY) for each in stack], Grid(stack[0], 0.1), CELLS).grid.cells
    p = np.clip(stack / 100.0, 0.01, 0.99)
    odds = np.where(stack >= 0, np.log(p / (1 - p)), 0.0)
    occupied, free = np.maximum(odds, 0.0).sum(axis=0), -np.minimum(odds, 0.0).sum(axis=0)
    known = (stack >= 0).any(axis=0)
    assert (merged[~known] == -1).all()
    clear = known & (np.abs(occupied - free) > 1e-5)
    assert (merged[clear & (occupied > free)] >= 50).all()
    assert ((merged[clear & (occupied < free)] >= 0) & (merged[clear & (occupied < free)] <= 50)).all()
