"""The figures of a placement, and the tests that it must pass."""

import math

import numpy as np
import pytest

from mapmerge.config import VerifyConfig
from mapmerge.grid import Grid
from mapmerge.prepare import prepare
from mapmerge.sim2 import IDENTITY, Sim2
from mapmerge.verify import Scores, cell_agreement, rank_score_m, verify
from tests.floors import CONFIG, drawn, filled, flat, prepared_map, with_another_label, within

LIMITS = VerifyConfig()


def figures(target, source, pose=IDENTITY):
    return verify(target, source, pose, LIMITS)


class TestCells:
    def test_equation_3_by_hand(self):
        target = prepared_map(Grid(np.array([[100, 0, 100, 0, 50, -1]], np.int8), 0.5))
        source = prepared_map(Grid(np.array([[100, 0, 0, 100, 0, 0]], np.int8), 0.5))
        assert cell_agreement(target, source, IDENTITY) == (2, 2, 5)
        assert figures(target, source).acceptance == 0.5

    def test_the_bands_cannot_be_told_from_the_outcome(self, monkeypatch):
        target, source, pose = prepared_map(flat()), prepared_map(flat(ragged=1)), Sim2(0.71, -0.33, 0.4)
        whole = cell_agreement(target, source, pose)
        monkeypatch.setattr("mapmerge.verify._BAND_CELLS", 1)
        assert cell_agreement(target, source, pose) == whole

    def test_of_a_shifted_map_by_search(self):
        target, source, pose = prepared_map(flat()), prepared_map(flat(ragged=1)), Sim2(0.71, -0.33, 0.4)
        agree = disagree = both = 0
        back = target.grid.map_from_grid.inverse() @ Sim2(1.0, 1.0) @ pose @ Sim2(-1.0, -1.0)
        cells = back @ source.grid.map_from_grid
        for row, col in zip(*np.nonzero(source.grid.known), strict=True):
            x_m, y_m = cells.apply_point((col + 0.5) * 0.05, (row + 0.5) * 0.05)
            there = (math.floor(y_m / 0.05), math.floor(x_m / 0.05))
            if not (0 <= there[0] < target.grid.rows and 0 <= there[1] < target.grid.cols):
                continue
            mine, theirs = source.grid.cells[row, col], target.grid.cells[there]
            both += theirs >= 0
            agree += theirs >= 0 and (mine >= 65) == (theirs >= 65)
            disagree += theirs >= 0 and (mine >= 65) != (theirs >= 65)
        found = cell_agreement(target, source, cells)
        np.testing.assert_allclose(found, (agree, disagree, both), atol=3)
        assert both > 5000

    def test_a_map_on_itself(self):
        prepared = prepared_map(flat())
        scores = figures(prepared, prepared)
        assert scores.acceptance == scores.wall_agreement == scores.overlap_fraction == 1.0
        assert scores.violated_wall_m == 0.0
        assert scores.overlap_m2 == pytest.approx(prepared.grid.known_area_m2)

    def test_figures_are_the_same_in_both_directions(self):
        target, source, pose = prepared_map(flat()), prepared_map(flat(ragged=1)), Sim2(0.2, -0.3, 0.1)
        ahead, back = figures(target, source, pose), figures(source, target, pose.inverse())
        assert ahead.wall_agreement == pytest.approx(back.wall_agreement, abs=0.01)
        assert ahead.matched_wall_m == pytest.approx(back.matched_wall_m, rel=0.01)
        assert ahead.acceptance == pytest.approx(back.acceptance, abs=0.01)
        assert ahead.overlap_m2 == pytest.approx(back.overlap_m2, rel=0.02)

    @pytest.mark.parametrize("pose", [IDENTITY, Sim2(200.0, 0.0, 1.0)])
    @pytest.mark.parametrize(
        ("one", "other"),
        [(-1, 0), (0, 100), (100, 100), (-1, -1), (0, 0)],
    )
    def test_maps_without_much_on_them_have_figures(self, one, other, pose):
        scores = figures(prepared_map(filled(one, 30, 40)), prepared_map(filled(other, 20, 20)), pose)
        assert all(math.isfinite(getattr(scores, name)) for name in Scores.__slots__)
        assert 0.0 <= scores.acceptance <= 1.0
        assert 0.0 <= scores.overlap_fraction <= 1.0


class TestDirections:
    @pytest.mark.parametrize("swapped", [False, True])
    def test_walls_agree_as_far_as_they_do_in_the_worse_direction(self, swapped):
        """One map has a second wall as long as the first, where the other has seen free space."""
        one, two = (
            prepared_map(drawn(within(0, 0, 6, 6), walls, size_m=(6, 6)))
            for walls in ([(0, 3, 6, 3.1)], [(0, 3, 6, 3.1), (0, 5, 6, 5.1)])
        )
        scores = figures(two, one) if swapped else figures(one, two)
        assert scores.wall_agreement == pytest.approx(0.5)
        assert scores.matched_wall_m == pytest.approx(6.0)
        assert scores.violated_wall_m == pytest.approx(3.0)


class TestRank:
    def test_the_truth_ranks_highest(self):
        target, source = prepared_map(flat()), prepared_map(flat(ragged=1))
        best = rank_score_m(target, source, IDENTITY, LIMITS)
        assert best == figures(target, source).score_m
        for pose in (Sim2(0.5), Sim2(0.0, -0.6), Sim2(0.0, 0.0, 0.15), Sim2(*target.extent_m, math.pi)):
            assert rank_score_m(target, source, pose, LIMITS) < 0.8 * best

    def test_is_in_metres_as_it_is_documented(self):
        target, source, pose = prepared_map(flat()), prepared_map(flat(ragged=1)), Sim2(0.3, -0.2, 0.05)
        scores = figures(target, source, pose)
        walls_m = scores.matched_wall_m - LIMITS.violation_weight * scores.violated_wall_m
        free_m2 = (scores.score_m - walls_m) / LIMITS.free_weight
        assert 0.7 * scores.overlap_m2 < free_m2 <= 1.05 * scores.overlap_m2


class TestScale:
    """The source's cells are larger than it says: its metres are less than the target's."""

    @pytest.mark.parametrize("scale", [0.5, 1.1, 2.0])
    def test_figures_are_in_metres_of_the_target(self, scale):
        target, source = prepared_map(flat()), flat(ragged=1)
        same = figures(target, prepared_map(source))
        relabelled = prepare(with_another_label(source, 1.0 / scale), 0.05 / scale, CONFIG)
        scores = figures(target, relabelled, Sim2(scale=scale))
        assert scores.acceptance == pytest.approx(same.acceptance, abs=0.01)
        assert scores.overlap_m2 == pytest.approx(same.overlap_m2, rel=0.01)
        assert scores.overlap_fraction == pytest.approx(same.overlap_fraction, abs=0.02)
        # walls are thinned in the source's own metres: thick ones count twice where these are much smaller
        assert same.matched_wall_m == pytest.approx(scores.matched_wall_m, rel=0.35)
