"""Fusion: where cells land, what they become, and how the maps agree."""

import itertools
import math

import numpy as np
import pytest

from mapmerge import fuse as fuse_module
from mapmerge.config import CellConfig
from mapmerge.fuse import Canvas, fuse
from mapmerge.grid import Grid
from mapmerge.odds import LogOdds
from mapmerge.sim2 import IDENTITY, Sim2
from mapmerge.warp import Layer

CELLS = CellConfig()


def grid_of(cells, resolution_m=0.1, origin=IDENTITY):
    return Grid(np.atleast_2d(np.array(cells, np.int8)), resolution_m, origin)


def fused(*grids, poses=None, lattice=None):
    poses = poses or [IDENTITY] * len(grids)
    layers = [Layer(grid, pose) for grid, pose in zip(grids, poses, strict=True)]
    return fuse(layers, lattice or grids[0], CELLS)


def one_cell(*values):
    """Return what a cell becomes that the maps give these values; all maps know the cells beside it."""
    cell = fused(*(grid_of([0, value, 0]) for value in values)).grid.cells[0, 1]
    return int(cell)


def blob(seed, rows=24, cols=30):
    """Return random cells, a third of them unknown."""
    rng = np.random.default_rng(seed)
    cells = rng.integers(0, 101, (rows, cols))
    return np.where(rng.uniform(size=cells.shape) < 0.33, -1, cells).astype(np.int8)


def read_at(grid, merged_from_map, points_m):
    """Return a map's values at points of the merged frame, and whether they lie safely off the borders of cells."""
    inside = (merged_from_map @ grid.map_from_grid).inverse().apply(points_m) / grid.resolution_m
    cell = np.floor(inside).astype(int)
    safe = (np.abs(inside - np.rint(inside)) > 0.01).all(axis=1)
    within = ((cell >= 0) & (cell < (grid.cols, grid.rows))).all(axis=1)
    values = np.full(len(points_m), -1)
    values[within] = grid.cells[cell[within, 1], cell[within, 0]]
    return values, safe


def expected(values):
    """Equation 5 for one cell, in floating point, from scratch."""
    known = [value for value in values if value >= 0]
    if len(known) < 2:
        return known[0] if known else -1
    odds = [math.log(p / (1 - p)) for p in (min(max(value / 100, 0.01), 0.99) for value in known)]
    up, down = sum(odd for odd in odds if odd > 0), -sum(odd for odd in odds if odd < 0)
    if abs(up - down) < 1e-5:
        return -1
    return round(100 / (1 + math.exp(-up if up > down else down)))


class TestCells:
    @pytest.mark.parametrize(
        ("values", "outcome"),
        [
            ((-1, -1), -1),
            ((70, -1), 70),
            ((-1, 100), 100),
            ((0, -1), 0),
            ((50, -1), 50),
            ((90, 10), -1),
            ((100, 0), -1),
            ((100, 1), -1),
            ((50, 50), -1),
            ((50, 80), 80),
            ((90, 5), 5),
            ((95, 10), 95),
            ((90, 80), 97),
            ((20, 20), 6),
            ((90, 90, 5), 99),
            ((80, 20, 60), 86),
            ((80, -1, 20, 60, 40), -1),
        ],
    )
    def test_by_hand(self, values, outcome):
        assert one_cell(*values) == outcome
        assert one_cell(*values[::-1]) == outcome

    @pytest.mark.parametrize("percent", range(50))
    def test_opposite_values_are_a_tie(self, percent):
        assert one_cell(percent, 100 - percent) == -1

    def test_two_against_one_does_not_depend_on_the_order(self):
        assert {one_cell(*order) for order in itertools.permutations((90, 90, 5))} == {99}

    def test_many_maps_that_agree_become_certain_and_no_more(self):
        assert one_cell(*[100] * 40) == 100
        assert one_cell(*[0] * 40) == 0

    def test_one_map_passes_unchanged(self):
        cells = blob(1)
        merged = fused(grid_of(cells)).grid
        np.testing.assert_array_equal(merged.cells, cells)

    def test_every_cell_of_three_maps_is_as_computed_by_hand(self):
        grids = [grid_of(blob(seed)) for seed in (1, 2, 3)]
        merged = fused(*grids).grid.cells
        by_hand = [expected(values) for values in zip(*(grid.cells.ravel().tolist() for grid in grids), strict=True)]
        assert merged.ravel().tolist() == by_hand


class TestPlaces:
    def test_whole_shift_copies_cells_as_they_are(self):
        cells = blob(4)
        merged = fused(grid_of(cells), grid_of(cells), poses=[IDENTITY, Sim2(5.0, 3.0)]).grid
        assert merged.cells.shape == (24 + 30, 30 + 50)
        np.testing.assert_array_equal(merged.cells[:24, :30], cells)
        np.testing.assert_array_equal(merged.cells[30:, 50:], cells)
        assert merged.known.sum() == 2 * (cells >= 0).sum()

    @pytest.mark.parametrize("quarters", [1, 2, 3])
    def test_quarter_turns_copy_cells_as_they_are(self, quarters):
        cells = blob(5)
        cells[0, :] = cells[-1, :] = cells[:, 0] = cells[:, -1] = 0
        turned = fused(grid_of(cells), poses=[Sim2(yaw_rad=quarters * math.pi / 2)]).grid
        np.testing.assert_array_equal(turned.cells, np.rot90(cells, -quarters))

    @pytest.mark.parametrize("pose", [Sim2(0.31, -0.77), Sim2(2.0, 1.0, 0.4), Sim2(-1.234, 0.5, -2.2), Sim2(0, 0, 3.0)])
    @pytest.mark.parametrize("origin", [IDENTITY, Sim2(-1.0, 2.0, 1.1)])
    def test_every_merged_cell_is_as_computed_by_hand(self, pose, origin):
        layers = [
            (grid_of(blob(6), origin=Sim2(0.5, 0.25, 0.9)), IDENTITY),
            (grid_of(blob(7), origin=origin), pose),
            (grid_of(blob(8), origin=Sim2(1.0, 1.0)), pose.inverse()),
        ]
        merged = fused(*(grid for grid, _ in layers), poses=[pose for _, pose in layers]).grid
        points_m = merged.centres_m(np.ones(merged.cells.shape, bool))
        read = [read_at(grid, pose, points_m) for grid, pose in layers]
        safe = np.all([mask for _, mask in read], axis=0)
        assert safe.mean() > 0.8
        by_hand = np.array([expected(values) for values in np.transpose([values for values, _ in read]).tolist()])
        np.testing.assert_array_equal(merged.cells.ravel()[safe], by_hand[safe])
        assert (by_hand[safe] >= 0).sum() > 1000

    @pytest.mark.parametrize("pose", [Sim2(0.31, -0.77), Sim2(2.0, 1.0, 0.4), Sim2(-40.0, 33.3, -2.2)])
    def test_nothing_known_is_cut_off(self, pose):
        cells = np.full((20, 30), 10, np.int8)
        merged = fused(grid_of([[0]]), grid_of(cells), poses=[IDENTITY, pose]).grid
        assert merged.known_area_m2 == pytest.approx(601 * 0.01, rel=0.02)

    def test_scaled_map(self):
        cells = np.array([[10, 90], [-1, 30]], np.int8)
        merged = fused(grid_of(cells), poses=[Sim2(scale=3.0)]).grid
        np.testing.assert_array_equal(merged.cells, np.kron(cells, np.ones((3, 3), np.int8)))


ORIGINS = [IDENTITY, Sim2(1.23, -4.56), Sim2(3.0, 2.0, 0.7), Sim2(-7.0, 0.1, -2.9), Sim2(500_000.0, 5e6, 0.3)]


class TestLattice:
    @pytest.mark.parametrize("origin", ORIGINS)
    def test_merged_cells_fall_on_the_cells_of_the_reference(self, origin):
        reference = grid_of(blob(9), 0.1, origin)
        other = grid_of(blob(10), 0.05, Sim2(0.3, 0.2, 1.0))
        merged = fused(reference, other, poses=[IDENTITY, origin @ Sim2(-1.0, 2.0, 0.6)]).grid
        assert merged.resolution_m == reference.resolution_m
        between = reference.map_from_grid.inverse() @ merged.map_from_grid
        cells = np.array([between.x_m, between.y_m]) / reference.resolution_m
        np.testing.assert_allclose(cells, np.rint(cells), atol=1e-5)
        assert between.yaw_rad == pytest.approx(0.0, abs=1e-12)
        assert merged.rows > reference.rows

    @pytest.mark.parametrize("origin", ORIGINS)
    def test_what_only_the_reference_knows_stays_as_it_is(self, origin):
        reference = grid_of(blob(9), 0.1, origin)
        merged = fused(reference, grid_of([[0]]), poses=[IDENTITY, origin @ Sim2(8.0, 8.0)]).grid
        np.testing.assert_array_equal(merged.cells[:24, :30], reference.cells)

    @pytest.mark.parametrize("resolution_m", [float(np.float32(0.05)), 0.05 + 1e-9])
    def test_a_resolution_off_by_rounding_copies_cells_as_they_are(self, resolution_m):
        cells = blob(11, 300, 400)
        merged = fused(grid_of(cells, resolution_m), lattice=grid_of([[0]], 0.05)).grid
        np.testing.assert_array_equal(merged.cells, cells)


class TestResolutions:
    @pytest.mark.parametrize("yaw_rad", [0.0, 0.5, math.pi / 2, 2.0])
    def test_a_thin_wall_of_a_finer_map_survives(self, yaw_rad):
        cells = np.zeros((200, 300), np.int8)
        cells[100, 20:280] = 100
        coarse = grid_of(np.full((80, 80), -1), 0.1)
        merged = fused(coarse, grid_of(cells, 0.02, Sim2(-3.0, -2.0)), poses=[IDENTITY, Sim2(yaw_rad=yaw_rad)]).grid
        along_wall = Sim2(3.0, 2.0) @ Sim2(yaw_rad=-yaw_rad)
        walls_m = along_wall.apply(merged.centres_m(merged.cells >= 65))
        assert np.abs(walls_m[:, 1] - 2.01).max() < 0.15
        along = np.histogram(walls_m[:, 0], bins=np.arange(0.4, 5.61, 0.2))[0]
        assert (along > 0).all()

    def test_a_coarser_map_fills_the_finer_cells(self):
        merged = fused(grid_of([[-1, -1]], 0.05), grid_of([[10, 90], [-1, 30]], 0.1)).grid
        assert merged.resolution_m == 0.05
        np.testing.assert_array_equal(merged.cells, np.kron([[10, 90], [-1, 30]], np.ones((2, 2), np.int8)))

    @pytest.mark.parametrize(("mine", "theirs"), [(0.05, 0.08), (0.08, 0.05), (0.05, 0.03), (0.1, 0.025)])
    def test_known_area_is_about_kept(self, mine, theirs):
        other = grid_of(np.zeros((90, 110)), theirs)
        merged = fused(grid_of([[-1]], mine), other, poses=[IDENTITY, Sim2(1.0, 1.0, 0.3)]).grid
        assert merged.known_area_m2 == pytest.approx(other.known_area_m2, rel=0.04)


class TestEmpty:
    @pytest.mark.parametrize("cells", [np.zeros((0, 0)), np.zeros((0, 4)), np.full((3, 4), -1)])
    def test_maps_that_know_nothing_merge_to_nothing(self, cells):
        empty = Grid(np.asarray(cells, np.int8), 0.1, Sim2(1.0, 2.0, 0.3))
        fusion = fused(empty, empty, poses=[IDENTITY, Sim2(3.0)])
        assert fusion.grid.cells.size == 0
        assert fusion.grid.resolution_m == 0.1
        assert [agreement.overlap_m2 for agreement in fusion.agreements] == [0.0, 0.0]

    def test_a_map_that_knows_nothing_changes_nothing(self):
        known, empty = grid_of(blob(1)), grid_of(np.full((50, 60), -1))
        fusion = fused(known, empty, poses=[IDENTITY, Sim2(-2.0, -2.0)])
        assert fusion.grid.same_as(fused(known).grid)
        assert fusion.agreements[1].overlap_fraction == 0.0

    def test_an_empty_reference_still_gives_the_lattice(self):
        empty = Grid(np.zeros((0, 0), np.int8), 0.1, Sim2(0.05, 0.02))
        merged = fused(empty, grid_of(blob(2)), poses=[IDENTITY, Sim2(0.05, 0.02)]).grid
        np.testing.assert_array_equal(merged.cells, blob(2))
        assert (merged.map_from_grid.x_m, merged.map_from_grid.y_m) == pytest.approx((0.05, 0.02))


def slow_agreements(grids):
    """Equation 3 for each map against the fusion of the others, cell by cell; all maps on one lattice."""
    stack = [grid.cells.ravel().tolist() for grid in grids]
    low, high = (25, 65)
    cell_m2 = grids[0].resolution_m ** 2
    found = []
    for index, own in enumerate(stack):
        others = [expected_odds(values) for values in zip(*(s for i, s in enumerate(stack) if i != index), strict=True)]
        agree = disagree = both = 0
        for mine, theirs in zip(own, others, strict=True):
            if mine < 0 or theirs is None:
                continue
            both += 1
            occupied, free = theirs >= logit(high) - 1e-6, theirs <= logit(low) + 1e-6
            agree += (mine >= high and occupied) or (mine <= low and free)
            disagree += (mine >= high and free) or (mine <= low and occupied)
        known = sum(value >= 0 for value in own)
        others_known = sum(theirs is not None for theirs in others)
        fraction = both / min(known, others_known) if both else 0.0
        found.append((agree / (agree + disagree) if agree else 0.0, both * cell_m2, fraction))
    return found


def logit(percent):
    p = min(max(percent / 100, 0.01), 0.99)
    return math.log(p / (1 - p))


def expected_odds(values):
    known = [logit(value) for value in values if value >= 0]
    if not known:
        return None
    up, down = sum(odd for odd in known if odd > 0), sum(odd for odd in known if odd < 0)
    return 0.0 if abs(up + down) < 1e-5 else max(up, down, key=abs)


class TestAgreement:
    @pytest.mark.parametrize("count", [2, 3, 5])
    def test_is_equation_3_cell_by_cell(self, count):
        rng = np.random.default_rng(count)
        truth = rng.choice([3, 40, 95], (20, 25))
        grids = []
        for seed in range(count):
            seen = np.clip(truth + rng.normal(0, 30, truth.shape), 0, 100)
            grids.append(grid_of(np.where(blob(seed, 20, 25) < 0, -1, seen)))
        fusion = fused(*grids)
        for agreement, slow in zip(fusion.agreements, slow_agreements(grids), strict=True):
            assert (agreement.acceptance, agreement.overlap_m2, agreement.overlap_fraction) == pytest.approx(slow)
        assert 0.5 < fusion.agreements[0].acceptance < 1.0

    def test_a_map_alone_agrees_with_nothing(self):
        (agreement,) = fused(grid_of(blob(1))).agreements
        assert (agreement.acceptance, agreement.overlap_m2, agreement.overlap_fraction) == (0.0, 0.0, 0.0)

    def test_without_overlap_all_is_zero(self):
        fusion = fused(grid_of(blob(1)), grid_of(blob(2)), poses=[IDENTITY, Sim2(50.0)])
        for agreement in fusion.agreements:
            assert (agreement.acceptance, agreement.overlap_m2, agreement.overlap_fraction) == (0.0, 0.0, 0.0)

    def test_cells_of_one_class_only_in_one_map_count_for_nothing(self):
        first, second = fused(grid_of([100, 0, 100, 50]), grid_of([100, 50, 0, 0])).agreements
        assert first.acceptance == second.acceptance == 0.5
        assert first.overlap_fraction == 1.0

    @pytest.mark.parametrize(("value", "acceptance"), [(25, 1.0), (26, 0.0), (65, 0.0)])
    def test_class_limits_are_those_of_the_settings(self, value, acceptance):
        """The second cell disagrees only if it is classed; a map agrees with a copy of itself in the first."""
        fusion = fused(grid_of([value]), grid_of([0]))
        assert fusion.agreements[0].acceptance == acceptance

    def test_acceptance_from_65_on(self):
        assert fused(grid_of([65]), grid_of([100])).agreements[0].acceptance == 1.0
        assert fused(grid_of([64]), grid_of([100])).agreements[0].acceptance == 0.0


class TestCanvas:
    def test_a_grid_that_was_given_away_stays_as_it_is(self):
        canvas, before = Canvas(CELLS), blob(1)
        after = before.copy()
        after[3:6, 4:9] = 100 - np.maximum(before[3:6, 4:9], 0)
        given = canvas.update({"a": Layer(grid_of(before), IDENTITY)}, grid_of(before)).grid
        copied = given.cells.copy()
        again = canvas.update({"a": Layer(grid_of(before.copy()), IDENTITY)}, grid_of(before)).grid
        assert again is given
        changed = canvas.update({"a": Layer(grid_of(after), IDENTITY)}, grid_of(before)).grid
        assert np.array_equal(given.cells, copied)
        assert changed.same_as(fused(grid_of(after)).grid)

    @pytest.mark.parametrize("pose", [IDENTITY, Sim2(0.7, -0.3), Sim2(0.31, -0.77, 0.4), Sim2(2.0, 1.0, -2.2)])
    @pytest.mark.parametrize("cell", [(8, 16), (7, 15), (0, 0), (23, 29), (16, 8)])
    def test_one_cell_renews_no_more_than_the_tiles_around_it(self, monkeypatch, pose, cell):
        monkeypatch.setattr(fuse_module, "TILE_CELLS", 8)
        other = Layer(grid_of(blob(2, 40, 40)), Sim2(-0.5, -0.5))
        before = blob(1)
        before[[0, 0, -1, -1], [0, -1, 0, -1]] = 0
        after = before.copy()
        after[cell] = 100 if before[cell] < 50 else 0
        canvas = Canvas(CELLS)
        canvas.update({"a": Layer(grid_of(before), pose), "b": other}, other.grid)
        renewed = fused_tiles(monkeypatch)
        kept = canvas.update({"a": Layer(grid_of(after), pose), "b": other}, other.grid)
        assert 1 <= len(renewed) <= 4
        assert_as_anew(kept, {"a": Layer(grid_of(after), pose), "b": other}, other.grid)

    @pytest.mark.parametrize("pose", [IDENTITY, Sim2(0.31, -0.77, 0.4)])
    def test_what_lies_between_two_changes_is_not_renewed(self, monkeypatch, pose):
        monkeypatch.setattr(fuse_module, "TILE_CELLS", 8)
        before = np.zeros((80, 80), np.int8)
        after = before.copy()
        after[[2, 77], [3, 76]] = 100
        canvas = Canvas(CELLS)
        canvas.update({"a": Layer(grid_of(before), pose)}, grid_of([[0]]))
        renewed = fused_tiles(monkeypatch)
        kept = canvas.update({"a": Layer(grid_of(after), pose)}, grid_of([[0]]))
        assert 2 <= len(renewed) <= 8
        assert_as_anew(kept, {"a": Layer(grid_of(after), pose)}, grid_of([[0]]))

    @pytest.mark.parametrize("tile", [5, 8, 256])
    @pytest.mark.parametrize("pose", [Sim2(0.7, -0.3), Sim2(0.31, -0.77, 0.4), Sim2(1.0, 2.0, math.pi / 2)])
    def test_a_map_that_grows_moves_and_shrinks_is_as_fused_anew(self, monkeypatch, tile, pose):
        monkeypatch.setattr(fuse_module, "TILE_CELLS", tile)
        cells, other = blob(3, 50, 60), grid_of(blob(4, 40, 40))
        nothing = np.full((3, 3), -1, np.int8)
        parts = [(10, 40, 10, 50), (4, 40, 10, 57), (20, 30, 20, 30), (20, 31, 19, 30), None, (0, 50, 0, 60)]
        canvas = Canvas(CELLS)
        for turn in (Sim2(), Sim2(yaw_rad=0.01)):
            for part in parts:
                top, bottom, left, right = part or (5, 8, 5, 8)
                shown = cells[top:bottom, left:right] if part else nothing
                grid = grid_of(shown, origin=Sim2(left * 0.1, top * 0.1))
                layers = {"a": Layer(other, IDENTITY), "b": Layer(grid, pose @ turn)}
                assert_as_anew(canvas.update(layers, other), layers, other)


def fused_tiles(monkeypatch):
    """Return a list to which every tile is added that is fused from now on."""
    tiles = []
    fuse_tile = LogOdds.fuse

    def recorded(odds, on_tile):
        tiles.append(on_tile)
        return fuse_tile(odds, on_tile)

    monkeypatch.setattr(LogOdds, "fuse", recorded)
    return tiles


def assert_as_anew(kept, layers, lattice):
    anew = Canvas(CELLS).update(layers, lattice)
    assert kept.grid.same_as(anew.grid)
    assert kept.agreements == anew.agreements


class TestTiles:
    @pytest.mark.parametrize("tile", [1, 7, 16, 1000])
    def test_the_tiles_cannot_be_told_from_the_outcome(self, monkeypatch, tile):
        grids = [grid_of(blob(seed)) for seed in (1, 2, 3)]
        poses = [IDENTITY, Sim2(0.7, 0.3), Sim2(-2.0, 1.1, math.pi / 2)]
        whole = fused(*grids, poses=poses)
        monkeypatch.setattr(fuse_module, "TILE_CELLS", tile)
        tiled = fused(*grids, poses=poses)
        assert tiled.grid.same_as(whole.grid)
        assert tiled.agreements == whole.agreements

    def test_far_apart_maps_leave_tiles_empty(self, monkeypatch):
        monkeypatch.setattr(fuse_module, "TILE_CELLS", 16)
        fusion = fused(grid_of(blob(1)), grid_of(blob(2)), poses=[IDENTITY, Sim2(20.0, 20.0)])
        assert fusion.grid.known.sum() == (blob(1) >= 0).sum() + (blob(2) >= 0).sum()
        assert fusion.agreements[0].overlap_fraction == 0.0
