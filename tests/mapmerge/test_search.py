"""The steps that find placements: rotations, shifts, alignment."""

import math

import numpy as np
import pytest

from mapmerge.config import RefineConfig, SearchConfig
from mapmerge.grid import Grid
from mapmerge.match.spectrum import orientation_spectrum, rotation_peaks, spectrum_correlation
from mapmerge.match.surface import TranslationSearch, surface_peaks
from mapmerge.refine import evenly, refine
from mapmerge.sim2 import IDENTITY, Sim2, wrap_angle
from tests.floors import FLAT_M, FLAT_WALLS, errors, filled, flat, prepared_map

SEARCH = SearchConfig()
CENTRE_M = (FLAT_M[0] / 2 + 1.0, FLAT_M[1] / 2 + 1.0)
LINE_M = np.stack([np.linspace(0.0, 10.0, 101), np.full(101, 2.0)], axis=1)
FEW_POINTS = {
    "no points": np.empty((0, 2)),
    "one point": np.array([[1.0, 2.0]]),
    "one point, often": np.tile([[1.0, 2.0]], (40, 1)),
    "two points": np.array([[1.0, 2.0], [1.5, 2.0]]),
    "a line": LINE_M,
    "an oblique line": Sim2(yaw_rad=0.7).apply(LINE_M),
}


def walls_of_the_flat(seed, yaw_rad=0.0, share=1.0):
    """Return noisy points on the flat's walls, turned about the origin; of a part of the flat if ``share`` < 1."""
    rng = np.random.default_rng(seed)
    points = []
    for x0_m, y0_m, x1_m, y1_m in FLAT_WALLS:
        count = int(20 * ((x1_m - x0_m) + (y1_m - y0_m)))
        points.append(rng.uniform((x0_m, y0_m), (x1_m, y1_m), (count, 2)))
    walls_m = np.vstack(points) + rng.normal(0.0, 0.02, (sum(map(len, points)), 2))
    return Sim2(yaw_rad=yaw_rad).apply(walls_m[walls_m[:, 0] <= share * FLAT_M[0]])


def spectrum(points_m):
    return orientation_spectrum(points_m, SEARCH.angle_step_rad, SEARCH.wall_spacing_m)


class TestRotation:
    @pytest.mark.parametrize("degrees", [0.0, 0.5, 1.3, 17.0, 44.6, 89.7, 90.0, 135.2, 179.4, -31.0])
    @pytest.mark.parametrize("share", [1.0, 0.6])
    def test_a_known_turn_is_among_the_peaks_within_a_degree(self, degrees, share):
        target = spectrum(walls_of_the_flat(1, math.radians(degrees)))
        found = rotation_peaks(spectrum_correlation(target, spectrum(walls_of_the_flat(2, share=share))), 2)
        errors_deg = [abs(math.degrees(math.remainder(turn - math.radians(degrees), math.pi))) for turn in found]
        assert min(errors_deg) < 1.0
        assert all(0.0 <= turn < math.pi for turn in found)

    def test_a_shift_does_not_matter(self):
        walls_m = walls_of_the_flat(1)
        np.testing.assert_allclose(spectrum(walls_m), spectrum(Sim2(100.0, -40.0).apply(walls_m)), atol=0.02)

    def test_is_normalised(self):
        found = spectrum(walls_of_the_flat(1))
        assert found.shape == (180,)
        assert np.linalg.norm(found) == pytest.approx(1.0)
        assert found.mean() == pytest.approx(0.0, abs=1e-12)

    def test_peaks_come_best_first_and_no_more_than_asked_for(self):
        correlation = np.zeros(180)
        correlation[[10, 50, 90, 130]] = [0.3, 0.9, 0.5, 0.7]
        found = rotation_peaks(correlation, 3)
        assert np.degrees(found).round(6).tolist() == [50.0, 130.0, 90.0]

    def test_peaks_lie_between_the_steps(self):
        angles = np.arange(180)
        correlation = np.cos(np.radians(2 * (angles - 33.4)))
        assert math.degrees(rotation_peaks(correlation, 1)[0]) == pytest.approx(33.4, abs=0.01)

    def test_a_peak_across_the_seam(self):
        correlation = np.cos(np.radians(2 * (np.arange(180) - 179.7)))
        (found,) = rotation_peaks(correlation, 2)
        assert math.degrees(found) == pytest.approx(179.7, abs=0.01)

    def test_a_flat_correlation_has_no_peak(self):
        assert rotation_peaks(np.zeros(180), 4) == ()

    @pytest.mark.parametrize("name", FEW_POINTS)
    def test_few_points_have_an_outcome(self, name):
        few = spectrum(FEW_POINTS[name])
        assert few.shape == (180,)
        assert np.isfinite(few).all()
        for one, other in ((few, spectrum(walls_of_the_flat(1))), (few, few)):
            assert np.isfinite(rotation_peaks(spectrum_correlation(one, other), 4)).all()


class TestShift:
    @pytest.mark.parametrize("place", [Sim2(), Sim2(3.0, -2.0), Sim2(-1.7, 1.1, 0.6), Sim2(0.4, 9.0, -2.8)])
    def test_a_known_shift_is_the_best_peak(self, place):
        target, source = prepared_map(flat(ragged=1)), prepared_map(flat(Sim2(-1.0, -1.0) @ place, ragged=2, size_m=14))
        truth = target.grid.map_from_grid.inverse() @ place @ source.grid.map_from_grid
        surface = TranslationSearch(target, source, SEARCH).surface(truth.yaw_rad)
        best = surface_peaks(surface, SEARCH)[0].target_from_source
        assert best.yaw_rad == pytest.approx(truth.yaw_rad)
        assert errors(best, truth, (2.0, 2.0))[0] < 0.2

    def test_every_shift_that_lets_maps_meet_is_on_the_surface(self):
        wide, tall = prepared_map(filled(100, 20, 200)), prepared_map(filled(100, 160, 10))
        for target, source in ((wide, tall), (tall, wide)):
            surface = TranslationSearch(target, source, SEARCH).surface(0.0)
            rows, cols = surface.values.shape
            first_x, first_y = surface.origin_m
            last_x, last_y = first_x + (cols - 1) * surface.step_m, first_y + (rows - 1) * surface.step_m
            assert first_x <= -source.extent_m[0]
            assert first_y <= -source.extent_m[1]
            assert last_x >= target.extent_m[0]
            assert last_y >= target.extent_m[1]

    def test_values_are_metres_of_wall(self):
        target = prepared_map(flat())
        best = surface_peaks(TranslationSearch(target, target, SEARCH).surface(0.0), SEARCH)[0]
        length_m = len(target.walls_m) * SEARCH.wall_spacing_m
        assert 0.3 * length_m < best.value < 3.0 * length_m

    def test_peaks_are_apart_and_best_first(self):
        target = prepared_map(flat(ragged=1))
        peaks = surface_peaks(TranslationSearch(target, target, SEARCH).surface(0.0), SEARCH)
        assert 1 < len(peaks) <= SEARCH.shifts
        assert [peak.value for peak in peaks] == sorted((peak.value for peak in peaks), reverse=True)
        for index, peak in enumerate(peaks):
            for other in peaks[:index]:
                one, two = peak.target_from_source, other.target_from_source
                assert max(abs(one.x_m - two.x_m), abs(one.y_m - two.y_m)) >= SEARCH.peak_distance_m

    def test_a_wall_in_free_space_costs(self):
        """Two maps with a wall each, and free space where the other has its wall."""
        cells = np.zeros((2, 80, 80), np.int8)
        cells[0, 10], cells[1, 70] = 100, 100
        target, source = (prepared_map(Grid(layer, 0.05)) for layer in cells)
        surface = TranslationSearch(target, source, SEARCH).surface(0.0)
        row, col = (round(-surface.origin_m[axis] / surface.step_m) for axis in (1, 0))
        assert surface.values[row, col] < -1.0

    @pytest.mark.parametrize(
        "grid", [filled(100, 1, 1), filled(100, 1, 100), filled(100, 40, 40), filled(0, 40, 40), filled(-1, 4, 4)]
    )
    def test_maps_with_little_on_them_have_an_outcome(self, grid):
        few, other = prepared_map(grid), prepared_map(flat())
        for target, source in ((few, other), (other, few), (few, few)):
            surface = TranslationSearch(target, source, SEARCH).surface(0.3)
            assert np.isfinite(surface.values).all()
            for peak in surface_peaks(surface, SEARCH):
                assert math.isfinite(peak.target_from_source.x_m)


STARTS = [
    Sim2(0.3 * math.cos(turn), 0.3 * math.sin(turn), math.radians(degrees))
    for turn, degrees in zip(np.arange(0.0, 6.2, 0.8), (1.5, -1.5) * 4, strict=True)
]


class TestRefine:
    CONFIG = RefineConfig()

    def start(self, off):
        """Return a start that is off by a turn about the flat's middle, and a shift."""
        to_centre = Sim2(*CENTRE_M)
        return to_centre @ off @ to_centre.inverse()

    def noisy(self, seed):
        """Return wall points of the flat in the frame of the target's grid."""
        target = prepared_map(flat(ragged=1))
        into_grid = target.grid.map_from_grid.inverse() @ Sim2(1.0, 1.0)
        return target, into_grid.apply(walls_of_the_flat(seed))

    @pytest.mark.parametrize("off", STARTS)
    def test_converges_from_30_cm_and_1_5_degrees(self, off):
        target, walls_m = self.noisy(2)
        found = refine(target, evenly(walls_m, 1500), self.start(off), self.CONFIG)
        position_m, angle_deg = errors(found, IDENTITY, CENTRE_M)
        assert position_m < 0.02
        assert angle_deg < 0.1

    @pytest.mark.parametrize("off", STARTS[:4])
    def test_outliers_do_not_pull_it_away(self, off):
        """30 % of the points stand about half a metre beside a wall, all on the same side."""
        target, walls_m = self.noisy(2)
        rng = np.random.default_rng(7)
        wrong = rng.uniform(size=len(walls_m)) < 0.3
        walls_m[wrong] += rng.uniform((0.3, 0.3), (0.7, 0.7), (int(wrong.sum()), 2))
        found = refine(target, walls_m, self.start(off), self.CONFIG)
        position_m, angle_deg = errors(found, IDENTITY, CENTRE_M)
        assert position_m < 0.05
        assert angle_deg < 0.2

    def test_a_map_on_itself_stays_where_it_is(self):
        prepared = prepared_map(flat())
        found = refine(prepared, prepared.walls_m, IDENTITY, self.CONFIG)
        assert errors(found, IDENTITY, CENTRE_M)[0] < 0.04

    def test_errors_of_many_placements_cancel_out(self):
        """No direction of the target's grid may be preferred: not by the order in which cells are looked at either."""
        off_m = []
        for number, turn in enumerate(np.linspace(0.1, 6.1, 16)):
            corner, place = Sim2(-1.52 + 0.013 * number, -1.5, 0.02 * number), Sim2(*CENTRE_M, turn) @ Sim2(-8.5, -7.0)
            target = prepared_map(flat(corner, ragged=2 * number, size_m=14.0))
            source = prepared_map(flat(place, ragged=2 * number + 1, size_m=17.0))
            from_floor = target.grid.map_from_grid.inverse() @ corner.inverse()
            truth = from_floor @ place @ source.grid.map_from_grid
            found = refine(target, source.walls_m, truth, self.CONFIG)
            middle_m = (place @ source.grid.map_from_grid).inverse().apply_point(*CENTRE_M)
            off_m.append(np.subtract(found.apply_point(*middle_m), truth.apply_point(*middle_m)))
        assert np.hypot(*np.transpose(off_m)).max() < 0.04
        assert np.abs(np.mean(off_m, axis=0)).max() < 0.005

    def test_far_from_every_wall_the_start_is_returned(self):
        target, walls_m = self.noisy(2)
        far = Sim2(500.0, 0.0, 0.4)
        assert refine(target, walls_m, far, self.CONFIG) == far

    def test_points_beyond_the_map_say_nothing_however_far_pairs_may_be(self):
        """Half of the source lies outside of what the target knows."""
        target, walls_m = self.noisy(2)
        both_m = np.vstack([walls_m, walls_m - (30.0, 20.0)])
        found = refine(target, both_m, IDENTITY, RefineConfig(reject_m=(3.0, 2.0)))
        assert errors(found, IDENTITY, CENTRE_M)[0] < 0.1

    @pytest.mark.parametrize("name", FEW_POINTS)
    def test_few_points_have_an_outcome(self, name):
        target, _ = self.noisy(2)
        for start in (IDENTITY, Sim2(1.0, 1.0, 0.5)):
            found = refine(target, FEW_POINTS[name], start, self.CONFIG)
            assert all(map(math.isfinite, (found.x_m, found.y_m, found.yaw_rad)))

    @pytest.mark.parametrize("grid", [filled(-1, 4, 4), filled(0, 9, 9), filled(100, 1, 1), filled(100, 1, 90)])
    def test_few_walls_have_an_outcome(self, grid):
        found = refine(prepared_map(grid), walls_of_the_flat(1), IDENTITY, self.CONFIG)
        assert all(map(math.isfinite, (found.x_m, found.y_m, found.yaw_rad)))

    def test_keeps_the_scale(self):
        target, walls_m = self.noisy(2)
        found = refine(target, walls_m / 2.0, Sim2(0.1, 0.1, scale=2.0), self.CONFIG)
        assert found.scale == 2.0
        assert errors(found, Sim2(scale=2.0), (2.0, 2.0))[0] < 0.02

    def test_slides_along_a_line_no_further_than_it_started(self):
        line = prepared_map(filled(100, 2, 200))
        found = refine(line, line.walls_m, Sim2(0.5, 0.1, math.radians(1.0)), self.CONFIG)
        assert abs(wrap_angle(found.yaw_rad)) < math.radians(0.2)
        assert found.apply_point(5.0, 0.05)[1] == pytest.approx(0.05, abs=0.03)


class TestEvenly:
    @pytest.mark.parametrize(("count", "most"), [(10, 3), (1000, 7), (8, 8), (3, 9), (0, 5), (5, 1), (5, 0)])
    def test_at_most_so_many_each_once(self, count, most):
        points = np.arange(2.0 * count).reshape(-1, 2)
        chosen = evenly(points, most)
        assert len(chosen) == min(count, most)
        assert len(np.unique(chosen, axis=0)) == len(chosen)
        if count > 0 and most > 1:
            assert np.array_equal(chosen[[0, -1]], points[[0, -1]])
