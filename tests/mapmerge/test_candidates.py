"""Where placements are looked for: by spectra, at all rotations, near a prior, at all scales."""

import math

import numpy as np
import pytest

from mapmerge.align import placement_of
from mapmerge.config import SearchConfig
from mapmerge.match.candidates import all_scales, by_half_turn, by_prior, by_spectra, by_sweep, likely_rotations
from mapmerge.prior import Prior
from mapmerge.sim2 import Sim2
from tests.floors import BESIDE_THE_FLAT, FLAT_M, errors, filled, flat, pair_of_maps, with_another_label

SEARCH = SearchConfig()
PLACES = [Sim2(), Sim2(3.0, -2.0, 0.6), Sim2(9.0, 7.0, -2.8), Sim2(1.0, 8.0, -math.pi / 2)]


def known_pair(place, prior=None, factor=1.0):
    """Return two maps of the flat, the truth between their grids, and the flat's middle in the source's."""
    corner = BESIDE_THE_FLAT @ place
    # the flat's middle, so that the whole flat is on the map whatever the turn
    corner = Sim2(FLAT_M[0] / 2, FLAT_M[1] / 2, place.yaw_rad) @ Sim2(-8.0, -7.5)
    source = with_another_label(flat(corner, ragged=2, size_m=17.0), factor)
    pair = pair_of_maps(flat(ragged=1), source, prior)
    truth = pair.between_grids(BESIDE_THE_FLAT.inverse() @ corner @ Sim2(scale=1.0 / factor))
    extent_m = pair.source.map.extent_m
    return pair, truth, (extent_m[0] / 2, extent_m[1] / 2)


def least_error_m(poses, truth, at_m):
    near = [errors(placement_of(pose), truth, at_m) for pose in poses]
    return min((position_m for position_m, degrees in near if degrees < 4.0), default=math.inf)


@pytest.mark.parametrize("place", PLACES)
class TestTruth:
    def test_is_among_those_of_the_spectra(self, place):
        pair, truth, at_m = known_pair(place)
        rotations = likely_rotations(pair, SEARCH)
        assert all(0.0 <= rotation < math.pi for rotation in rotations)
        found = by_spectra(pair, rotations, (1.0,), SEARCH)
        assert len(found) <= SEARCH.max_candidates * len(SEARCH.free_weights)
        assert least_error_m(found, truth, at_m) < 0.3

    def test_is_among_those_of_the_sweep(self, place):
        pair, truth, at_m = known_pair(place)
        found = by_sweep(pair, SEARCH)
        assert len(found) <= SEARCH.sweep_candidates * len(SEARCH.sweep_free_weights)
        assert least_error_m(found, truth, at_m) < 0.5

    def test_is_among_those_turned_by_half_from_the_other_half(self, place):
        """Wherever that lies: of a symmetric building the wrong half may seem the better one."""
        pair, truth, at_m = known_pair(place)
        elsewhere = Sim2(5.0, -3.0, truth.yaw_rad + math.pi)
        found = by_half_turn(pair, elsewhere, SEARCH)
        assert least_error_m(found, truth, at_m) < 0.3
        turns = np.remainder(found[:, 2] - truth.yaw_rad, math.pi)
        assert np.minimum(turns, math.pi - turns).max() < 1e-6

    @pytest.mark.parametrize("factor", [0.7, 1.6])
    def test_is_among_those_of_all_scales(self, place, factor):
        pair, truth, at_m = known_pair(place, factor=factor)
        found = by_spectra(pair, likely_rotations(pair, SEARCH), all_scales(0.4, 2.5, SEARCH.scale_step), SEARCH)
        near = found[np.abs(np.log(found[:, 3] * factor)) < 0.03]
        assert least_error_m(near, truth, at_m) < 0.4


class TestPrior:
    @pytest.mark.parametrize("yaw_rad", [0.3, math.pi, -math.pi + 1e-9, math.pi - 0.05])
    def test_its_placement_comes_first_and_all_are_near_it(self, yaw_rad):
        place = Sim2(yaw_rad=yaw_rad)
        pair, truth, at_m = known_pair(place)
        true = pair.between_maps(truth)
        believed = Sim2(true.x_m + 0.3, true.y_m - 0.4, true.yaw_rad + 0.04)
        pair, truth, at_m = known_pair(place, Prior(believed, 0.3, 0.3, 0.05, "given for r2"))
        found = by_prior(pair, SEARCH)
        assert errors(placement_of(found[0]), pair.believed, at_m) == pytest.approx((0.0, 0.0), abs=1e-9)
        assert least_error_m(found[1:], truth, at_m) < 0.4
        turn_rad = math.radians(3.0)  # which shifts what is far from the middle
        assert pair.allowed(found, 0.8 + turn_rad * pair.reach_m, turn_rad).all()

    def test_without_one_there_is_nothing_to_look_near_to(self):
        pair, _, _ = known_pair(Sim2())
        assert by_prior(pair, SEARCH).shape == (0, 4)


class TestScales:
    @pytest.mark.parametrize("step", [1.01, 1.05, 1.3])
    @pytest.mark.parametrize(
        "ends", [(0.4, 2.5), (0.9, 1.1), (0.5, 1.0), (1.0, 3.0), (0.97, 2.0), (1.0, 1.0), (0.999, 1.001)]
    )
    def test_hold_1_and_span_the_range(self, ends, step):
        scales = all_scales(*ends, step)
        assert 1.0 in scales
        assert list(scales) == sorted(set(scales))
        assert ends[0] <= min(scales) * (1 + 1e-9)
        assert max(scales) <= ends[1] * (1 + 1e-9)
        # what is left out beyond the ends, and between two scales, is in the reach of alignment
        assert max(1.0, min(scales) / ends[0], ends[1] / max(scales)) <= step**0.51
        ratios = np.divide(scales[1:], scales[:-1])
        assert (ratios <= step**1.5 + 1e-9).all()

    @pytest.mark.parametrize("ends", [(1.6, 2.5), (0.4, 0.8)])
    def test_span_a_range_that_leaves_out_1(self, ends):
        scales = all_scales(*ends, 1.05)
        assert (scales[0], scales[-1]) == pytest.approx(ends)
        assert list(scales) == sorted(set(scales))


class TestLittle:
    GRIDS = (filled(100, 1, 1), filled(100, 1, 100), filled(0, 40, 40), filled(-1, 4, 4), filled(100, 40, 40))

    @pytest.mark.parametrize("number", range(len(GRIDS)))
    def test_maps_with_little_on_them_have_an_outcome(self, number):
        few, other = self.GRIDS[number], flat()
        prior = Prior(Sim2(1.0), 0.2, 0.2, 0.02, "given for r2")
        for target, source in ((few, other), (other, few), (few, few)):
            pair = pair_of_maps(target, source, prior)
            rotations = likely_rotations(pair, SEARCH)
            for found in (by_prior(pair, SEARCH), by_spectra(pair, rotations, (1.0,), SEARCH), by_sweep(pair, SEARCH)):
                assert found.shape[1:] == (4,)
                assert np.isfinite(found).all()
