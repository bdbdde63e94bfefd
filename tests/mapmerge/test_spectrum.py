"""Rotations between two maps from their orientation spectra."""

import math

import numpy as np
import pytest

from mapmerge.config import SearchConfig
from mapmerge.match.spectrum import orientation_spectra, rotation_peaks, spectrum_correlation
from mapmerge.sim2 import Sim2
from tests.floors import FEW_POINTS, walls_of_the_flat

SEARCH = SearchConfig()
KINDS = pytest.mark.parametrize("kind", [0, 1])


def spectra(points_m):
    return orientation_spectra(points_m, SEARCH.angle_step_rad, SEARCH.wall_spacing_m)


@KINDS
@pytest.mark.parametrize("degrees", [0.0, 0.5, 1.3, 17.0, 44.6, 89.7, 90.0, 135.2, 179.4, -31.0])
@pytest.mark.parametrize("share", [1.0, 0.6])
def test_a_known_turn_is_among_the_peaks_within_a_degree(kind, degrees, share):
    target = spectra(walls_of_the_flat(1, math.radians(degrees)))[kind]
    found = rotation_peaks(spectrum_correlation(target, spectra(walls_of_the_flat(2, share=share))[kind]), 2)
    errors_deg = [abs(math.degrees(math.remainder(turn - math.radians(degrees), math.pi))) for turn in found]
    assert min(errors_deg) < 1.0
    assert all(0.0 <= turn < math.pi for turn in found)


@KINDS
def test_a_shift_does_not_matter(kind):
    walls_m = walls_of_the_flat(1)
    np.testing.assert_allclose(spectra(walls_m)[kind], spectra(Sim2(100.0, -40.0).apply(walls_m))[kind], atol=0.02)


def test_are_normalised():
    found = spectra(walls_of_the_flat(1))
    assert found.shape == (2, 180)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0)
    np.testing.assert_allclose(found.mean(axis=1), 0.0, atol=1e-12)


def test_a_few_long_walls_count_for_more_in_the_first_than_in_the_second():
    """One wall of 10 m, and three times as many points on walls of 1 m that run another way."""
    wall = np.stack([np.arange(0.0, 10.0, 0.1), np.zeros(100)], axis=1)
    short = np.stack([np.arange(0.0, 1.0, 0.1), np.zeros(10)], axis=1)
    turned = Sim2(yaw_rad=math.radians(40.0))
    many = [turned.apply(short + np.array([3.0 * (number % 6), 1.3 + 2.1 * (number // 6)])) for number in range(30)]
    peaked, summed = spectra(np.vstack([wall, *many]))
    along, across = 90, 130
    assert peaked[along] - peaked[across] > summed[along] - summed[across]


def test_peaks_come_best_first_and_no_more_than_asked_for():
    correlation = np.zeros(180)
    correlation[[10, 50, 90, 130]] = [0.3, 0.9, 0.5, 0.7]
    found = rotation_peaks(correlation, 3)
    assert np.degrees(found).round(6).tolist() == [50.0, 130.0, 90.0]


def test_peaks_lie_between_the_steps():
    angles = np.arange(180)
    correlation = np.cos(np.radians(2 * (angles - 33.4)))
    assert math.degrees(rotation_peaks(correlation, 1)[0]) == pytest.approx(33.4, abs=0.01)


def test_a_peak_across_the_seam():
    correlation = np.cos(np.radians(2 * (np.arange(180) - 179.7)))
    (found,) = rotation_peaks(correlation, 2)
    assert math.degrees(found) == pytest.approx(179.7, abs=0.01)


def test_a_flat_correlation_has_no_peak():
    assert rotation_peaks(np.zeros(180), 4) == ()


@pytest.mark.parametrize("name", FEW_POINTS)
def test_few_points_have_an_outcome(name):
    few = spectra(FEW_POINTS[name])
    assert few.shape == (2, 180)
    assert np.isfinite(few).all()
    for kind in (0, 1):
        for one, other in ((few, spectra(walls_of_the_flat(1))), (few, few)):
            assert np.isfinite(rotation_peaks(spectrum_correlation(one[kind], other[kind]), 4)).all()
