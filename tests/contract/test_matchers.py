"""What every matcher does, whatever its method: right or refused, and always explained."""

import math
from dataclasses import dataclass, fields, is_dataclass

import numpy as np
import pytest

from mapmerge.grid import Grid
from mapmerge.match import MATCHERS, Match, load_matcher
from mapmerge.match.weigh import shares_too_little
from mapmerge.prior import Prior
from mapmerge.reasons import ReasonCode
from mapmerge.render import MAX_SIDE_PX, render
from mapmerge.sim2 import IDENTITY, Sim2
from samples.mission import known_at
from tests.floors import (
    BAY_M,
    CONFIG,
    FLAT_M,
    FLAT_WALLS,
    Pair,
    corridor_run,
    drawn,
    errors,
    filled,
    flat,
    in_frame,
    last_map,
    match_grids,
    office_pair,
    office_run,
    outline,
    pair_of,
    within,
)


@dataclass(frozen=True)
class Promise:
    """What a method promises, beyond what all of them do.

    Parameters
    ----------
    position_m, angle_deg
        Errors of what it accepts stay below these.
    finds
        Whether it finds the placements of these tests; else it may refuse them, but not get them wrong.
    omega_alone
        Whether it accepts on the acceptance index alone, whatever else speaks against a placement.
    """

    position_m: float = 0.1
    angle_deg: float = 0.5
    finds: bool = True
    omega_alone: bool = False


PROMISES = {
    "correlation": Promise(),
    "paper": Promise(angle_deg=1.0, omega_alone=True),  # ICP on centres of cells ends within a cell
    "existing": Promise(position_m=0.25, angle_deg=2.0, finds=False, omega_alone=True),  # no ICP
}
OF_A_PAIR = {
    ReasonCode.ACCEPTED,
    ReasonCode.TOO_LITTLE_STRUCTURE,
    ReasonCode.NO_CANDIDATE,
    ReasonCode.TOO_LITTLE_OVERLAP,
    ReasonCode.WALLS_DISAGREE,
    ReasonCode.LOW_ACCEPTANCE,
    ReasonCode.AMBIGUOUS,
    ReasonCode.LOW_CONFIDENCE,
    ReasonCode.PRIOR_CONTRADICTED,
}


@pytest.fixture(params=sorted(MATCHERS), scope="module")
def method(request):
    return request.param


@pytest.fixture(scope="module")
def matcher(method):
    return load_matcher(method)


@pytest.fixture(scope="module")
def promise(method):
    return PROMISES[method]


def standing(rival):
    """Return what rivals are sorted by: how likely they are, those that share too little last; else by score."""
    if rival.fit is None or rival.likelihood is None:
        return (-rival.score_m,)
    return shares_too_little(rival.fit, CONFIG.verify), -rival.likelihood


def checked(match: Match) -> Match:
    """Return the match, once all that holds for every match is found to hold."""
    assert match.accepted == (match.reason.code is ReasonCode.ACCEPTED)
    assert match.reason.code in OF_A_PAIR
    assert len(match.reason.message.split()) >= 4
    assert not {"nan", "inf", "None"} & set(match.reason.message.replace(",", " ").split())
    assert (match.target_from_source is None) == (match.scores is None)
    assert match.confidence is None or 0.0 <= match.confidence <= 1.0
    assert all(math.isfinite(rival.score_m) for rival in match.rivals)
    if match.scores is not None:
        assert all(math.isfinite(getattr(match.scores, field.name)) for field in fields(match.scores))
        assert 0.0 <= match.scores.acceptance <= 1.0
        assert 0.0 <= match.scores.overlap_fraction <= 1.0
        assert 0.0 <= match.scores.wall_agreement <= 1.0
    if match.accepted:
        assert match.target_from_source is not None
    rivals = match.rivals[1:] if match.reason.code is ReasonCode.PRIOR_CONTRADICTED else match.rivals
    order = [standing(rival) for rival in rivals]
    assert order == sorted(order)
    return match


def assert_told(evidence, match):
    """Check what a method tells of a match, refused or not."""
    assert evidence or not match.accepted
    assert len({each.step for each in evidence}) == len(evidence)
    for each in evidence:
        picture = render(each).rgb
        assert picture.dtype == np.uint8
        assert picture.shape[2:] == (3,)
        assert 0 < max(picture.shape) <= MAX_SIDE_PX


def matched(matcher, target, source, prior=None):
    """Return the match of two maps, once it and what is told of it afterwards were checked."""
    resolution_m = max(CONFIG.search.working_cell_m, target.resolution_m, source.resolution_m)
    maps = [matcher.prepare(grid, resolution_m, CONFIG) for grid in (target, source)]
    match = checked(matcher.match(*maps, CONFIG, prior))
    assert_told(matcher.explain(*maps, match, CONFIG), match)
    return match


def assert_right(match, pair, promise):
    if match.accepted or promise.finds:
        assert match.accepted, match.reason
        position_m, angle_deg = pair.errors(match.target_from_source)
        assert position_m < promise.position_m
        assert angle_deg < promise.angle_deg


def assert_refused(match):
    assert not match.accepted, (match.reason, match.target_from_source)


def assert_refused_by_more_than_omega(match, promise):
    """The maps agree at a placement that is not to be trusted: a method that goes by ω alone cannot tell."""
    if promise.omega_alone and match.scores is not None:
        assert match.accepted == (match.scores.acceptance >= CONFIG.verify.min_acceptance)
    else:
        assert_refused(match)


def alike(one, other):
    """Tell whether two values are the same in every field and every bit."""
    if type(one) is not type(other):
        return False
    if isinstance(one, np.ndarray):
        return one.dtype == other.dtype and np.array_equal(one, other)
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(alike, one, other))
    if is_dataclass(one):
        return all(alike(getattr(one, field.name), getattr(other, field.name)) for field in fields(one))
    if callable(one):
        # what is computed only when it is asked for
        return alike(one(), other())
    return one == other


class TestRight:
    @pytest.mark.parametrize("seed", range(4))
    def test_a_known_placement_is_found(self, matcher, promise, seed):
        pair = office_pair(seed)
        assert_right(matched(matcher, pair.target, pair.source), pair, promise)

    @pytest.mark.parametrize("turn_rad", [0.0, 0.35, math.pi / 2, 2.2, math.pi, -2.9, -math.pi / 2, -0.8])
    def test_at_any_turn(self, matcher, promise, turn_rad):
        walls = {"inside": within(0.0, 0.0, *FLAT_M), "walls": FLAT_WALLS}
        corner = Sim2(*FLAT_M, turn_rad) @ Sim2(-11.0, -9.0)
        target = drawn(**walls, size_m=(13.0, 10.0), floor_from_map=Sim2(-2.03, -2.01), ragged=1)
        source = drawn(**walls, size_m=(16.0, 16.0), floor_from_map=corner, ragged=2)
        pair = Pair(target, source, Sim2(-2.03, -2.01).inverse() @ corner)
        assert_right(matched(matcher, target, source), pair, promise)

    @pytest.mark.parametrize("resolutions_m", [(0.05, 0.08), (0.08, 0.05), (0.1, 0.05), (0.05, 0.03)])
    def test_at_different_resolutions(self, matcher, promise, resolutions_m):
        pair = office_pair(1, resolutions_m=resolutions_m)
        assert_right(matched(matcher, pair.target, pair.source), pair, promise)

    @pytest.mark.parametrize("frames", [(Sim2(30.0, -8.0, 0.7), IDENTITY), (IDENTITY, Sim2(-3.0, 900.0, -2.2))])
    def test_with_a_turned_origin(self, matcher, promise, frames):
        pair = office_pair(2)
        moved = Pair(
            in_frame(pair.target, frames[0]),
            in_frame(pair.source, frames[1]),
            frames[0] @ pair.target_from_source @ frames[1].inverse(),
        )
        match = matched(matcher, moved.target, moved.source)
        assert_right(match, moved, promise)
        still = match_grids(matcher, pair.target, pair.source).target_from_source
        expected = frames[0] @ still @ frames[1].inverse()
        assert errors(match.target_from_source, expected, moved.shared_m) == pytest.approx((0.0, 0.0), abs=1e-6)

    @pytest.mark.parametrize("seed", [0, 3])
    def test_swapping_the_maps_gives_the_inverse(self, matcher, promise, seed):
        pair = office_pair(seed)
        there = matched(matcher, pair.target, pair.source)
        back = matched(matcher, pair.source, pair.target)
        assert_right(there, pair, promise)
        assert_right(back, pair.swapped, promise)
        if not promise.finds:
            return
        position_m, angle_deg = errors(back.target_from_source.inverse(), there.target_from_source, pair.shared_m)
        assert position_m < promise.position_m
        assert angle_deg < promise.angle_deg
        assert back.scores.wall_agreement == pytest.approx(there.scores.wall_agreement, abs=0.05)
        assert back.scores.overlap_m2 == pytest.approx(there.scores.overlap_m2, rel=0.05)

    def test_unknown_margins_do_not_matter(self, matcher, promise):
        pair = office_pair(3)
        margin = np.pad(pair.source.cells, ((37, 5), (11, 53)), constant_values=-1)
        source = Grid(margin, 0.05, pair.source.map_from_grid @ Sim2(-11 * 0.05, -37 * 0.05))
        assert_right(matched(matcher, pair.target, source), pair, promise)

    def test_figures_are_those_of_the_truth(self, matcher):
        pair = office_pair(1)
        scores = matched(matcher, pair.target, pair.source).scores
        centres_m = pair.source.centres_m(pair.source.known)
        both_m2 = 0.05**2 * np.count_nonzero(known_at(pair.target, pair.target_from_source.apply(centres_m)))
        assert scores.overlap_m2 == pytest.approx(both_m2, rel=0.05)
        smaller_m2 = min(pair.target.known_area_m2, pair.source.known_area_m2)
        assert scores.overlap_fraction == pytest.approx(both_m2 / smaller_m2, rel=0.05)


def believed(pose, sigma_m=0.3, sigma_rad=0.06):
    return Prior(pose, sigma_m, sigma_m, sigma_rad, "given for r2")


class TestPrior:
    @pytest.mark.parametrize("off", [Sim2(), Sim2(0.6, -0.5, 0.1), Sim2(-0.4, -0.7, -0.15)])
    def test_a_placement_within_it_is_found(self, matcher, promise, off):
        pair = office_pair(2)
        true = pair.target_from_source
        prior = believed(Sim2(true.x_m + off.x_m, true.y_m + off.y_m, true.yaw_rad + off.yaw_rad))
        match = matched(matcher, pair.target, pair.source, prior)
        assert_right(match, pair, promise)
        assert not match.accepted or prior.allows(match.target_from_source)

    @pytest.mark.parametrize("off", [Sim2(4.0, 0.0), Sim2(0.0, -1.5), Sim2(0.0, 0.0, 2.5)])
    def test_none_without_it_is_accepted(self, matcher, off):
        pair = office_pair(2)
        true = pair.target_from_source
        prior = believed(Sim2(true.x_m + off.x_m, true.y_m + off.y_m, true.yaw_rad + off.yaw_rad))
        assert_refused(matched(matcher, pair.target, pair.source, prior))


class TestRepeats:
    @pytest.mark.parametrize("seeds", [(1, 1), (1, 2)])
    def test_the_same_maps_have_the_same_outcome_in_every_field(self, matcher, seeds):
        target, source = office_pair(seeds[0]).target, office_pair(seeds[1]).source
        copies = [Grid(grid.cells.copy(), grid.resolution_m, grid.map_from_grid) for grid in (target, source)]
        assert alike(match_grids(matcher, target, source), match_grids(matcher, *copies))

    def test_a_prepared_map_is_not_used_up(self, matcher):
        pair, config = office_pair(1), CONFIG
        target, source = (matcher.prepare(grid, 0.05, config) for grid in (pair.target, pair.source))
        first = matcher.match(target, source, config)
        matcher.match(source, target, config)
        assert alike(first, matcher.match(target, source, config))


LONG_WALLS = {
    "one wall seen from one side": [(-99.0, 6.0, 99.0, 6.1)],
    "two halls": [(-99.0, -0.1, 99.0, 0.0), (-99.0, 2.0, 99.0, 2.1), (-99.0, 6.0, 99.0, 6.1)],
}

BAYS = [((0, 3), (3, 6)), ((0, 4), (2, 6)), ((1, 4), (2, 5)), ((1, 3), (2, 4)), ((2, 4), (2, 4))]

NEARLY_NOTHING = {
    "no cells": filled(0, 0, 0),
    "no rows": filled(0, 0, 9),
    "all unknown": filled(-1, 120, 120),
    "all free": filled(0, 120, 120),
    "all occupied": filled(100, 120, 120),
    "neither free nor occupied": filled(45, 120, 120),
    "one cell": filled(100, 1, 1),
    "one free cell": filled(0, 1, 1),
    "one row": filled(100, 1, 300),
    "one column": filled(100, 300, 1),
    "one wall": drawn(within(0.0, 0.0, 14.0, 4.0), [(0.0, 2.0, 14.0, 2.1)], size_m=(14.0, 4.0)),
    "one wall seen from one side": drawn(within(0.0, 0.0, 14.0, 2.0), [(0.0, 2.0, 14.0, 2.1)], size_m=(14.0, 4.0)),
    "noise": Grid(np.random.default_rng(0).choice(np.array([-1, 0, 100], np.int8), (120, 120)), 0.05),
    "coarse": filled(100, 2, 2, resolution_m=10.0),
}


class TestRefused:
    @pytest.mark.parametrize("seeds", [(0, 1), (1, 3), (2, 0), (3, 2), (4, 5), (6, 7)])
    def test_maps_of_two_floors(self, matcher, seeds):
        target, source = office_run(seeds[0], 0.0, 0.7, 0.4, 1), office_run(seeds[1], 1.0, 0.3, 1.9, 2)
        assert_refused(matched(matcher, last_map(target), last_map(source)))

    @pytest.mark.parametrize("seed", [1, 4])
    def test_maps_of_one_floor_that_do_not_meet(self, matcher, promise, seed):
        target, source = office_run(seed, 0.0, 0.25, 0.4, 1), office_run(seed, 1.0, 0.75, 1.9, 2)
        pair = pair_of(target, source)
        match = matched(matcher, pair.target, pair.source)
        if match.accepted:
            assert_right(match, pair, promise)

    @pytest.mark.parametrize("axis", [0, 1])
    def test_a_mirrored_copy(self, matcher, axis):
        for grid in (flat(ragged=1), office_pair(1).target):
            mirrored = Grid(np.flip(grid.cells, axis).copy(), grid.resolution_m)
            assert_refused(matched(matcher, grid, mirrored))

    @pytest.mark.parametrize("size_m", [(6.0, 6.0), (8.0, 5.0)])
    def test_a_room_that_looks_the_same_from_the_other_side(self, matcher, promise, size_m):
        corner = Sim2(-0.5, -0.5)
        rooms = [
            drawn(
                within(0.0, 0.0, *size_m),
                outline(0.0, 0.0, *size_m),
                size_m=(size_m[0] + 1, size_m[1] + 1),
                floor_from_map=corner,
                ragged=seed,
            )
            for seed in (1, 2)
        ]
        match = matched(matcher, *rooms)
        assert_refused_by_more_than_omega(match, promise)
        if not promise.omega_alone:
            assert match.reason.code is ReasonCode.AMBIGUOUS
            assert match.rivals

    @pytest.mark.parametrize("name", LONG_WALLS)
    @pytest.mark.parametrize("lengths_m", [(12.0, 12.0), (12.0, 20.0), (24.0, 23.0)])
    def test_walls_without_an_end(self, matcher, promise, name, lengths_m):
        """Nothing tells how far the maps are shifted along the walls, though some shift scores highest."""
        maps = [
            drawn(
                within(-99.0, 0.0, 99.0, 6.0),
                LONG_WALLS[name],
                size_m=(length_m, 7.0),
                floor_from_map=Sim2(0.0, -0.5),
                ragged=seed,
            )
            for seed, length_m in enumerate(lengths_m)
        ]
        assert_refused_by_more_than_omega(matched(matcher, *maps), promise)

    @pytest.mark.parametrize(("target_bays", "source_bays"), BAYS)
    def test_a_corridor_that_looks_alike_is_not_placed_a_bay_off(self, matcher, promise, target_bays, source_bays):
        pair = pair_of(corridor_run(*target_bays, 0.3, 1), corridor_run(*source_bays, 1.1, 2))
        match = matched(matcher, pair.target, pair.source)
        if promise.omega_alone:
            return
        assert match.target_from_source is not None
        position_m, angle_deg = pair.errors(match.target_from_source)
        # seen from the other side, its bays look the same as well
        assert not match.accepted or (position_m < 0.25 * BAY_M and angle_deg < 5.0), match.cues

    @pytest.mark.parametrize("name", NEARLY_NOTHING)
    def test_maps_with_nothing_to_go_by(self, matcher, name):
        nearly_nothing, map_of_a_flat = NEARLY_NOTHING[name], flat()
        assert_refused(matched(matcher, nearly_nothing, map_of_a_flat))
        assert_refused(matched(matcher, map_of_a_flat, nearly_nothing))

    @pytest.mark.parametrize("name", sorted(set(NEARLY_NOTHING) - {"noise"}))
    def test_maps_with_nothing_to_go_by_and_their_copies(self, matcher, promise, name):
        nearly_nothing = NEARLY_NOTHING[name]
        assert_refused_by_more_than_omega(matched(matcher, nearly_nothing, nearly_nothing), promise)
