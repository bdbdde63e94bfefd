"""Features, two-pair RANSAC (equations 5 to 11) and ICP (equations 23 and 24)."""

import math

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mapmerge.paper.consensus import (
    best_models,
    conforming,
    conforming_features,
    conforming_pairs,
    conforming_to,
    limits_m,
    refitted,
)
from mapmerge.paper.features import nearest_pairs, one_a_place, sift
from mapmerge.paper.icp import icp, least_squares, occupied_cells
from mapmerge.paper.ransac import Bounds, drawn_models, models_of_all_pairs, two_pair_models
from mapmerge.sim2 import Sim2
from tests.floors import errors, flat, prepared_map

ANY = Bounds(scale=(0.01, 100.0))
RIGID = Bounds(scale=(0.97, 1.03), turn_rad=0.3, turn_step_rad=math.pi / 2, turn_tolerance_rad=0.05, min_arm_m=1.5)


def scattered(count, seed=0, size_m=20.0):
    return np.random.default_rng(seed).uniform(0.0, size_m, (count, 2))


def best(models, p, q, *, in_both=True):
    counts = conforming_features(models, p, q, limits_m(models, 0.2, in_both=in_both))
    return best_models(models, counts, p, 1, 0.75)[0]


class TestModels:
    @given(
        st.floats(-50, 50), st.floats(-50, 50), st.floats(-3.1, 3.1), st.floats(0.2, 5.0),
        st.tuples(st.floats(-9, 9), st.floats(-9, 9)),
    )  # fmt: skip
    def test_two_pairs_give_the_transform_back(self, x_m, y_m, yaw_rad, scale, arm):
        true = Sim2(x_m, y_m, yaw_rad, scale)
        p = np.array([[1.0, 2.0], [1.0 + arm[0], 2.0 + arm[1]]])
        if np.hypot(*arm) < 0.1:
            return
        q = true.apply(p)
        found = two_pair_models(p[:1], p[1:], q[:1], q[1:]).one(0)
        assert found.apply(p) == pytest.approx(q, abs=1e-6)
        assert found.scale == pytest.approx(scale, rel=1e-6)

    @pytest.mark.parametrize("draws", [200_000, 20_000])
    def test_a_similarity_is_found_among_seventy_percent_outliers(self, draws):
        true = Sim2(3.0, -2.0, 0.7, 1.6)
        p, rng = scattered(300), np.random.default_rng(1)
        q = true.apply(p) + rng.normal(0.0, 0.02, p.shape)
        q[:210] = rng.uniform(-30.0, 40.0, (210, 2))
        pairs = np.stack([np.arange(300)] * 2, axis=1)
        models = drawn_models(p, q, pairs, ANY, draws, 0)
        counts = conforming(models, p, q, pairs, limits_m(models, 0.2, in_both=False))
        found = best_models(models, counts, p, 1, 0.75)[0]
        position_m, angle_deg = errors(found, true, (10.0, 10.0))
        assert position_m < 0.2
        assert angle_deg < 0.5
        assert np.flatnonzero(conforming_to(found, p, q, pairs, 0.2)).tolist() == list(range(210, 300))

    @pytest.mark.parametrize("turns", [0, 1, 2, 3])
    def test_all_pairs_need_no_descriptors(self, turns):
        true = Sim2(5.0, 1.0, 0.3 + turns * math.pi / 2)
        p, rng = scattered(60), np.random.default_rng(2)
        q = np.vstack([rng.permutation(true.apply(p)[:25]) + rng.normal(0.0, 0.03, (25, 2)), scattered(40, 3)])
        models = models_of_all_pairs(p, q, RIGID, 30_000, 0)
        found = best(models, p, q)
        position_m, angle_deg = errors(found, true, (10.0, 10.0))
        assert position_m < 0.25
        assert angle_deg < 1.0
        assert len(conforming_pairs(found, p, q, 0.2)) >= 20

    def test_a_model_is_refitted_to_the_pairs_that_conform(self):
        true = Sim2(3.0, -2.0, 0.7, 1.6)
        p = scattered(30)
        rough = Sim2(3.02, -2.03, 0.705, 1.59)
        assert refitted(rough, p, true.apply(p)).apply(p) == pytest.approx(true.apply(p), abs=1e-9)
        assert refitted(rough, p[:2], true.apply(p[:2])) == rough

    def test_all_models_are_within_their_bounds(self):
        models = models_of_all_pairs(scattered(40), scattered(40, 1), RIGID, 10_000, 0)
        assert len(models)
        assert (np.abs(models.scale - 1.0) <= 0.03).all()
        off = (models.turn_rad - 0.3) / (math.pi / 2)
        assert (np.abs(off - np.rint(off)) * math.pi / 2 <= 0.05).all()

    def test_without_bounds_a_small_copy_wins(self):
        """Why scale is bounded: many features of one map fall into one neighbourhood of the other."""
        p, q = scattered(60), np.vstack([scattered(30, 1), scattered(12, 2, size_m=0.4) + 10.0])
        models = models_of_all_pairs(p, q, ANY, 50_000, 0)
        assert best(models, p, q, in_both=False).scale < 0.2

    def test_equal_seeds_give_equal_models(self):
        one, other, third = (
            models_of_all_pairs(scattered(40), scattered(40, 1), RIGID, 500, seed) for seed in (1, 1, 2)
        )
        assert np.array_equal(one.shift_m, other.shift_m)
        assert not np.array_equal(one.shift_m[:100], third.shift_m[:100])

    @pytest.mark.parametrize("counts", [(0, 0), (0, 5), (1, 5), (5, 1)])
    def test_too_few_features_give_no_model(self, counts):
        p, q = scattered(counts[0]), scattered(counts[1])
        assert len(models_of_all_pairs(p, q, ANY, 100, 0)) == 0
        assert len(drawn_models(p, q, np.zeros((min(1, *counts), 2), np.intp), ANY, 100, 0)) == 0

    def test_the_best_models_are_distinct(self):
        p = scattered(30)
        models = models_of_all_pairs(p, Sim2(1.0, 1.0).apply(p), Bounds(scale=(0.97, 1.03)), 20_000, 0)
        counts = conforming_features(models, p, Sim2(1.0, 1.0).apply(p), limits_m(models, 0.2, in_both=True))
        distinct = best_models(models, counts, p, 6, 0.75)
        assert len(distinct) == 6
        corners = np.array([p.min(axis=0), p.max(axis=0)])
        for index, one in enumerate(distinct):
            for other in distinct[:index]:
                assert np.abs(one.apply(corners) - other.apply(corners)).max() > 0.75


class TestFeatures:
    def test_corners_are_features_at_their_places(self):
        picture = np.zeros((80, 120), np.uint8)
        cv2.rectangle(picture, (20, 15), (100, 60), 255, 3)
        found = sift(picture, 0, 300).pixels
        for corner in ((20, 15), (100, 15), (20, 60), (100, 60)):
            assert np.hypot(*(found - corner).T).min() < 3.0

    def test_they_are_at_most_so_many_and_one_a_place(self):
        picture = np.random.default_rng(0).choice(np.array([0, 255], np.uint8), (100, 100))
        found = sift(picture, 0, 50)
        assert found.pixels.shape == (50, 2)
        assert found.descriptors.shape == (50, 128)
        places = np.rint(one_a_place(found).pixels)
        assert len(np.unique(places, axis=0)) == len(places) == len(np.unique(np.rint(found.pixels), axis=0))

    @pytest.mark.parametrize("shape", [(0, 0), (1, 1), (40, 40)])
    def test_a_picture_of_nothing_has_none(self, shape):
        nothing = sift(np.zeros(shape, np.uint8), 0, 10)
        assert len(nothing.pixels) == 0
        assert nearest_pairs(nothing, nothing).shape == (0, 2)

    def test_each_is_paired_with_the_nearest_descriptor(self):
        picture = np.random.default_rng(0).choice(np.array([0, 255], np.uint8), (60, 60))
        found = sift(picture, 0, 40)
        assert nearest_pairs(found, found).tolist() == [[each, each] for each in range(len(found.pixels))]


class TestIcp:
    @given(st.floats(-9, 9), st.floats(-9, 9), st.floats(-3.1, 3.1))
    def test_least_squares_is_exact_on_exact_pairs(self, x_m, y_m, yaw_rad):
        p = scattered(20)
        q = Sim2(x_m, y_m, yaw_rad).apply(p)
        assert least_squares(p, q).apply(p) == pytest.approx(q, abs=1e-9)

    @pytest.mark.parametrize("start", [Sim2(0.15, -0.1, 0.02), Sim2(-0.2, 0.0, -0.025), Sim2()])
    def test_a_small_error_is_mended(self, start):
        target, source = prepared_map(flat()), prepared_map(flat(ragged=1))
        cells = occupied_cells(target.wall_cells_m, 0.05)
        true = target.grid.map_from_grid.inverse() @ source.grid.map_from_grid
        found = icp(cells, source.wall_cells_m, start @ true, (0.6, 0.3), 30)
        position_m, angle_deg = errors(found, true, (4.0, 3.0))
        assert position_m < 0.05
        assert angle_deg < 0.5

    def test_walls_of_one_map_alone_pull_only_without_a_limit(self):
        target = occupied_cells(prepared_map(flat()).wall_cells_m, 0.05)
        own = Sim2(4.0, 7.5).apply(scattered(1500, size_m=1.5))
        points = np.vstack([target.cells_m, own])
        bounded = icp(target, points, Sim2(), (0.6, 0.3), 30)
        literal = icp(target, points, Sim2(), (1000.0,), 30)
        assert errors(bounded, Sim2(), (4.0, 3.0))[0] < 0.05
        assert errors(literal, Sim2(), (4.0, 3.0))[0] > 0.2

    def test_the_scale_is_kept_unless_it_is_free(self):
        target = occupied_cells(prepared_map(flat()).wall_cells_m, 0.05)
        start = Sim2(0.1, 0.0, 0.0, 1.01)
        assert icp(target, target.cells_m, start, (0.6,), 30).scale == 1.01
        found = icp(target, target.cells_m, start, (0.6, 0.3), 30, scale_range=(0.5, 2.0))
        assert found.scale == pytest.approx(1.0, abs=0.002)
        held = icp(target, target.cells_m, start, (0.6, 0.3), 30, scale_range=(1.005, 2.0))
        assert 1.005 <= held.scale <= 1.01

    def test_without_walls_the_start_is_kept(self):
        target = occupied_cells(prepared_map(flat()).wall_cells_m, 0.05)
        assert icp(target, np.empty((0, 2)), Sim2(1.0), (0.6,), 30) == Sim2(1.0)

    def test_the_nearest_occupied_cell_is_found_wherever_a_point_lies(self):
        cells_m = (np.array([[2, 1], [9, 1], [2, 7]]) + 0.5) * 0.05
        target = occupied_cells(cells_m, 0.05)
        points = np.array([[0.1, 0.05], [0.5, 0.1], [0.1, 0.4], [99.0, 0.0], [0.0, 99.0], [-99.0, -99.0]])
        assert np.array_equal(target.nearest_to(points), cells_m[[0, 1, 2, 1, 2, 0]])
