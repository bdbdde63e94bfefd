"""What the benchmarks measure with: recipes that find what is plain, and measures that say what they claim."""

import math

import numpy as np
import pytest

from benchmarks.cases import FIRST_SEED, cases
from benchmarks.exhaustive import exhaustive
from benchmarks.hough import acceptance_index, hough_spectrum, rotations
from benchmarks.methods import DEFAULT, RECIPES, load_method, names
from benchmarks.recordings import Course, Moment
from benchmarks.reliability import binned, diagram, wilson
from benchmarks.verdicts import Tolerance, Verdict, tolerance, verdict
from mapmerge.grid import Grid
from mapmerge.match import MATCHERS
from mapmerge.sim2 import IDENTITY, Sim2
from replay.placement_error import PlacementError, error_of
from samples.kinds import KINDS
from tests.floors import flat, in_frame, office_pair

THERE = Sim2(-3.0, -2.0, 0.31)
TRUTH = Sim2(-1.0, -1.0).inverse() @ THERE
MIDDLE_M = (5.0, 6.0)
TURNED = Sim2(0.0, 0.0, math.pi / 2)
FLAT_MIDDLE_M = THERE.inverse().apply_point(4.5, 3.0)


@pytest.fixture(scope="module")
def flats():
    """Two drawn maps of one flat, one of them turned."""
    return flat(ragged=1), flat(THERE, ragged=2, size_m=15.0)


@pytest.fixture(scope="module")
def office():
    """A map and the same cells turned by 90°, so that `TURNED` takes one to the other."""
    cells = office_pair(1).target.cells
    return Grid(cells, 0.05, Sim2(-cells.shape[1] * 0.05, 0.0)), Grid(np.rot90(cells).copy(), 0.05)


class TestMethods:
    def test_are_all_matchers_and_recipes(self):
        assert set(names()) == set(MATCHERS) | set(RECIPES)
        assert names()[0] == DEFAULT

    @pytest.mark.parametrize("name", names())
    def test_find_the_same_map_turned(self, office, name):
        placed = load_method(name)(*office)
        assert placed.accepted, placed.reason
        error = error_of(placed.target_from_source, TURNED, MIDDLE_M)
        assert error.distance_m < 0.1
        assert error.angle_deg < 0.5

    @pytest.mark.parametrize("name", RECIPES)
    def test_work_in_any_map_frame(self, office, name):
        frame = Sim2(40.0, -7.0, 2.1)
        placed = load_method(name)(in_frame(office[0], frame), office[1])
        error = error_of(placed.target_from_source, frame @ TURNED, MIDDLE_M)
        assert error.distance_m < 0.1

    @pytest.mark.parametrize("name", RECIPES)
    def test_have_nothing_to_say_of_empty_maps(self, flats, name):
        empty = Grid(np.zeros((50, 50), np.int8), 0.05)
        placed = load_method(name)(flats[0], empty)
        assert not placed.accepted
        assert placed.reason

    def test_trying_all_placements_finds_the_truth(self, flats):
        error = error_of(exhaustive(*flats), TRUTH, FLAT_MIDDLE_M)
        assert error.distance_m < 0.05
        assert error.angle_deg < 0.2


class TestHough:
    def test_a_spectrum_turns_with_its_map(self, flats):
        walls = [grid.centres_m(grid.cells == 100) for grid in flats]
        spectra = [hough_spectrum(points, 0.05) for points in walls]
        found = rotations(*spectra)
        assert min(abs(math.remainder(turn - TRUTH.yaw_rad, math.tau)) for turn in found) < math.radians(1.0)

    def test_a_map_agrees_with_itself(self, flats):
        assert acceptance_index(flats[0], flats[0], IDENTITY) == 1.0
        assert acceptance_index(*flats, TRUTH) > 0.9
        assert acceptance_index(*flats, Sim2(900.0, 0.0)) == 0.0


class TestCases:
    def test_are_as_many_as_promised(self):
        found = cases()
        related = [case for case in found if case.related == "same place"]
        assert len(related) >= 200
        assert len(found) - len(related) >= 100
        assert {case.kind for case in found} == set(KINDS)
        assert min(case.seed for case in found) >= FIRST_SEED
        assert len(set(found)) == len(found)


class TestVerdicts:
    @pytest.mark.parametrize(
        ("error", "accepted", "belongs", "expected"),
        [
            (PlacementError(0.05, 0.2), True, True, Verdict.PLACED),
            (PlacementError(0.05, 1.5), True, True, Verdict.INEXACT),
            (PlacementError(0.3, 0.2), True, True, Verdict.INEXACT),
            (PlacementError(3.0, 0.2), True, True, Verdict.WRONG),
            (PlacementError(0.05, 90.0), True, True, Verdict.WRONG),
            (PlacementError(0.05, 0.2), False, True, Verdict.MISSED),
            (None, False, True, Verdict.MISSED),
            (None, True, False, Verdict.FALSE_MERGE),
            (None, False, False, Verdict.REFUSED),
        ],
    )
    def test_say_what_became_of_a_pair(self, error, accepted, belongs, expected):
        assert verdict(error, tolerance(0.05, 0.0), accepted=accepted, belongs=belongs) is expected

    def test_bent_maps_are_held_to_less(self):
        assert tolerance(0.05, 0.0).distance_m == pytest.approx(0.10)
        assert tolerance(0.05, 0.05).distance_m == pytest.approx(0.15)
        assert tolerance(0.05, 0.4).distance_m == pytest.approx(0.4)

    def test_an_error_is_that_at_the_point(self):
        turned = Sim2(0.0, 0.0, math.radians(1.0))
        error = error_of(turned, IDENTITY, (10.0, 0.0))
        assert error.distance_m == pytest.approx(10.0 * 2.0 * math.sin(math.radians(0.5)))
        assert error.angle_deg == pytest.approx(1.0)


class TestCourses:
    ALLOWED = Tolerance(0.1)

    def course(self, areas_m2, errors, *, belongs=True):
        moments = tuple(
            Moment(float(number), area_m2, error, self.ALLOWED)
            for number, (area_m2, error) in enumerate(zip(areas_m2, errors, strict=True))
        )
        return Course("correlation", "run", "r2", belongs, "accepted", None, moments)

    def test_may_be_refused_until_half_of_the_overlap_is_there(self):
        right = PlacementError(0.01, 0.0)
        found = self.course([1.0, 20.0, 50.0, 100.0], [None, None, right, right])
        assert (found.due, found.first, found.late, found.wrong, found.is_right) == (2, 2, 0, 0, True)
        assert not self.course([1.0, 20.0, 50.0, 100.0], [None, None, None, right]).is_right

    def test_are_wrong_if_ever_placed_elsewhere(self):
        right, elsewhere = PlacementError(0.01, 0.0), PlacementError(8.0, 0.0)
        found = self.course([1.0, 60.0, 100.0], [elsewhere, right, right])
        assert (found.late, found.wrong, found.is_right) == (0, 1, False)

    def test_of_a_stranger_has_no_due_moment(self):
        assert self.course([0.0, 0.0], [None, None], belongs=False).is_right
        placed = PlacementError(math.inf, math.inf)
        assert self.course([0.0, 0.0], [placed, None], belongs=False).wrong == 1


class TestReliability:
    def test_bounds_hold_the_share(self):
        low, high = wilson(8, 10)
        assert low == pytest.approx(0.490, abs=0.001)
        assert high == pytest.approx(0.943, abs=0.001)
        assert wilson(0, 0) == (0.0, 1.0)

    def test_every_placement_is_in_one_bin(self):
        stated = [(0.0, False), (0.1, False), (0.95, True), (1.0, True), (0.999, False)]
        bins = binned(stated)
        assert sum(item.count for item in bins) == len(stated)
        assert (bins[-1].count, bins[-1].right) == (2, 1)
        assert len(diagram(bins)) == 1 + sum(item.count > 0 for item in bins)
        assert diagram(binned([])) == ["the method states no confidence"]
