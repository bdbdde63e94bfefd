"""Candidates aligned and ranked, and what competes with the best of them."""

import math

import numpy as np
import pytest

from mapmerge.align import placement_of, poses_of
from mapmerge.config import MergeConfig
from mapmerge.match.look import Look, distinct, look, look_around, rivals, scored
from mapmerge.prior import Prior
from mapmerge.sim2 import Sim2
from tests.floors import errors, flat, pair_of_maps, walled_room

CONFIG = MergeConfig()
RIGID = (1.0, 1.0)
PAIR = pair_of_maps(flat(ragged=1), flat(ragged=2))
TRUTH = PAIR.between_grids(Sim2())
AT_M = tuple(side_m / 2 for side_m in PAIR.source.map.extent_m)


def off(x_m, y_m, degrees=0.0):
    """Return a placement that is off by a shift and a turn about the middle."""
    return TRUTH @ Sim2(*AT_M) @ Sim2(x_m, y_m, math.radians(degrees)) @ Sim2(*AT_M).inverse()


class TestLook:
    def test_the_truth_comes_first_from_any_start_near_it(self):
        starts = [off(3.0, 1.0, 40.0), off(0.2, -0.2, 2.0), off(-2.0, 0.0, 180.0), off(500.0, 0.0)]
        found = look(PAIR, poses_of(starts), RIGID, CONFIG)
        position_m, degrees = errors(placement_of(found.poses[0]), TRUTH, AT_M)
        assert position_m < 0.05
        assert degrees < 0.3
        assert (np.diff(found.scores_m) <= 0).all()
        assert found.shares[0] > 0.95

    def test_starts_that_end_alike_are_one(self):
        found = look(PAIR, poses_of([off(0.1 * number, 0.0) for number in range(-3, 4)]), RIGID, CONFIG)
        assert len(found.poses) == 1

    def test_nothing_from_nothing(self):
        found = look(PAIR, poses_of([]), RIGID, CONFIG)
        assert found.poses.shape == (0, 4)
        assert len(found.scores_m) == len(found.matched_m) == len(found.shares) == 0

    def test_only_what_a_prior_allows(self):
        away = Prior(PAIR.between_maps(off(3.0, 0.0)), 0.2, 0.2, 0.05, "given for r2")
        pair = pair_of_maps(flat(ragged=1), flat(ragged=2), away)
        found = look(pair, poses_of([TRUTH, off(3.0, 0.0), off(3.3, 0.2), off(0.1, 0.0)]), RIGID, CONFIG)
        assert len(found.poses) > 0
        assert all(away.allows(pair.between_maps(placement_of(pose))) for pose in found.poses)


class TestBeside:
    def test_along_a_wall_without_an_end_all_is_as_good(self):
        pair = pair_of_maps(*(walled_room((20.0, 6.0), open_ends=True, ragged=seed) for seed in (1, 2)))
        best = poses_of([pair.between_grids(Sim2())])
        found = look_around(pair, best, poses_of([]), RIGID, CONFIG)
        against = rivals(scored(pair, best, CONFIG), found, pair, CONFIG.verify)
        assert against.scores_m[0] > 0.85 * scored(pair, best, CONFIG).scores_m[0]

    def test_in_a_flat_nothing_is(self):
        best = poses_of([TRUTH])
        against = rivals(
            scored(PAIR, best, CONFIG), look_around(PAIR, best, poses_of([]), RIGID, CONFIG), PAIR, CONFIG.verify
        )
        assert against.scores_m.max(initial=0.0) < 0.5 * scored(PAIR, best, CONFIG).scores_m[0]


class TestDistinct:
    def kept(self, *placements, distance_m=0.5, degrees=5.0, most=99):
        walls_m = np.array([[0.0, 0.0], [20.0, 0.0]])
        return distinct(poses_of(placements), walls_m, distance_m, math.radians(degrees), most)

    def test_the_first_of_those_that_are_alike_is_kept(self):
        assert self.kept(Sim2(), Sim2(0.4), Sim2(0.6), Sim2(0.5, 0.2), Sim2(1.05)) == [0, 2]

    def test_turns_and_scales_tell_placements_apart(self):
        about = Sim2(10.0)
        turned, scaled = (about @ part @ about.inverse() for part in (Sim2(yaw_rad=0.1), Sim2(scale=1.06)))
        assert self.kept(Sim2(), turned, scaled) == [0, 1, 2]
        little = (about @ part @ about.inverse() for part in (Sim2(yaw_rad=0.08), Sim2(scale=1.04)))
        assert self.kept(Sim2(), *little) == [0]

    def test_across_half_a_turn(self):
        about = Sim2(10.0)
        turns = (about @ Sim2(yaw_rad=yaw) @ about.inverse() for yaw in (math.pi - 0.01, -math.pi + 0.01))
        assert self.kept(*turns) == [0]

    def test_positions_are_compared_amid_the_walls(self):
        """A turn by 4° about the origin takes the middle, 10 m away, further than the limit."""
        assert self.kept(Sim2(), Sim2(yaw_rad=math.radians(4.0))) == [0, 1]

    def test_no_more_than_asked_for(self):
        assert self.kept(*(Sim2(float(number)) for number in range(9)), most=3) == [0, 1, 2]
        assert self.kept() == []


def judged(poses, *scores_m):
    """Return placements with these scores, and figures of no matter."""
    others = np.ones((2, len(scores_m)))
    return Look(poses_of(poses), np.array(scores_m), *others)


class TestRivals:
    def test_are_apart_from_the_best_and_from_each_other(self):
        others = judged([off(0.1, 0.0), off(2.0, 0.0), off(2.2, 0.0), off(0.0, 3.0)], 9.0, 8.0, 7.0, 6.0)
        assert rivals(judged([TRUTH], 10.0), others, PAIR, CONFIG.verify).scores_m.tolist() == [8.0, 6.0]

    @pytest.mark.parametrize("chosen", [[], [0]])
    def test_joined_are_best_first(self, chosen):
        one = judged([off(1.0, 0.0), off(2.0, 0.0)], 4.0, 1.0).rows(chosen)
        assert one.joined(judged([off(3.0, 0.0)], 5.0)).scores_m.tolist() == ([5.0, 4.0] if chosen else [5.0])
