"""Candidates weighed against each other."""

import math
from dataclasses import replace

import numpy as np
import pytest

from mapmerge.align import poses_of
from mapmerge.config import MergeConfig, SearchConfig, VerifyConfig
from mapmerge.match.confidence import log_odds_of
from mapmerge.match.look import Look, scored
from mapmerge.match.weigh import Weighed, likeliest_first, weighed
from mapmerge.sim2 import Sim2
from tests.cues import FIT
from tests.floors import flat, pair_of_maps

CONFIG = MergeConfig()
FLATS = pair_of_maps(flat(ragged=1), flat(ragged=2))
TRUTH = FLATS.between_grids(Sim2())
OFF = [TRUTH @ pose for pose in (Sim2(1.5, 1.0), Sim2(2.0, -1.0, 0.5), Sim2(0.0, 3.0, 2.0), Sim2(4.0, 0.5, -1.0))]


def ranked(*placements):
    return scored(FLATS, poses_of(placements), CONFIG)


def test_the_likeliest_comes_first_whatever_it_scores():
    look = ranked(*OFF, TRUTH)
    last = replace(look, poses=look.poses[::-1].copy(), scores_m=np.array([9.0, 8.0, 7.0, 6.0, 5.0]))
    found = weighed(FLATS, last, CONFIG)
    assert found.look.poses[0] == pytest.approx(poses_of([TRUTH])[0])
    assert found.log_odds == tuple(log_odds_of(fit) for fit in found.fits)
    assert list(found.log_odds) == sorted(found.log_odds, reverse=True)
    assert found.contest.log_odds == found.log_odds[0]
    assert found.contest.lead_log_odds > 5.0


@pytest.mark.parametrize(("most", "count"), [(1, 1), (3, 3), (9, 5)])
def test_so_many_at_most(most, count):
    look = replace(ranked(TRUTH, *OFF), scores_m=np.array([9.0, 8.0, 7.0, 6.0, 5.0]))
    found = weighed(FLATS, look, replace(CONFIG, search=SearchConfig(weighed=most)))
    assert len(found.fits) == len(found.look.poses) == len(found.log_odds) == count


def test_what_is_known_already_is_not_computed_again(monkeypatch):
    look, known = replace(ranked(TRUTH, *OFF), scores_m=np.array([9.0, 8.0, 7.0, 6.0, 5.0])), {}
    first = weighed(FLATS, look, CONFIG, known)
    assert len(known) == 5
    monkeypatch.setattr("mapmerge.match.weigh.fit_of", None)
    again = weighed(FLATS, look, CONFIG, known)
    assert (again.fits, again.log_odds) == (first.fits, first.log_odds)


def test_what_scores_much_less_is_not_weighed():
    assert len(weighed(FLATS, ranked(TRUTH, *OFF), CONFIG).fits) == 1


def test_of_placements_that_all_contradict_the_maps_the_best_is_weighed():
    look = ranked(*OFF)
    found = weighed(FLATS, replace(look, scores_m=-np.arange(1.0, 5.0)), CONFIG)
    assert found.look.poses.tolist() == look.poses[:1].tolist()


class TestOtherHalf:
    """Of a symmetric building either half may have been seen."""

    @staticmethod
    def found(turn_rad, scale=1.0, **changes):
        poses = poses_of([Sim2(), Sim2(5.0, 3.0, turn_rad, scale)])
        look = Look(poses, np.array([60.0, 20.0]), np.array([45.0, 20.0]), np.array([0.95, 0.95]))
        other = replace(FIT, **{"overlap_m2": 10.0, "matched_wall_m": 15.0, **changes})
        return Weighed(look, (FIT, other), (6.0, -3.0)).other_half(VerifyConfig())

    @pytest.mark.parametrize("turn_rad", [math.pi, -math.pi + 0.1, 3 * math.pi])
    def test_where_walls_agree_as_well_it_contests(self, turn_rad):
        assert self.found(turn_rad).overlap_m2 == 10.0

    @pytest.mark.parametrize("turn_rad", [0.0, math.pi / 2, math.pi - 0.3])
    def test_other_turns_do_not(self, turn_rad):
        assert self.found(turn_rad) is None

    def test_nor_does_another_size(self):
        assert self.found(math.pi, 1.1) is None

    @pytest.mark.parametrize(
        "change", [{"slack_agreement": 0.96}, {"overlap_m2": 5.9}, {"matched_wall_m": 7.9}, {"matched_wall_m": 6.0}]
    )
    def test_nor_does_what_fits_worse_or_shares_too_little(self, change):
        assert self.found(math.pi, **change) is None


class TestOrder:
    def test_is_by_odds(self):
        assert likeliest_first([FIT] * 3, [1.0, 3.0, 2.0], VerifyConfig()) == [1, 2, 0]

    @pytest.mark.parametrize("change", [{"overlap_m2": 5.9}, {"matched_wall_m": 7.9}])
    def test_what_shares_too_little_to_be_accepted_comes_last(self, change):
        fits = [replace(FIT, **change), FIT, replace(FIT, **change)]
        assert likeliest_first(fits, [9.0, -1.0, 8.0], VerifyConfig()) == [1, 0, 2]
