"""Maps at another resolution: thin walls stay, and cells stay where they are."""

import math

import numpy as np
import pytest

from mapmerge.config import CellConfig
from mapmerge.grid import Grid
from mapmerge.resample import at_resolution
from mapmerge.sim2 import Sim2

CELLS = CellConfig()
RATIOS = [1.2, 1.3, 1.5, 1.6, 2.0, 2.5, 3.0, 7.3]


def pooled(cells, ratio):
    return at_resolution(Grid(np.asarray(cells, np.int8), 1.0), ratio, CELLS)


class TestSame:
    def test_the_same_resolution_returns_the_map_itself(self):
        grid = Grid(np.zeros((3, 4), np.int8), 0.05)
        assert at_resolution(grid, 0.05, CELLS) is grid

    def test_a_resolution_rounded_to_float32_is_the_same(self):
        grid = Grid(np.zeros((3, 4), np.int8), float(np.float32(0.05)))
        assert at_resolution(grid, 0.05, CELLS) is grid

    @pytest.mark.parametrize("ratio", [0.5, 2.0])
    def test_the_origin_stays(self, ratio):
        grid = Grid(np.zeros((4, 4), np.int8), 0.05, Sim2(1.0, 2.0, 0.7))
        changed = at_resolution(grid, 0.05 * ratio, CELLS)
        assert changed.map_from_grid == grid.map_from_grid
        assert changed.resolution_m == 0.05 * ratio

    @pytest.mark.parametrize("shape", [(0, 0), (0, 3), (3, 0)])
    def test_no_cells_have_the_resolution_asked_for(self, shape):
        changed = at_resolution(Grid(np.zeros(shape, np.int8), 0.05), 0.1, CELLS)
        assert changed.cells.size == 0
        assert changed.resolution_m == 0.1


class TestCoarser:
    def test_as_occupied_as_the_most_occupied_part(self):
        assert pooled([[0, 65], [-1, 20]], 2.0).cells.tolist() == [[65]]
        assert pooled([[100, 65], [0, 20]], 2.0).cells.tolist() == [[100]]

    def test_else_the_mean_of_what_is_known(self):
        assert pooled([[0, 64], [-1, 20]], 2.0).cells.tolist() == [[28]]
        assert pooled([[10, -1], [-1, -1]], 2.0).cells.tolist() == [[10]]
        assert pooled([[0, 1], [-1, -1]], 2.0).cells.tolist() == [[1]]

    def test_unknown_where_nothing_is_known(self):
        assert pooled([[-1, -1], [-1, -1]], 2.0).cells.tolist() == [[-1]]

    def test_the_threshold_of_the_settings_counts(self):
        grid = Grid(np.array([[0, 64], [-1, 20]], np.int8), 1.0)
        assert at_resolution(grid, 2.0, CellConfig(p_occupied=0.5)).cells.tolist() == [[64]]

    @pytest.mark.parametrize("ratio", RATIOS)
    @pytest.mark.parametrize("wall", [0, 1, 17, 38, 39])
    def test_a_wall_one_cell_thick_stays_whole_and_in_its_place(self, ratio, wall):
        cells = np.zeros((40, 31), np.int8)
        cells[wall] = 100
        coarse = pooled(cells, ratio)
        rows = np.flatnonzero((coarse.cells == 100).any(axis=1))
        assert (coarse.cells[rows] == 100).all(axis=1).any()
        assert abs((rows.mean() + 0.5) * ratio - (wall + 0.5)) <= 0.5 * ratio + 0.5

    @pytest.mark.parametrize("ratio", RATIOS)
    @pytest.mark.parametrize("shape", [(1, 1), (1, 40), (40, 1), (7, 7), (40, 31)])
    def test_covers_the_map_and_no_more_than_a_cell_beyond(self, ratio, shape):
        coarse = pooled(np.zeros(shape), ratio)
        for fine, count in zip(shape, coarse.cells.shape, strict=True):
            assert fine - 0.5 <= count * ratio < fine + ratio
        assert coarse.known.all()

    @pytest.mark.parametrize("ratio", RATIOS)
    def test_known_area_is_about_kept(self, ratio):
        y, x = np.indices((120, 150))
        known = (np.hypot(x - 70, y - 60) < 50) & ((x // 40 + y // 40) % 3 > 0)
        coarse = pooled(np.where(known, 0, -1), ratio)
        outline = 2 * math.pi * 50 + 12 * 40
        assert abs(coarse.known_area_m2 - known.sum()) < 0.6 * ratio * outline
        assert coarse.known_area_m2 >= 0.99 * known.sum()

    @pytest.mark.parametrize("ratio", RATIOS)
    def test_walls_are_not_shifted(self, ratio):
        """Walls at all offsets within the coarse cells: their mean error must vanish, or maps match with an offset.

        At half ratios one wall in three or five lies on a border, and goes to one side or the other.
        """
        walls = 20 + 37 * np.arange(146)
        cells = np.zeros((1, 5500), np.int8)
        cells[0, walls] = 100
        coarse = pooled(cells, ratio)
        found = (np.flatnonzero(coarse.cells[0] == 100) + 0.5) * ratio
        assert len(found) == len(walls)
        assert abs(np.mean(found - (walls + 0.5))) < (0.3 if ratio in (1.5, 2.5) else 0.1)

    def test_pooling_in_x_and_y_is_alike(self):
        cells = np.random.default_rng(1).integers(-1, 101, (37, 37)).astype(np.int8)
        for ratio in RATIOS:
            assert np.array_equal(pooled(cells, ratio).cells.T, pooled(cells.T, ratio).cells)


class TestFiner:
    def test_whole_ratios_repeat_the_cells(self):
        cells = np.array([[0, -1], [100, 42]], np.int8)
        fine = at_resolution(Grid(cells, 0.4), 0.1, CELLS)
        assert np.array_equal(fine.cells, np.kron(cells, np.ones((4, 4), np.int8)))

    @pytest.mark.parametrize("ratio", [0.3, 0.4, 0.625, 0.7, 0.99])
    def test_every_fine_cell_has_the_value_at_its_centre(self, ratio):
        cells = np.random.default_rng(2).integers(-1, 101, (11, 13)).astype(np.int8)
        fine = at_resolution(Grid(cells, 1.0), ratio, CELLS)
        rows = np.minimum(((np.arange(fine.rows) + 0.5) * ratio).astype(int), 10)
        cols = np.minimum(((np.arange(fine.cols) + 0.5) * ratio).astype(int), 12)
        assert np.array_equal(fine.cells, cells[rows][:, cols])
        assert 11 <= fine.rows * ratio < 11 + ratio
        assert 13 <= fine.cols * ratio < 13 + ratio

    @pytest.mark.parametrize("parts", [2, 3, 5])
    def test_finer_and_back_is_the_same(self, parts):
        cells = np.random.default_rng(4).integers(-1, 101, (9, 7)).astype(np.int8)
        grid = Grid(cells, 0.6)
        back = at_resolution(at_resolution(grid, 0.6 / parts, CELLS), 0.6, CELLS)
        assert np.array_equal(back.cells, cells)
