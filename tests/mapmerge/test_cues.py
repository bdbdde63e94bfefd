"""What speaks for and against a placement, and the confidence that follows."""

import math
from dataclasses import fields, replace

import numpy as np
import pytest

from mapmerge.align import poses_of
from mapmerge.config import MergeConfig
from mapmerge.match.confidence import HIGHEST, confidence, contenders
from mapmerge.match.cues import Cues, clearance, cues_of
from mapmerge.match.look import Look
from mapmerge.sim2 import Sim2
from mapmerge.verify import verify
from tests.floors import filled, flat, pair_of_maps, walled_room

CONFIG = MergeConfig()
SHARES = ("wall_agreement", "other_wall_agreement", "far_share", "likeness", "rival_agreement", "acceptance")


def against(*scores_m, share=0.5, matched_m=20.0):
    """Return rivals, best first."""
    count = len(scores_m)
    figures = (np.full(count, value) for value in (matched_m, share, 30.0))
    return Look(poses_of([Sim2(9.0)] * count), np.array(scores_m), *figures)


def cues(pair, place=None, rivals=None):
    """Return the cues of a placement between the grids: by default the one that lays the map frames on each other."""
    placement = pair.between_grids(Sim2()) if place is None else place
    scores = verify(pair.target.map, pair.source.map, placement, CONFIG.verify)
    return cues_of(pair, placement, scores, against() if rivals is None else rivals, CONFIG)


FLATS = pair_of_maps(flat(ragged=1), flat(ragged=2))


class TestOfTheTruth:
    def test_all_speak_for_it(self):
        found = cues(FLATS)
        assert found.wall_agreement > 0.98
        assert found.other_wall_agreement >= found.wall_agreement
        assert found.far_share < 0.01
        assert found.aligned > 0.9
        assert found.tight_share > 0.9
        assert found.held_m > 10.0
        assert (found.likeness, found.rival_agreement) == (0.0, 0.0)

    def test_are_those_of_the_scores(self):
        scores = verify(FLATS.target.map, FLATS.source.map, FLATS.between_grids(Sim2()), CONFIG.verify)
        found = cues(FLATS)
        for name in ("matched_wall_m", "wall_agreement", "acceptance", "overlap_m2", "overlap_fraction"):
            assert getattr(found, name) == getattr(scores, name)

    def test_a_wrong_placement_has_worse_ones(self):
        right = cues(FLATS)
        for off in (Sim2(1.0, 0.7), Sim2(3.0, -1.0, 0.5)):
            wrong = cues(FLATS, FLATS.between_grids(off))
            assert wrong.wall_agreement < right.wall_agreement
            assert wrong.far_share > right.far_share
            assert wrong.tight_share < right.tight_share
            assert wrong.held_m < right.held_m


class TestRivals:
    def test_are_compared_by_their_scores(self):
        alone = cues(FLATS)
        half = cues(FLATS, rivals=against(alone.lead_m / 2, 1.0))
        assert half.likeness == pytest.approx(0.5)
        assert half.lead_m == pytest.approx(alone.lead_m / 2)

    @pytest.mark.parametrize("score_m", [-5.0, 0.0])
    def test_one_that_is_none_does_not_count(self, score_m):
        alone, found = cues(FLATS), cues(FLATS, rivals=against(score_m))
        assert (found.likeness, found.lead_m) == (alone.likeness, alone.lead_m)

    def test_a_better_one_is_as_good(self):
        found = cues(FLATS, rivals=against(1e4))
        assert (found.likeness, found.lead_m) == (1.0, 0.0)

    def test_agreement_counts_of_those_that_match_enough_wall(self):
        assert cues(FLATS, rivals=against(5.0, share=0.9)).rival_agreement == 0.9
        assert cues(FLATS, rivals=against(5.0, share=0.9, matched_m=2.0)).rival_agreement == 0.0


class TestHeld:
    def test_nothing_keeps_a_hall_without_an_end_from_sliding(self):
        open_hall, closed = (
            cues(pair_of_maps(*(walled_room((12.0, 6.0), open_ends=ends, ragged=seed) for seed in (1, 2))))
            for ends in (True, False)
        )
        assert open_hall.held_m < 0.25 * closed.held_m
        assert closed.held_m == pytest.approx(12.0, rel=0.3)

    @pytest.mark.parametrize("yaw_rad", [0.4, math.pi / 4, -2.0])
    def test_a_turn_does_not_matter(self, yaw_rad):
        still = cues(pair_of_maps(*(walled_room((12.0, 6.0), open_ends=False, ragged=seed) for seed in (1, 2))))
        turned = cues(
            pair_of_maps(
                walled_room((12.0, 6.0), open_ends=False, ragged=1),
                walled_room((12.0, 6.0), open_ends=False, ragged=2, yaw_rad=yaw_rad),
            )
        )
        assert turned.aligned == pytest.approx(still.aligned, abs=0.1)
        # thick walls that run obliquely have more points a metre
        assert 0.75 * still.held_m < turned.held_m < 1.7 * still.held_m


@pytest.mark.parametrize("place", [Sim2(), Sim2(90.0, 3.0, 2.0), Sim2(0.3, 0.1, 0.2, 1.7)])
@pytest.mark.parametrize(("one", "other"), [(100, 100), (100, 65)])
def test_maps_of_nothing_but_walls_have_cues_and_a_confidence(one, other, place):
    found = cues(pair_of_maps(filled(one, 30, 40), filled(other, 20, 20)), place, against(3.0))
    assert all(math.isfinite(getattr(found, field.name)) for field in fields(Cues))
    assert all(0.0 <= getattr(found, name) <= 1.0 for name in SHARES)
    assert 0.0 <= confidence(found) <= 1.0


def test_a_rival_that_is_as_good_leaves_an_even_chance():
    """However much wall agrees, such as at a corridor whose rooms nobody can tell apart."""
    alone = cues(FLATS)
    assert confidence(replace(alone, likeness=1.0, lead_m=0.0, rival_agreement=1.0)) <= 0.5


class TestClearance:
    def test_is_of_the_lead_over_what_contradicts(self):
        found = cues(FLATS)
        assert found.clearance == clearance(found.lead_m, found.matched_wall_m, found.slack_agreement)
        assert clearance(9.0, 30.0, 1.0) == pytest.approx(math.log(10.0))
        assert clearance(9.0, 30.0, 0.75) == pytest.approx(math.log(10.0 / 11.0))
        assert clearance(0.0, 0.0, 1.0) == 0.0

    @pytest.mark.parametrize("slack_agreement", [0.0, 1e-9, 0.5, 1.0])
    def test_is_finite_and_falls_with_what_contradicts(self, slack_agreement):
        found = clearance(5.0, 40.0, slack_agreement)
        assert math.isfinite(found)
        assert found <= clearance(5.0, 40.0, min(1.0, slack_agreement + 0.1))


class TestContenders:
    """Among how many placements the choice is."""

    @pytest.mark.parametrize(
        ("change", "count"),
        [
            ({}, 1.0),
            ({"likeness": 0.85}, 1.0),
            ({"likeness": 0.98}, 2.0),
            ({"likeness": 1.0}, 2.0),
            ({"wall_agreement": 0.9, "rival_agreement": 0.86}, 1.0),
            ({"wall_agreement": 0.9, "rival_agreement": 0.9}, 2.0),
            ({"wall_agreement": 0.9, "rival_agreement": 0.95, "likeness": 0.99}, 2.0),
        ],
    )
    def test_are_one_or_two_where_a_rival_is_as_good_or_fits_as_well(self, change, count):
        alone = replace(cues(FLATS), likeness=0.0, rival_agreement=0.0)
        assert contenders(replace(alone, **change)) == pytest.approx(count)

    def test_a_smaller_rival_whose_walls_agree_as_well_leaves_an_even_chance(self):
        alone = cues(FLATS)
        assert confidence(alone) > 0.999
        assert confidence(replace(alone, rival_agreement=1.0)) <= 0.5


def test_no_placement_is_surer_than_was_measured():
    assert confidence(replace(cues(FLATS), lead_m=1e3, clearance=9.0, overlap_m2=1e3)) <= HIGHEST < 1.0


def test_the_best_of_many_searches_is_less_sure():
    found = replace(cues(FLATS), overlap_m2=6.0, clearance=1.5)
    doubts = [1.0 - confidence(found, tries) for tries in (1.0, 5.0, 20.0, 1e9)]
    assert 1.0 - HIGHEST < doubts[0] < 0.05
    assert doubts == pytest.approx([doubts[0], 5 * doubts[0], 20 * doubts[0], 1.0])
