"""What speaks for and against a placement by itself."""

import math
from dataclasses import fields

import pytest

from mapmerge.config import MergeConfig
from mapmerge.match.confidence import log_odds_of
from mapmerge.match.cues import Fit, clearance, fit_of
from mapmerge.sim2 import Sim2
from mapmerge.verify import verify
from tests.floors import filled, flat, pair_of_maps, walled_room

CONFIG = MergeConfig()
SHARES = ("far_share", "slack_far_share", "slack_agreement", "acceptance", "overlap_fraction")


def fit(pair, place=None):
    """Return the figures of a placement between the grids; by default map frame lies on map frame."""
    return fit_of(pair, pair.between_grids(Sim2()) if place is None else place, CONFIG)


FLATS = pair_of_maps(flat(ragged=1), flat(ragged=2))


class TestOfTheTruth:
    def test_all_speak_for_it(self):
        found = fit(FLATS)
        assert found.slack_agreement > 0.98
        assert found.far_share < 0.01
        assert found.contradicted_m < 1.0
        assert found.slack_far_share < 0.01
        assert found.aligned > 0.9
        assert found.held_m > 10.0
        assert found.solidity > 2.0

    def test_are_those_of_the_scores(self):
        scores = verify(FLATS.target.map, FLATS.source.map, FLATS.between_grids(Sim2()), CONFIG.verify)
        found = fit(FLATS)
        for name in ("score_m", "wall_agreement", "matched_wall_m", "acceptance", "overlap_m2", "overlap_fraction"):
            assert getattr(found, name) == getattr(scores, name)

    def test_a_wrong_placement_has_worse_ones_and_is_less_likely(self):
        right = fit(FLATS)
        for off in (Sim2(1.0, 0.7), Sim2(3.0, -1.0, 0.5)):
            wrong = fit(FLATS, FLATS.between_grids(off))
            assert wrong.slack_agreement < right.slack_agreement
            assert wrong.far_share > right.far_share
            assert wrong.slack_far_share > right.slack_far_share
            assert wrong.contradicted_m > right.contradicted_m
            assert wrong.held_m < right.held_m
            assert log_odds_of(wrong) < log_odds_of(right)


class TestFar:
    """Walls amid the other map's free space."""

    @pytest.mark.parametrize("swapped", [False, True])
    def test_one_that_the_other_map_lacks_stays_there_however_maps_bend(self, swapped):
        grids = rooms([(4.0, 1.2, 4.1, 4.8)], [])
        found = fit(pair_of_maps(*(reversed(grids) if swapped else grids)))
        assert found.slack_far_share > 0.03
        assert found.slack_far_share == pytest.approx(found.far_share, rel=0.3)

    def test_one_that_lies_beside_its_like_does_not_count(self):
        """As where maps are bent."""
        found = fit(pair_of_maps(*rooms([(4.0, 0.0, 4.1, 4.8)], [(4.4, 0.0, 4.5, 4.8)])))
        assert found.contradicted_m < 1.0
        assert found.far_share < 0.01
        assert found.slack_far_share < 0.01


def rooms(*insides):
    size_m = 10.0, 6.0
    return [walled_room(size_m, open_ends=False, ragged=seed, inside=inside) for seed, inside in enumerate(insides)]


class TestHeld:
    @pytest.mark.parametrize("length_m", [12.0, 30.0, 60.0])
    def test_nothing_keeps_a_hall_without_an_end_from_sliding_however_long(self, length_m):
        open_hall, closed = (
            fit(pair_of_maps(*(walled_room((length_m, 6.0), open_ends=ends, ragged=seed) for seed in (1, 2))))
            for ends in (True, False)
        )
        assert open_hall.held_m < 1.0
        assert closed.held_m == pytest.approx(12.0, rel=0.35)

    @pytest.mark.parametrize("yaw_rad", [0.4, math.pi / 4, -2.0])
    def test_a_turn_does_not_matter(self, yaw_rad):
        still = fit(pair_of_maps(*(walled_room((12.0, 6.0), open_ends=False, ragged=seed) for seed in (1, 2))))
        turned = fit(
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
def test_maps_of_nothing_but_walls_have_figures(one, other, place):
    found = fit(pair_of_maps(filled(one, 30, 40), filled(other, 20, 20)), place)
    assert all(math.isfinite(getattr(found, field.name)) for field in fields(Fit))
    assert all(0.0 <= getattr(found, name) <= 1.0 for name in SHARES)
    assert math.isfinite(log_odds_of(found))


class TestClearance:
    def test_is_of_the_lead_over_what_contradicts(self):
        assert clearance(9.0, 0.0) == pytest.approx(math.log(10.0))
        assert clearance(9.0, 10.0) == pytest.approx(math.log(10.0 / 11.0))
        assert clearance(0.0, 0.0) == 0.0

    @pytest.mark.parametrize("contradicted_m", [0.0, 1e-9, 5.0, 1e6])
    def test_is_finite_and_falls_with_what_contradicts(self, contradicted_m):
        found = clearance(5.0, contradicted_m)
        assert math.isfinite(found)
        assert found >= clearance(5.0, contradicted_m + 1.0)
