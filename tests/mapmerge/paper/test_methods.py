"""The two methods as a whole: what their settings do, what they show, when they refuse and why."""

import math
from dataclasses import replace

import numpy as np
import pytest

from mapmerge.config import ExistingConfig, MergeConfig, PaperConfig, RansacConfig
from mapmerge.evidence import ImagesEvidence, OverlayEvidence
from mapmerge.grid import Grid
from mapmerge.match import load_matcher
from mapmerge.prior import Prior
from mapmerge.reasons import ReasonCode
from mapmerge.sim2 import Sim2
from tests.floors import filled, flat, match_grids, office_pair

STEPS = (
    "binarised",
    "radon",
    "rotated",
    "closed",
    "interest_points",
    "corrected",
    "keypoints",
    "inliers",
    "overlay",
)


@pytest.fixture(params=["paper", "existing"])
def method(request):
    return request.param


def matched(method, target, source, config=None, prior=None):
    config = config or MergeConfig(method=method)
    matcher = load_matcher(method)
    resolution_m = max(0.05, target.resolution_m, source.resolution_m)
    return matcher.match(*(matcher.prepare(grid, resolution_m, config) for grid in (target, source)), config, prior)


def prior_at(pose, sigma_m=0.2):
    return Prior(pose, sigma_m, sigma_m, 0.05, "given for r2")


def test_each_step_is_shown(method):
    pair = office_pair(0)
    evidence = matched(method, pair.target, pair.source).evidence
    assert tuple(each.step for each in evidence) == (STEPS if method == "paper" else STEPS[-3:])
    assert isinstance(evidence[-1], OverlayEvidence)
    inliers = evidence[-2]
    assert isinstance(inliers, ImagesEvidence)
    assert len(inliers.pairs) == len(inliers.target.marks) == len(inliers.source.marks) > 4


def test_joined_features_lie_on_each_other():
    pair = office_pair(0)
    match = matched("existing", pair.target, pair.source)
    inliers = match.evidence[-2]
    targets_m, sources_m = (
        grid.cropped_to_known().map_from_grid.apply((image.marks + 0.5) * 0.05)
        for grid, image in ((pair.target, inliers.target), (pair.source, inliers.source))
    )
    off_m = np.hypot(*(match.target_from_source.apply(sources_m) - targets_m).T)
    assert off_m.max() < 0.2


@pytest.mark.parametrize("method", ["paper"])
def test_the_scale_is_estimated_where_resolutions_are_not_believed(method):
    """The source's map says half of its true resolution."""
    pair = office_pair(1)
    source = Grid(
        pair.source.cells, 0.025, Sim2(0.5 * pair.source.map_from_grid.x_m, 0.5 * pair.source.map_from_grid.y_m)
    )
    config = MergeConfig(method=method, scale="free", scale_range=(1.6, 2.5))
    found = matched(method, pair.target, source, config)
    assert found.target_from_source.scale == pytest.approx(2.0, rel=0.02)
    double = Sim2(found.target_from_source.x_m, found.target_from_source.y_m, found.target_from_source.yaw_rad)
    position_m, angle_deg = pair.errors(double)
    assert position_m < 0.3
    assert angle_deg < 2.0


def test_with_believed_resolutions_a_placement_is_rigid(method):
    pair = office_pair(0, resolutions_m=(0.05, 0.08))
    match = matched(method, pair.target, pair.source)
    assert match.target_from_source is None or match.target_from_source.scale == 1.0


def test_a_prior_that_is_right_is_no_hindrance(method):
    pair = office_pair(0)
    match = matched(method, pair.target, pair.source, prior=prior_at(pair.target_from_source))
    assert match.accepted, match.reason
    assert pair.errors(match.target_from_source)[0] < 0.25


def test_a_prior_that_is_wrong_is_obeyed(method):
    pair = office_pair(0)
    elsewhere = prior_at(Sim2(3.0, -2.0) @ pair.target_from_source)
    match = matched(method, pair.target, pair.source, prior=elsewhere)
    assert not match.accepted or elsewhere.allows(match.target_from_source)
    far = prior_at(Sim2(300.0, 0.0) @ pair.target_from_source)
    refused = matched(method, pair.target, pair.source, prior=far)
    assert not refused.accepted
    assert refused.reason.code is ReasonCode.PRIOR_CONTRADICTED


def test_a_match_is_trusted_by_its_acceptance_index(method):
    pair = office_pair(0)
    match = matched(method, pair.target, pair.source)
    assert match.trust == match.scores.acceptance
    assert match.confidence is None


@pytest.mark.parametrize("nearly_nothing", [filled(-1, 40, 40), filled(0, 0, 0)])
def test_maps_without_walls_have_too_little_structure(method, nearly_nothing):
    match = matched(method, nearly_nothing, flat())
    assert match.reason.code is ReasonCode.TOO_LITTLE_STRUCTURE
    assert match.target_from_source is None


def test_what_is_below_the_threshold_is_refused_with_its_placement(method):
    pair = office_pair(0)
    strict = MergeConfig(method=method)
    strict = replace(strict, verify=replace(strict.verify, min_acceptance=0.9999))
    match = matched(method, pair.target, pair.source, strict)
    assert match.reason.code is ReasonCode.LOW_ACCEPTANCE
    assert match.target_from_source is not None


def test_large_maps_are_worked_on_at_a_coarser_resolution():
    pair = office_pair(0)
    config = MergeConfig(
        method="paper", paper=PaperConfig(max_side_cells=200), existing=ExistingConfig(max_side_cells=200)
    )
    match = match_grids(load_matcher("paper"), pair.target, pair.source, config)
    assert max(match.evidence[0].target.pixels.shape) <= 200
    assert pair.errors(match.target_from_source)[0] < 0.25


def test_without_bounds_on_the_scale_it_collapses():
    """The paper read to the letter; see the benchmark of the authors' own maps."""
    pair = office_pair(0)
    literal = PaperConfig(turn_tolerance_rad=0.0, max_models=1, ransac=RansacConfig(in_both=False))
    config = MergeConfig(method="paper", scale="free", scale_range=(0.01, 100.0), paper=literal)
    assert matched("paper", pair.target, pair.source, config).target_from_source.scale < 0.2


def test_the_turn_is_a_multiple_of_a_right_angle_after_both_maps_were_turned():
    pair = office_pair(2)
    matcher, config = load_matcher("paper"), MergeConfig(method="paper")
    target, source = (matcher.prepare(grid, 0.05, config) for grid in (pair.target, pair.source))
    turned = pair.target_from_source.yaw_rad - (source.correction.radon.turn_rad - target.correction.radon.turn_rad)
    assert abs(math.remainder(turned, math.pi / 2)) < config.paper.turn_tolerance_rad
