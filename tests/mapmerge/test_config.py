"""Settings: what is refused, and where the classes of cells begin."""

import json
import math
import re
from dataclasses import asdict, dataclass
from fractions import Fraction
from typing import Annotated

import numpy as np
import pytest

from mapmerge.config import (
    HIGHEST_CONFIDENCE,
    CellConfig,
    MergeConfig,
    RansacConfig,
    RefineConfig,
    SearchConfig,
    VerifyConfig,
)
from mapmerge.errors import ConfigError, GridError, MapMergeError
from mapmerge.settings import Above, Settings


def test_errors_form_one_tree():
    assert issubclass(ConfigError, MapMergeError)
    assert issubclass(GridError, MapMergeError)
    assert issubclass(MapMergeError, ValueError)


class TestNumbers:
    @pytest.mark.parametrize("value", [-0.001, math.nan, math.inf, -math.inf])
    @pytest.mark.parametrize(
        ("settings", "name"),
        [
            (CellConfig, "p_free"),
            (SearchConfig, "cell_m"),
            (SearchConfig, "clear_likeness"),
            (RefineConfig, "iterations"),
            (VerifyConfig, "violation_weight"),
            (MergeConfig, "moved_rad"),
        ],
    )
    def test_negative_or_not_finite_is_refused_and_named(self, settings, name, value):
        with pytest.raises(ConfigError, match=name):
            settings(**{name: value})

    @pytest.mark.parametrize("name", ["wall_spacing_m", "angle_step_rad", "cell_m", "sweep_cell_m"])
    def test_what_is_divided_by_must_be_positive(self, name):
        with pytest.raises(ConfigError, match=name):
            SearchConfig(**{name: 0})

    def test_limits_are_declared_with_the_fields(self):
        """A setting that is renamed, or another one of its name, must not lose its check or get one."""

        @dataclass(frozen=True, slots=True)
        class Own(Settings):
            share: Annotated[float, Above(0.0, 1.0)] = 0.5
            cell_m: float = 0.0

        assert Own(1, 0.0) == Own(share=1.0)
        with pytest.raises(ConfigError, match=r"^share is 0; expected a number more than 0, at most 1$"):
            Own(share=0)

    @pytest.mark.parametrize(
        ("settings", "name", "value", "said"),
        [
            (VerifyConfig, "min_overlap_m2", "3", "min_overlap_m2 is '3'; expected a number from 0 to 1e+12"),
            (VerifyConfig, "min_overlap_m2", True, "min_overlap_m2 is True; expected a number"),
            (VerifyConfig, "near_m", 1e9, "near_m is 1000000000.0; expected a number from 0 to 20"),
            (SearchConfig, "weighed", 10**400, "weighed is 1000"),
            (SearchConfig, "weighed", 10**5000, "weighed is a number of too many digits; expected a whole number from"),
            (SearchConfig, "clear_wall_m", Fraction(10**400), "clear_wall_m is Fraction(1000"),
            (SearchConfig, "weighed", 8.5, "weighed is 8.5; expected a whole number"),
            (SearchConfig, "free_weights", [], "free_weights is []; expected 1 to 100 numbers, each from 0"),
            (SearchConfig, "free_weights", 1.0, "free_weights is 1.0; expected 1 to 100 numbers"),
            (SearchConfig, "rotations", (4,), "rotations is (4,); expected 2 whole numbers, each from 0 to 1000"),
            (RefineConfig, "reject_m", ("0.3",), "reject_m is ('0.3',); expected 1 to 100 numbers"),
            (RansacConfig, "in_both", 1, "in_both is 1; expected True or False"),
            (MergeConfig, "verify", {"min_overlap_m2": 3}, "verify is {'min_overlap_m2': 3}; expected a VerifyConfig"),
            (MergeConfig, "method", None, "method is None; expected a text"),
            (MergeConfig, "scale", "fre", "scale is 'fre'; expected metadata or free"),
            (MergeConfig, "scale", np.zeros((2, 2)), "scale is array("),
        ],
        ids=lambda value: value if isinstance(value, str) else type(value).__name__,
    )
    def test_values_of_another_kind_are_refused_in_one_line(self, settings, name, value, said):
        with pytest.raises(ConfigError, match=f"^{re.escape(said)}") as refused:
            settings(**{name: value})
        assert len(str(refused.value)) < 200
        assert "\n" not in str(refused.value)

    def test_numbers_of_numpy_and_lists_become_those_of_python(self):
        weights = [np.float64(0.5), np.int8(1)]
        config = SearchConfig(weighed=np.int64(4), cell_m=np.float16(0.5), free_weights=weights)
        assert config == SearchConfig(weighed=4, cell_m=0.5, free_weights=(0.5, 1))
        assert {type(each) for each in (config.weighed, config.cell_m, *config.free_weights)} == {int, float}
        assert json.loads(json.dumps(asdict(config)))["weighed"] == 4
        assert hash(config)

    @pytest.mark.parametrize("reject_m", [(0.8, -0.1), (math.nan,), (0.4, math.inf), (0.0,)])
    def test_distances_of_a_sequence_are_checked_one_by_one(self, reject_m):
        with pytest.raises(ConfigError, match="reject_m"):
            RefineConfig(reject_m=reject_m)

    @pytest.mark.parametrize("value", [0, 0.0, 1.001, 99.9])
    def test_a_confidence_is_a_probability(self, value):
        with pytest.raises(ConfigError, match="min_confidence"):
            VerifyConfig(min_confidence=value)

    def test_no_more_is_asked_for_than_any_placement_is_given(self):
        most = VerifyConfig(min_confidence=HIGHEST_CONFIDENCE)
        assert MergeConfig(verify=most).tries == 1.0
        for config in ({"verify": VerifyConfig(min_confidence=0.99991)}, {"verify": most, "scale": "free"}):
            with pytest.raises(ConfigError, match="called surer"):
                MergeConfig(**config)

    def test_zero_is_a_fine_threshold(self):
        assert VerifyConfig(min_overlap_m2=0.0, min_matched_wall_m=0).min_overlap_m2 == 0.0
        assert SearchConfig(free_weights=(0.0, 1.0), working_cell_m=0.0).free_weights == (0.0, 1.0)

    @pytest.mark.parametrize("value", [(-0.5, 1.0), (math.nan,), (1.0, math.inf)])
    def test_weights_are_checked_one_by_one(self, value):
        with pytest.raises(ConfigError, match="free_weights"):
            SearchConfig(free_weights=value)

    @pytest.mark.parametrize("value", [(2.5, 0.4), (1.1, 1.0), (0.0, 2.0), (-1.0, 2.0), (0.5, math.inf)])
    def test_scales_are_a_range(self, value):
        with pytest.raises(ConfigError, match="scale_range"):
            MergeConfig(scale_range=value)

    def test_scales_may_be_1_only(self):
        assert MergeConfig(scale_range=(1.0, 1.0)).scale_range == (1.0, 1.0)

    @pytest.mark.parametrize("value", [1.0, 0.9])
    def test_the_ratio_of_scales_is_more_than_1(self, value):
        with pytest.raises(ConfigError, match="scale_step"):
            SearchConfig(scale_step=value)


class TestCells:
    def test_occupied_from_65_and_free_up_to_25(self):
        config = CellConfig()
        assert (config.min_occupied_percent, config.max_free_percent) == (65, 25)

    @pytest.mark.parametrize("percent", range(101))
    def test_whole_percents_are_exact(self, percent):
        """0.29 × 100 is 28.999999999999996."""
        if percent > 0:
            assert CellConfig(p_occupied=percent / 100, p_free=0.0).min_occupied_percent == percent
        if percent < 100:
            assert CellConfig(p_occupied=1.0, p_free=percent / 100).max_free_percent == percent

    @pytest.mark.parametrize(
        ("p_occupied", "p_free", "percents"), [(0.655, 0.255, (66, 25)), (0.501, 0.499, (51, 49)), (1.0, 0.0, (100, 0))]
    )
    def test_between_two_percents_the_class_begins_at_the_next(self, p_occupied, p_free, percents):
        config = CellConfig(p_occupied, p_free)
        assert (config.min_occupied_percent, config.max_free_percent) == percents

    @pytest.mark.parametrize(("p_occupied", "p_free"), [(0.5, 0.5), (0.3, 0.6), (1.01, 0.2), (0.0, 0.0)])
    def test_classes_may_not_touch_or_leave_the_range(self, p_occupied, p_free):
        with pytest.raises(ConfigError, match="p_free < p_occupied"):
            CellConfig(p_occupied, p_free)
