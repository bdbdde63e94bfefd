"""The default method as a whole: symmetry, scales, priors, and maps of unusual kinds."""

import math

import numpy as np
import pytest

from mapmerge.config import MergeConfig, VerifyConfig
from mapmerge.evidence import CurvesEvidence, OverlayEvidence, SurfaceEvidence
from mapmerge.grid import Grid
from mapmerge.match import correlation
from mapmerge.match.correlation import CorrelationMatcher
from mapmerge.match.weigh import Weighed
from mapmerge.prior import Prior
from mapmerge.reasons import ReasonCode
from mapmerge.sim2 import IDENTITY, Sim2
from tests.floors import (
    BAY_M,
    BESIDE_THE_FLAT,
    CONFIG,
    Pair,
    corridor_run,
    errors,
    filled,
    flat,
    hall_and_part,
    in_frame,
    match_grids,
    office_pair,
    pair_of,
    walled_room,
    with_another_label,
)

MATCHER = CorrelationMatcher()
FREE = MergeConfig(scale="free")
AT_M = (5.0, 4.0)


def matched(target, source, config=CONFIG, prior=None):
    return match_grids(MATCHER, target, source, config, prior)


def assert_inverse(one, other, at_m):
    """Check that two placements are the inverse of each other but for rounding."""
    assert errors(one.inverse(), other, at_m) == pytest.approx((0.0, 0.0), abs=1e-6)
    assert one.scale * other.scale == pytest.approx(1.0, abs=1e-12)


def assert_swapped(there, back, at_m):
    assert (there.accepted, there.reason, there.scores, there.cues, there.confidence) == (
        back.accepted,
        back.reason,
        back.scores,
        back.cues,
        back.confidence,
    )
    assert_inverse(there.target_from_source, back.target_from_source, at_m)
    for name in ("score_m", "likelihood", "fit"):
        assert [getattr(rival, name) for rival in there.rivals] == [getattr(rival, name) for rival in back.rivals]
    for one, other in zip(there.rivals, back.rivals, strict=True):
        assert_inverse(one.target_from_source, other.target_from_source, at_m)


def assert_placed(match, pair, limit_m=0.1, limit_deg=0.5):
    assert match.accepted, match.reason
    position_m, angle_deg = pair.errors(match.target_from_source)
    assert position_m < limit_m
    assert angle_deg < limit_deg


class TestWeighed:
    """The likeliest placement is taken, whatever it scores."""

    @staticmethod
    def preferring(row, looked_at, monkeypatch):
        """Let another placement be the likeliest at first, and note around which ones there was a look."""
        weigh, around = correlation.weighed, correlation._around
        rounds = []

        def weighed(pair, ranked, config, known):
            found = weigh(pair, ranked, config, known)
            rounds.append(found)
            if len(rounds) > 1:
                first = rounds[0].look.poses[0]
                order = sorted(range(len(found.fits)), key=lambda at: not np.array_equal(found.look.poses[at], first))
            else:
                order = [row, *(at for at in range(len(found.fits)) if at != row)]
            picked = Weighed(
                found.look.rows(order),
                tuple(found.fits[at] for at in order),
                tuple(sorted(found.log_odds, reverse=True)),
            )
            if len(rounds) == 1:
                rounds[0] = picked
            return picked

        def noted(pair, pose, scales, config):
            looked_at.append(pose[0].tolist())
            return around(pair, pose, scales, config)

        monkeypatch.setattr(correlation, "weighed", weighed)
        monkeypatch.setattr(correlation, "_around", noted)
        return rounds

    def test_what_competes_with_it_is_looked_for_as_well(self, monkeypatch):
        rooms = [walled_room((8.0, 6.0), open_ends=False, ragged=seed) for seed in (1, 2)]
        looked_at = []
        rounds = self.preferring(1, looked_at, monkeypatch)
        match = matched(*rooms)
        preferred = rounds[0].look.poses[0].tolist()
        assert looked_at[-1] == preferred
        assert looked_at[0] != preferred
        # the room looks the same from the other side: both ways round are weighed, and the second one was taken
        found = match.target_from_source
        assert min(errors(found, place, (4.0, 3.0))[0] for place in (IDENTITY, Sim2(8.0, 6.0, math.pi))) < 0.1
        assert match.rivals
        assert match.cues.fit == rounds[-1].fits[0]

    def test_rivals_say_how_likely_they_are(self):
        rooms = [walled_room((8.0, 6.0), open_ends=False, ragged=seed) for seed in (1, 2)]
        match = matched(*rooms)
        assert 0.2 < match.rivals[0].likelihood <= 1.0
        assert [rival.score_m for rival in match.rivals] == [rival.fit.score_m for rival in match.rivals]
        lead = match.cues.contest.lead_log_odds
        assert max(rival.likelihood for rival in match.rivals) == pytest.approx(math.exp(-lead))


class TestSwapped:
    @pytest.mark.parametrize("seed", [0, 3])
    @pytest.mark.parametrize("resolutions_m", [(0.05, 0.05), (0.05, 0.08)])
    def test_is_the_exact_inverse(self, seed, resolutions_m):
        pair = office_pair(seed, resolutions_m=resolutions_m)
        target = in_frame(pair.target, Sim2(4.0, -7.0, 2.2))
        source = in_frame(pair.source, Sim2(-90.0, 3.0, -0.4))
        assert_swapped(matched(target, source), matched(source, target), AT_M)

    def test_of_a_refused_pair_as_well(self):
        target, source = office_pair(0).target, office_pair(1).source
        there, back = matched(target, source), matched(source, target)
        assert not there.accepted
        assert_swapped(there, back, AT_M)

    def test_with_a_free_scale(self):
        pair = office_pair(1)
        source = with_another_label(pair.source, 1.1)
        assert_swapped(matched(pair.target, source, FREE), matched(source, pair.target, FREE), AT_M)

    def test_of_a_map_and_its_copy(self):
        target, source = flat(ragged=1), in_frame(flat(ragged=1), Sim2(3.0, 1.0, 0.7))
        there, back = matched(target, source), matched(source, target)
        assert_inverse(there.target_from_source, back.target_from_source, AT_M)
        assert errors(there.target_from_source, Sim2(3.0, 1.0, 0.7).inverse(), (3.0, 5.0))[0] < 1e-3

    def test_evidence_is_of_the_maps_as_they_were_given(self):
        pair = office_pair(3)
        for target, source in ((pair.target, pair.source), (pair.source, pair.target)):
            match = matched(target, source)
            maps = [MATCHER.prepare(grid, 0.05, CONFIG) for grid in (target, source)]
            curves, surface, overlay = MATCHER.explain(*maps, match, CONFIG)
            assert isinstance(curves, CurvesEvidence)
            assert isinstance(surface, SurfaceEvidence)
            assert isinstance(overlay, OverlayEvidence)
            assert overlay.target.grid.known_area_m2 == pytest.approx(target.known_area_m2)
            assert overlay.source.grid.known_area_m2 == pytest.approx(source.known_area_m2)
            between = overlay.target.grid.map_from_grid @ overlay.target_from_source
            shown = between @ overlay.source.grid.map_from_grid.inverse()
            assert errors(shown, match.target_from_source, AT_M) == pytest.approx((0.0, 0.0), abs=1e-6)
            assert [curve.label for curve in curves.curves].count("target") == 1
            row, col = surface.chosen
            nearby = surface.values[max(row - 2, 0) : row + 3, max(col - 2, 0) : col + 3]
            assert nearby.max() > 0.9 * surface.values.max()


class TestFrames:
    def test_margins_and_origins_change_nothing_but_the_frames(self):
        pair = office_pair(2)
        still = matched(pair.target, pair.source)
        frame = Sim2(-3.0, 900.0, -2.2)
        for padding in (((40, 3), (0, 17)), ((0, 0), (333, 1))):
            corner = pair.source.map_from_grid @ Sim2(-padding[1][0] * 0.05, -padding[0][0] * 0.05)
            source = Grid(np.pad(pair.source.cells, padding, constant_values=-1), 0.05, frame @ corner)
            moved = matched(pair.target, source)
            assert (moved.scores, moved.cues, moved.reason) == (still.scores, still.cues, still.reason)
            expected = still.target_from_source @ frame.inverse()
            assert errors(moved.target_from_source, expected, pair.shared_m) == pytest.approx((0.0, 0.0), abs=1e-6)


class TestLarge:
    @pytest.mark.parametrize("corner_m", [(1.0, 1.0), (45.0, 28.0), (44.0, 2.0)])
    @pytest.mark.parametrize("yaw_rad", [0.3, -2.9])
    def test_the_best_placement_of_a_part_is_its_own(self, corner_m, yaw_rad):
        hall, part, place = hall_and_part(corner_m, yaw_rad)
        found = matched(hall, part).target_from_source
        assert errors(found, place, (9.0, 9.0))[0] < 0.1

    def test_a_large_map_that_is_nearly_empty(self):
        cells = np.full((3000, 3000), -1, np.int8)
        small = flat(ragged=1)
        rows, cols = small.cells.shape
        cells[2700 : 2700 + rows, 10 : 10 + cols] = small.cells
        cells[5, 2990] = 0
        found = matched(Grid(cells, 0.05), flat(ragged=2))
        assert found.accepted, found.reason
        assert errors(found.target_from_source, Sim2(10 * 0.05, 2700 * 0.05), AT_M)[0] < 0.1


class TestResolutions:
    @pytest.mark.parametrize("resolutions_m", [(0.2, 0.2), (0.2, 0.05), (0.025, 0.025), (0.025, 0.1)])
    def test_coarse_and_fine_maps_are_placed(self, resolutions_m):
        pair = office_pair(1, resolutions_m=resolutions_m)
        found = matched(pair.target, pair.source)
        assert found.target_from_source is not None
        coarsest_m = max(resolutions_m)
        position_m, angle_deg = pair.errors(found.target_from_source)
        assert position_m < max(0.1, coarsest_m)
        assert angle_deg < (1.0 if coarsest_m > 0.15 else 0.5)


class TestScale:
    @pytest.mark.parametrize("seed", [1, 2])
    @pytest.mark.parametrize("factor", [1.1, 1 / 1.1, 0.5, 2.0, 1.0])
    def test_a_map_of_another_scale_is_placed_where_the_scale_is_free(self, seed, factor):
        """Such as a resolution of 0.10 m that is called 0.05 m."""
        pair = office_pair(seed)
        match = matched(pair.target, with_another_label(pair.source, factor), FREE)
        assert match.accepted, match.reason
        assert match.target_from_source.scale == pytest.approx(1.0 / factor, rel=0.01)
        as_it_is = match.target_from_source @ Sim2(scale=factor)
        position_m, angle_deg = pair.errors(as_it_is)
        assert position_m < 0.15
        assert angle_deg < 0.5

    @pytest.mark.parametrize("swapped", [False, True])
    def test_limits_are_those_of_the_placement_asked_for(self, swapped):
        """Whichever of the maps is the smaller one."""
        pair = office_pair(1)
        small = with_another_label(pair.source, 1.0 / 1.6)
        target, source, true = (small, pair.target, 1 / 1.6) if swapped else (pair.target, small, 1.6)
        within_limits = MergeConfig(scale="free", scale_range=(min(true, 1.0) * 0.95, max(true, 1.0) * 1.05))
        found = matched(target, source, within_limits)
        assert found.target_from_source.scale == pytest.approx(true, rel=0.01)
        limits = tuple(sorted((1.0, 1.0 / true)))
        beyond = MergeConfig(scale="free", scale_range=limits)
        found = matched(target, source, beyond)
        assert not found.accepted
        assert limits[0] - 1e-9 <= found.target_from_source.scale <= limits[1] + 1e-9

    def test_is_1_where_it_is_not(self):
        pair = office_pair(1)
        match = matched(pair.target, with_another_label(pair.source, 1.1))
        assert match.target_from_source.scale == 1.0
        assert all(rival.target_from_source.scale == 1.0 for rival in match.rivals)

    def test_a_prior_does_not_say_what_it_is(self):
        pair = office_pair(1)
        true = pair.target_from_source @ Sim2(scale=1 / 1.1)
        prior = Prior(Sim2(true.x_m + 0.4, true.y_m - 0.4, true.yaw_rad), 0.5, 0.5, 0.1, "given for r2")
        for swapped in (False, True):
            maps = pair.target, with_another_label(pair.source, 1.1)
            back = Sim2(prior.target_from_source.x_m, prior.target_from_source.y_m, true.yaw_rad).inverse()
            believed = Prior(true.inverse() if swapped else back.inverse(), 0.5, 0.5, 0.1, "given for r2")
            match = matched(*(maps[::-1] if swapped else maps), FREE, believed)
            assert match.accepted, match.reason
            found = match.target_from_source.inverse() if swapped else match.target_from_source
            assert found.scale == pytest.approx(1 / 1.1, rel=0.01)


def believed(pose, sigma_m=0.3, sigma_rad=0.06):
    return Prior(pose, sigma_m, sigma_m, sigma_rad, "given for r2")


class TestPrior:
    @pytest.mark.parametrize("yaw_rad", [0.4, math.pi, -math.pi / 2, math.pi - 0.02])
    @pytest.mark.parametrize("off", [Sim2(), Sim2(0.5, -0.4, 0.1), Sim2(-0.6, 0.2, -0.12)])
    def test_a_placement_within_it_is_found(self, yaw_rad, off):
        """Across half a turn as well."""
        target, source = flat(ragged=1), in_frame(flat(ragged=2), Sim2(2.0, 3.0, yaw_rad))
        true = Sim2(2.0, 3.0, yaw_rad).inverse()
        about = Sim2(true.x_m + off.x_m, true.y_m + off.y_m, true.yaw_rad + off.yaw_rad)
        match = matched(target, source, CONFIG, believed(about))
        assert match.accepted, match.reason
        assert believed(about).allows(match.target_from_source)
        assert errors(match.target_from_source, true, (2.0, 3.0))[0] < 0.05

    def test_what_it_excludes_is_no_rival(self):
        """A room that looks the same from the other side."""
        rooms = [walled_room((8.0, 6.0), open_ends=False, ragged=seed) for seed in (1, 2)]
        free = matched(*rooms)
        assert (free.accepted, free.reason.code) == (False, ReasonCode.AMBIGUOUS)
        other_side = Sim2(8.0, 6.0, math.pi)
        for true in (IDENTITY, other_side):
            match = matched(*rooms, CONFIG, believed(true))
            assert match.accepted, match.reason
            assert errors(match.target_from_source, true, (4.0, 3.0))[0] < 0.1

    @pytest.mark.parametrize("bays", [((0, 3), (3, 6)), ((1, 4), (2, 5))])
    def test_tells_the_bays_of_a_corridor_apart(self, bays):
        pair = pair_of(corridor_run(*bays[0], 0.3, 1), corridor_run(*bays[1], 1.1, 2))
        assert not matched(pair.target, pair.source).accepted
        true = pair.target_from_source
        match = matched(pair.target, pair.source, CONFIG, believed(Sim2(true.x_m + 0.4, true.y_m, true.yaw_rad)))
        assert pair.errors(match.target_from_source)[0] < 0.25 * BAY_M
        assert match.cues.contest.lead_log_odds > 1.0

    @pytest.mark.parametrize("swapped", [False, True])
    def test_that_the_maps_contradict(self, swapped):
        pair = office_pair(1)
        pair = pair.swapped if swapped else pair
        true = pair.target_from_source
        wrong = believed(Sim2(true.x_m + 6.0, true.y_m - 3.0, true.yaw_rad + 1.5))
        match = matched(pair.target, pair.source, CONFIG, wrong)
        assert not match.accepted
        assert match.reason.code is ReasonCode.PRIOR_CONTRADICTED
        assert "given for r2" in match.reason.message
        assert match.scores is not None
        assert wrong.allows(match.target_from_source)
        free = matched(pair.target, pair.source)
        assert free.accepted
        assert match.rivals[0].target_from_source == free.target_from_source
        assert match.rivals[0].score_m == free.scores.score_m
        said = f"{free.target_from_source.x_m:.2f},{free.target_from_source.y_m:.2f},"
        assert said in match.reason.message

    @pytest.mark.parametrize("right", [True, False])
    def test_swapped(self, right):
        """A prior that knows its placement well: the inverse belief is wider only by what the turn does far away."""
        pair = office_pair(3)
        true = pair.target_from_source
        about = Sim2(true.x_m + 0.1, true.y_m - 0.1, true.yaw_rad + (0.02 if right else 2.0))
        there = matched(pair.target, pair.source, CONFIG, believed(about))
        back = matched(pair.source, pair.target, CONFIG, believed(about).inverse())
        assert there.accepted == back.accepted == right
        assert there.reason.code == back.reason.code
        if right:
            assert errors(back.target_from_source.inverse(), there.target_from_source, pair.shared_m)[0] < 0.01
        else:
            one, other = there.rivals[0].target_from_source, back.rivals[0].target_from_source
            assert_inverse(one, other, AT_M)

    def test_of_maps_that_do_not_belong_together_says_why_they_do_not_fit(self):
        target, source = office_pair(0).target, office_pair(1).source
        match = matched(target, source, CONFIG, believed(IDENTITY))
        assert not match.accepted
        assert match.reason.code not in {ReasonCode.ACCEPTED, ReasonCode.PRIOR_CONTRADICTED}

    @pytest.mark.parametrize("far_m", [200.0, 1e5, 1e8])
    def test_far_away_from_all(self, far_m):
        match = matched(flat(ragged=1), flat(ragged=2), CONFIG, believed(Sim2(far_m, -far_m, 1.0)))
        assert match.reason.code is ReasonCode.PRIOR_CONTRADICTED
        assert errors(match.rivals[0].target_from_source, IDENTITY, AT_M)[0] < 0.05

    @pytest.mark.parametrize("offset_m", [1e4, 5e6])
    def test_of_maps_with_an_origin_far_away(self, offset_m):
        """Such as metres of a country's grid."""
        frame = Sim2(offset_m, -offset_m, 0.3)
        target, source = in_frame(flat(ragged=1), frame), flat(ragged=2)
        match = matched(target, source, CONFIG, believed(frame))
        assert match.accepted, match.reason
        assert errors(match.target_from_source, frame, AT_M)[0] < 0.05


LITTLE = {
    "no cells": filled(0, 0, 0),
    "one cell": filled(100, 1, 1),
    "one row": filled(100, 1, 300),
    "one column": filled(100, 300, 1),
    "one row, free": filled(0, 1, 300),
    "unknown": filled(-1, 50, 50),
    "without walls": filled(0, 200, 200),
    "without free space": Grid(np.where(flat(ragged=1).cells == 100, 100, -1).astype(np.int8), 0.05),
    "tiny": Grid(flat(ragged=1).cells[60:90, 60:90], 0.05),
}


class TestLittle:
    """Whatever is asked of the maps: with settings that refuse nothing beforehand as well."""

    ANYTHING = MergeConfig(verify=VerifyConfig(min_matched_wall_m=0.0, min_overlap_m2=0.0))
    SCALED = MergeConfig(scale="free", verify=VerifyConfig(min_matched_wall_m=0.0, min_overlap_m2=0.0))

    @pytest.mark.parametrize("config", [ANYTHING, SCALED], ids=["metadata", "free"])
    @pytest.mark.parametrize("name", LITTLE)
    def test_has_an_outcome(self, name, config):
        for target, source in ((LITTLE[name], flat(ragged=2)), (flat(ragged=2), LITTLE[name]), (LITTLE[name],) * 2):
            for prior in (None, believed(Sim2(1.0, 1.0, 0.1))):
                match = matched(target, source, config, prior)
                assert match.reason.message
                assert (match.target_from_source is None) == (match.scores is None)
                if match.confidence is not None:
                    assert 0.0 <= match.confidence <= 1.0

    def test_walls_alone_have_a_best_placement(self):
        walls = LITTLE["without free space"]
        match = matched(walls, flat(ragged=2))
        assert errors(match.target_from_source, IDENTITY, AT_M)[0] < 0.05

    def test_a_frame_is_not_lost(self):
        pair = Pair(flat(ragged=1), in_frame(flat(ragged=2), BESIDE_THE_FLAT), BESIDE_THE_FLAT.inverse())
        assert_placed(matched(pair.target, pair.source), pair, 0.05)
