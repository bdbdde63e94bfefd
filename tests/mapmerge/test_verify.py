"""The figures of a placement, and the tests that it must pass."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from mapmerge.config import VerifyConfig
from mapmerge.grid import Grid
from mapmerge.match.correlation import judge
from mapmerge.reasons import ReasonCode
from mapmerge.sim2 import IDENTITY, Sim2
from mapmerge.verify import Scores, cell_agreement, rank_score_m, verify, wall_agreement
from tests.floors import drawn, filled, flat, prepared_map, within

LIMITS = VerifyConfig()
GOOD = Scores(
    score_m=60.0,
    acceptance=0.98,
    overlap_m2=40.0,
    overlap_fraction=0.6,
    wall_agreement=0.95,
    matched_wall_m=45.0,
    violated_wall_m=1.0,
)


def figures(target, source, pose=IDENTITY):
    return verify(target, source, pose, LIMITS)


class TestCells:
    def test_equation_3_by_hand(self):
        target = prepared_map(Grid(np.array([[100, 0, 100, 0, 50, -1]], np.int8), 0.5))
        source = prepared_map(Grid(np.array([[100, 0, 0, 100, 0, 0]], np.int8), 0.5))
        assert cell_agreement(target, source, IDENTITY) == (2, 2, 5)
        assert figures(target, source).acceptance == 0.5

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


class TestWalls:
    """A wall of 6 m at y = 3 m in the target; free space on both sides of it."""

    TARGET = prepared_map(drawn(within(0, 0, 6, 6), [(0, 3, 6, 3.1)], size_m=(6, 6)))

    @pytest.mark.parametrize(
        ("y_m", "matched", "violated"), [(3.05, 1.0, 0.0), (3.2, 1.0, 0.0), (3.4, 0.0, 1.0), (7.5, 0.0, 0.0)]
    )
    def test_on_a_wall_in_free_space_and_outside(self, y_m, matched, violated):
        walls_m = np.stack([np.arange(0.05, 6.0, 0.1), np.full(60, y_m)], axis=1)
        found = wall_agreement(self.TARGET, walls_m, 0.1, 0.15)
        assert (found.matched_m, found.violated_m) == pytest.approx((6.0 * matched, 6.0 * violated))
        assert found.share == matched

    def test_a_wall_in_unknown_space_is_neither(self):
        target = prepared_map(drawn(within(0, 0, 6, 3), [(0, 3, 6, 3.1)], size_m=(6, 6)))
        behind = np.stack([np.arange(0.05, 6.0, 0.1), np.full(60, 3.6)], axis=1)
        found = wall_agreement(target, behind, 0.1, 0.15)
        assert (found.matched_m, found.violated_m) == (0.0, 0.0)
        assert found.share == 0.0

    def test_the_truth_ranks_highest(self):
        target, source = prepared_map(flat()), prepared_map(flat(ragged=1))
        best = rank_score_m(target, source, IDENTITY, LIMITS)
        assert best == figures(target, source).score_m
        for pose in (Sim2(0.5), Sim2(0.0, -0.6), Sim2(0.0, 0.0, 0.15), Sim2(*target.extent_m, math.pi)):
            assert rank_score_m(target, source, pose, LIMITS) < 0.8 * best


class TestJudge:
    def test_accepts_what_is_good(self):
        reason = judge(GOOD, 10.0, LIMITS)
        assert reason.code is ReasonCode.ACCEPTED
        assert "40 m²" in reason.message

    @pytest.mark.parametrize(
        ("change", "code", "says"),
        [
            ({"overlap_m2": 9.9}, ReasonCode.TOO_LITTLE_OVERLAP, "9.9 m²"),
            ({"matched_wall_m": 7.9}, ReasonCode.TOO_LITTLE_OVERLAP, "7.9 m of wall"),
            ({"wall_agreement": 0.7}, ReasonCode.WALLS_DISAGREE, "70%"),
            ({"acceptance": 0.9}, ReasonCode.LOW_ACCEPTANCE, "0.900"),
        ],
    )
    def test_says_what_failed(self, change, code, says):
        reason = judge(replace(GOOD, **change), None, LIMITS)
        assert reason.code is code
        assert says in reason.message

    @pytest.mark.parametrize(
        "exactly", [{"overlap_m2": 10.0}, {"matched_wall_m": 8.0}, {"wall_agreement": 0.8}, {"acceptance": 0.95}]
    )
    def test_the_limits_themselves_pass(self, exactly):
        assert judge(replace(GOOD, **exactly), None, LIMITS).code is ReasonCode.ACCEPTED

    @pytest.mark.parametrize("change", [{"acceptance": 0.9499}, {"wall_agreement": 0.7999}, {"overlap_m2": 9.97}])
    def test_a_near_miss_does_not_read_like_a_contradiction(self, change):
        """Not "the acceptance index is 0.950, less than 0.95"."""
        message = judge(replace(GOOD, **change), None, LIMITS).message
        found, least = map(float, re.findall(r"\d+(?:\.\d+)?", message))
        assert found < least

    @pytest.mark.parametrize(("rival_m", "code"), [(35.9, "accepted"), (36.1, "ambiguous"), (60.0, "ambiguous")])
    def test_a_rival_must_be_far_behind(self, rival_m, code):
        assert judge(GOOD, rival_m, LIMITS).code == code

    @pytest.mark.parametrize("rival_m", [None, -5.0, 0.0])
    def test_a_rival_that_is_none_does_not_count(self, rival_m):
        assert judge(GOOD, rival_m, LIMITS).code is ReasonCode.ACCEPTED

    @pytest.mark.parametrize("score_m", [0.0, -3.0])
    @pytest.mark.parametrize("rival_m", [-4.0, -1.0, 0.0])
    def test_a_score_that_is_not_positive_is_never_accepted(self, score_m, rival_m):
        """Possible with other settings: a heavier weight of violations, or lower limits."""
        assert judge(replace(GOOD, score_m=score_m), min(rival_m, score_m), LIMITS).code is not ReasonCode.ACCEPTED
