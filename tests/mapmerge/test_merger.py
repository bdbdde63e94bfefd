"""The merger: what is known after each step, and what it costs."""

import itertools
import math

import numpy as np
import pytest

from mapmerge.config import MergeConfig
from mapmerge.errors import ConfigError
from mapmerge.fuse import fuse
from mapmerge.grid import Grid
from mapmerge.match import Match, Rival
from mapmerge.merger import Merger
from mapmerge.outcome import Change, ChangeKind, Status
from mapmerge.prior import Prior
from mapmerge.reasons import Reason, ReasonCode
from mapmerge.sim2 import IDENTITY, Sim2
from mapmerge.warp import Layer
from mapmerge.watch import Trigger
from tests.floors import errors, filled, last_map, office_pair, office_run, pair_of, with_another_label

ROBOTS = ("r1", "r2", "r3", "r4")
ONE, TWO, THREE, FOUR = 10, 20, 30, 40


class Session:
    """Steps one after the other; maps are given by what fills them."""

    def __init__(self, matcher, robots=ROBOTS[:3]):
        self.matcher = matcher
        self.merger = Merger(robots, matcher.config)

    def step(self, priors=None, *, is_last=False, **values):
        updates = {
            robot: value if isinstance(value, Grid) else self.matcher.map_of(value) for robot, value in values.items()
        }
        result = self.merger.step(updates, priors, is_last=is_last)
        assert result is self.merger.result
        return result


@pytest.fixture
def session(scripted):
    return Session(scripted)


def statuses(result):
    return [outcome.status for outcome in result.robots.values()]


def codes(result):
    return [outcome.reason.code for outcome in result.robots.values()]


def changes(result):
    return [(change.robot, change.kind) for change in result.changes]


class TestInitial:
    @pytest.mark.parametrize("robots", [(), ("r1", "r1"), ("r1", "r2", "r1")])
    def test_robots_are_at_least_one_and_each_once(self, robots):
        with pytest.raises(ConfigError, match="robots"):
            Merger(robots)

    def test_before_any_map(self, session, scripted):
        for result in (session.merger.result, session.step()):
            assert statuses(result) == [Status.NO_MAP] * 3
            assert codes(result) == [ReasonCode.NO_MAP] * 3
            assert result.merged is None
            assert (result.changes, result.updated) == ((), ())
            assert (result.grids, result.pairs) == ({}, {})
        assert scripted.calls() == []

    def test_a_method_that_does_not_exist(self):
        with pytest.raises(ConfigError, match=r"'none such'.*correlation"):
            Merger(ROBOTS, MergeConfig(method="none such"))


class TestReference:
    def test_alone(self, session, scripted):
        result = session.step(r1=ONE)
        assert statuses(result) == [Status.REFERENCE, Status.NO_MAP, Status.NO_MAP]
        assert result.robots["r1"].reason.code is ReasonCode.REFERENCE
        assert result.robots["r1"].merged_from_map == IDENTITY
        assert result.merged.same_as(scripted.map_of(ONE))
        assert result.changes == ()
        assert result.updated == ("r1",)

    def test_without_its_map_nothing_is_merged(self, session, scripted):
        scripted.fits(TWO, THREE)
        result = session.step(r2=TWO, r3=THREE)
        assert statuses(result) == [Status.NO_MAP, Status.UNMERGED, Status.UNMERGED]
        assert codes(result) == [ReasonCode.NO_MAP, ReasonCode.NO_REFERENCE_MAP, ReasonCode.NO_REFERENCE_MAP]
        assert result.merged is None
        assert result.changes == ()
        assert all(result.robots[robot].merged_from_map is None for robot in ROBOTS[:3])
        assert "r1" in result.robots["r2"].reason.message

    def test_when_it_comes_the_others_are_placed(self, session, scripted):
        scripted.fits(TWO, THREE, Sim2(2.0))
        scripted.fits(ONE, TWO, Sim2(1.0))
        session.step(r2=TWO, r3=THREE)
        result = session.step(r1=ONE)
        assert changes(result) == [("r2", ChangeKind.PLACED), ("r3", ChangeKind.PLACED)]
        assert result.robots["r3"].merged_from_map == Sim2(3.0)
        assert (TWO, THREE) not in scripted.calls()[1:]

    @pytest.mark.parametrize("empty", [filled(-1, 10, 10), filled(0, 0, 0)])
    def test_a_map_that_knows_nothing(self, empty):
        merger = Merger(("r1", "r2"))
        result = merger.step({"r1": empty, "r2": last_map_of_a_run()})
        assert result.merged is None or result.merged.known_area_m2 == 0.0
        assert result.robots["r2"].status is Status.UNMERGED
        result = merger.step({"r1": last_map_of_a_run()})
        assert result.merged.known_area_m2 > 50.0


def last_map_of_a_run():
    return last_map(office_run(1, 0.0, 0.7, 0.4, 1))


class TestPlacing:
    def test_is_reported_once_with_its_reason(self, session, scripted):
        scripted.fits(ONE, TWO, Sim2(1.0, 0.0, 0.5))
        result = session.step(r1=ONE, r2=TWO)
        (change,) = result.changes
        assert change == Change("r2", ChangeKind.PLACED, result.robots["r2"].reason, Trigger.FIRST)
        assert change.reason.code is ReasonCode.ACCEPTED
        assert "r1" in change.reason.message
        assert "20 fits 10" in change.reason.message
        outcome = result.robots["r2"]
        assert outcome.status is Status.MERGED
        assert outcome.merged_from_map == Sim2(1.0, 0.0, 0.5)
        assert outcome.shown_pair == ("r1", "r2")
        assert session.step(r2=TWO).changes == ()
        assert session.step().changes == ()

    def test_the_merged_map_is_the_fusion_of_what_is_placed(self, session, scripted):
        scripted.fits(ONE, TWO, Sim2(0.33, 0.1, 0.5))
        result = session.step(r1=ONE, r2=TWO, r3=THREE)
        layers = [Layer(scripted.map_of(ONE), IDENTITY), Layer(scripted.map_of(TWO), Sim2(0.33, 0.1, 0.5))]
        fusion = fuse(layers, layers[0].grid, scripted.config.cells)
        assert result.merged.same_as(fusion.grid)
        assert (result.robots["r1"].agreement, result.robots["r2"].agreement) == fusion.agreements

    def test_via_another_robot(self, session, scripted):
        scripted.fits(ONE, TWO, Sim2(1.0))
        scripted.fits(TWO, THREE, Sim2(2.0, 0.0, 1.0))
        result = session.step(r1=ONE, r2=TWO, r3=THREE)
        outcome = result.robots["r3"]
        assert outcome.merged_from_map == Sim2(3.0, 0.0, 1.0)
        assert outcome.placement.via == "r2"
        assert outcome.shown_pair == ("r2", "r3")
        assert "r2" in outcome.reason.message

    def test_a_later_robot_may_lie_between(self, scripted):
        """r2 is linked to the reference by r3 only, which comes after it."""
        session = Session(scripted)
        scripted.fits(ONE, THREE, Sim2(1.0))
        scripted.fits(TWO, THREE, Sim2(2.0))
        assert session.step(r1=ONE, r2=TWO).robots["r2"].status is Status.UNMERGED
        result = session.step(r3=THREE)
        assert result.robots["r2"].merged_from_map == Sim2(-1.0)
        assert result.robots["r2"].shown_pair == ("r2", "r3")
        assert changes(result) == [("r2", ChangeKind.PLACED), ("r3", ChangeKind.PLACED)]

    @pytest.mark.parametrize("count", [1, 2, 3, 7])
    def test_any_number_of_robots(self, scripted, count):
        robots = [f"robot {number}" for number in range(count)]
        for number in range(1, count):
            scripted.fits(number - 1, number, Sim2(1.0))
        maps = {robot: scripted.map_of(number) for number, robot in enumerate(robots)}
        result = Merger(robots, scripted.config).step(maps)
        assert [outcome.merged_from_map.x_m for outcome in result.robots.values()] == list(range(count))
        assert len(scripted.calls()) == count * (count - 1) // 2
        assert len(scripted.prepared) == (count if count > 1 else 0)
        assert result.merged.known_area_m2 == pytest.approx(float(count))

    @pytest.mark.parametrize("order", list(itertools.permutations(("r1", "r2", "r3"))))
    def test_the_order_in_which_maps_come_changes_nothing_in_the_end(self, scripted, order):
        scripted.fits(ONE, TWO, Sim2(1.0, 0.5, 0.1), 60.0)
        scripted.fits(TWO, THREE, Sim2(2.0, 0.5, 0.2), 50.0)
        scripted.fits(ONE, THREE, Sim2(3.0, 1.2, 0.3), 40.0)
        maps = {"r1": ONE, "r2": TWO, "r3": THREE}
        at_once, one_by_one = Session(scripted), Session(scripted)
        expected = at_once.step(**maps)
        for robot in order:
            result = one_by_one.step(**{robot: maps[robot]})
        assert result.robots == expected.robots
        assert result.merged.same_as(expected.merged)


class TestWork:
    def test_maps_that_say_what_was_known_cost_nothing(self, session, scripted):
        scripted.fits(ONE, TWO)
        before = session.step(r1=ONE, r2=TWO)
        assert scripted.calls() == [(ONE, TWO)]
        prepared = len(scripted.prepared)
        after = session.step(r1=ONE, r2=TWO)
        assert scripted.calls() == []
        assert len(scripted.prepared) == prepared
        assert (after.updated, after.changes) == ((), ())
        assert after.robots == before.robots
        assert after.merged is before.merged

    def test_only_pairs_of_changed_maps_are_matched(self, session, scripted):
        session.step(r1=ONE, r2=TWO, r3=THREE)
        assert scripted.calls() == [(ONE, TWO), (ONE, THREE), (TWO, THREE)]
        del scripted.prepared[:]
        result = session.step(r1=ONE, r2=FOUR)
        assert result.updated == ("r2",)
        assert scripted.calls() == [(ONE, FOUR), (FOUR, THREE)]
        assert scripted.prepared == [(FOUR, 0.05)]

    def test_a_pair_meets_at_the_coarser_resolution_but_not_below_the_working_one(self, session, scripted):
        maps = {"r1": (ONE, 0.02), "r2": (TWO, 0.1), "r3": (THREE, 0.03)}
        session.step(**{robot: scripted.map_of(*kind) for robot, kind in maps.items()})
        assert scripted.prepared == [(ONE, 0.1), (TWO, 0.1), (ONE, 0.05), (THREE, 0.05), (THREE, 0.1)]

    def test_what_was_prepared_is_kept_for_the_latest_maps_only(self, session, scripted):
        session.step(r1=ONE, r2=TWO)
        session.step(r2=THREE)
        session.step(r2=scripted.map_of(FOUR, 0.1))
        session.step(r2=FOUR, is_last=True)
        kept = session.merger._pairs._prepared._known
        assert {prepared for _, prepared in kept.values()} == {(ONE, 0.05), (FOUR, 0.05)}


class TestMoving:
    def place(self, session, scripted, *poses):
        """Give r2 a new map at each of these poses; return what was reported each time."""
        session.step(r1=ONE)
        reported = []
        for number, pose in enumerate(poses):
            scripted.fits(ONE, TWO + number, pose)
            reported.append(changes(session.step(r2=TWO + number)))
        return reported

    @pytest.mark.parametrize("pose", [Sim2(0.5), Sim2(0.0, 0.11), Sim2(yaw_rad=math.radians(0.6))])
    def test_is_reported(self, session, scripted, pose):
        placed, moved = self.place(session, scripted, Sim2(), pose)
        assert placed == [("r2", ChangeKind.PLACED)]
        assert moved == [("r2", ChangeKind.MOVED)]

    @pytest.mark.parametrize("pose", [Sim2(0.09), Sim2(yaw_rad=math.radians(0.4))])
    def test_by_little_is_not_but_the_pose_is_the_latest(self, session, scripted, pose):
        _, moved = self.place(session, scripted, Sim2(), pose)
        assert moved == []
        assert session.merger.result.robots["r2"].merged_from_map == pose

    def test_little_by_little_is_reported_in_the_end(self, session, scripted):
        steps = self.place(session, scripted, *(Sim2(0.06 * number) for number in range(5)))
        assert [bool(reported) for reported in steps] == [True, False, True, False, True]


class TestWithdrawing:
    def test_a_map_replaced_by_another_place_is_withdrawn_with_its_reason(self, session, scripted):
        scripted.fits(ONE, TWO, Sim2(1.0))
        session.step(r1=ONE, r2=TWO)
        scripted.misfits(ONE, THREE, code=ReasonCode.TOO_LITTLE_OVERLAP)
        result = session.step(r2=THREE)
        outcome = result.robots["r2"]
        assert result.changes == (Change("r2", ChangeKind.WITHDRAWN, outcome.reason, Trigger.CHANGED),)
        assert outcome.reason.code is ReasonCode.TOO_LITTLE_OVERLAP
        assert outcome.status is Status.UNMERGED
        assert outcome.merged_from_map is None
        assert result.merged.same_as(scripted.map_of(ONE))
        assert session.step(r2=THREE).changes == ()

    def test_who_was_placed_by_it_goes_with_it(self, session, scripted):
        scripted.fits(ONE, TWO, Sim2(1.0))
        scripted.fits(TWO, THREE, Sim2(1.0))
        session.step(r1=ONE, r2=TWO, r3=THREE)
        result = session.step(r2=FOUR)
        assert changes(result) == [("r2", ChangeKind.WITHDRAWN), ("r3", ChangeKind.WITHDRAWN)]

    def test_and_placed_anew(self, session, scripted):
        scripted.fits(ONE, TWO, Sim2(1.0))
        session.step(r1=ONE, r2=TWO)
        session.step(r2=THREE)
        assert changes(session.step(r2=TWO)) == [("r2", ChangeKind.PLACED)]

    def test_when_the_reference_starts_anew_all_go(self, session, scripted):
        scripted.fits(ONE, TWO, Sim2(1.0))
        session.step(r1=ONE, r2=TWO)
        result = session.step(r1=FOUR)
        assert changes(result) == [("r2", ChangeKind.WITHDRAWN)]
        assert result.merged.same_as(scripted.map_of(FOUR))


class TestUnplaced:
    def test_the_best_refused_pair_is_shown(self, session, scripted):
        scripted.misfits(ONE, THREE, 5.0)
        scripted.misfits(TWO, THREE, 6.0, ReasonCode.AMBIGUOUS)
        outcome = session.step(r1=ONE, r2=TWO, r3=THREE).robots["r3"]
        assert outcome.shown_pair == ("r2", "r3")
        assert outcome.reason.code is ReasonCode.AMBIGUOUS
        assert "r2" in outcome.reason.message
        assert outcome.agreement.acceptance == 0.5
        assert outcome.agreement.overlap_m2 == 20.0

    def test_of_equals_that_with_the_reference(self, session, scripted):
        for target in (TWO, ONE):
            scripted.misfits(target, THREE, 5.0)
        assert session.step(r1=ONE, r2=TWO, r3=THREE).robots["r3"].shown_pair == ("r1", "r3")

    def test_a_component_without_the_reference(self, session, scripted):
        scripted.fits(TWO, THREE, Sim2(2.0))
        result = session.step(r1=ONE, r2=TWO, r3=THREE)
        assert codes(result)[1:] == [ReasonCode.OTHER_COMPONENT] * 2
        assert statuses(result)[1:] == [Status.UNMERGED] * 2
        assert "r3" in result.robots["r2"].reason.message
        assert "r2" in result.robots["r3"].reason.message
        assert result.robots["r3"].placement.component == "r2"
        assert result.robots["r3"].placement.component_from_map == Sim2(2.0)
        assert result.merged.same_as(scripted.map_of(ONE))
        assert result.changes == ()

    def test_two_that_fit_nobody(self, session):
        result = session.step(r1=ONE, r2=TWO, r3=THREE)
        assert codes(result)[1:] == [ReasonCode.NO_CANDIDATE] * 2
        assert [result.robots[robot].placement.component for robot in ("r2", "r3")] == ["r2", "r3"]


class TestLoops:
    @pytest.fixture
    def contradicting(self, session, scripted):
        scripted.fits(ONE, TWO, Sim2(1.0), 60.0)
        scripted.fits(ONE, THREE, Sim2(2.0), 50.0)
        scripted.fits(TWO, THREE, Sim2(5.0), 40.0)
        return session

    def test_the_weakest_of_a_contradicting_loop_is_refused(self, contradicting):
        result = contradicting.step(r1=ONE, r2=TWO, r3=THREE)
        match = result.pairs["r2", "r3"]
        assert not match.accepted
        assert match.reason.code is ReasonCode.INCONSISTENT
        assert match.target_from_source == Sim2(5.0)
        assert [outcome.merged_from_map.x_m for outcome in result.robots.values()] == [0.0, 1.0, 2.0]

    def test_a_method_may_weigh_its_matches_by_a_measure_of_its_own(self, session, scripted):
        """The pair of largest score is the weakest of the loop by that measure."""
        scripted.fits(ONE, TWO, Sim2(1.0), 50.0, weight=0.98)
        scripted.fits(ONE, THREE, Sim2(2.0), 60.0, weight=0.97)
        scripted.fits(TWO, THREE, Sim2(5.0), 90.0, weight=0.96)
        result = session.step(r1=ONE, r2=TWO, r3=THREE)
        assert result.pairs["r2", "r3"].reason.code is ReasonCode.INCONSISTENT
        assert [outcome.merged_from_map.x_m for outcome in result.robots.values()] == [0.0, 1.0, 2.0]

    def test_it_counts_again_once_nothing_contradicts_it(self, contradicting):
        """The reference starts anew: r2 and r3 still fit each other, and nothing speaks against it any more."""
        contradicting.step(r1=ONE, r2=TWO, r3=THREE)
        result = contradicting.step(r1=FOUR)
        assert result.pairs["r2", "r3"].accepted
        assert result.pairs["r2", "r3"].reason.code is ReasonCode.ACCEPTED
        assert codes(result)[1:] == [ReasonCode.OTHER_COMPONENT] * 2

    def test_history_does_not_matter(self, contradicting, scripted):
        """The outcome is that of the latest maps alone, whatever was there before."""
        contradicting.step(r1=ONE, r2=TWO, r3=THREE)
        after = contradicting.step(r1=FOUR)
        anew = Session(scripted).step(r1=FOUR, r2=TWO, r3=THREE)
        assert after.robots == anew.robots


def prior(x_m=0.0, y_m=0.0, yaw_rad=0.0, sigma_m=1.0, sigma_rad=0.2):
    return Prior(Sim2(x_m, y_m, yaw_rad), sigma_m, sigma_m, sigma_rad, "recorded in /tf")


class TestPriors:
    def test_are_given_to_the_matcher_pair_by_pair(self, session, scripted):
        two, three = prior(1.0, 2.0, 0.5), prior(-3.0, 1.0, 2.0)
        result = session.step({"r2": two, "r3": three}, r1=ONE, r2=TWO, r3=THREE)
        assert scripted.calls() == [(ONE, TWO), (ONE, THREE), (TWO, THREE)]
        between = two.inverse().compose(three)
        assert scripted.priors == [two, three, between]
        expected = two.target_from_source.inverse() @ three.target_from_source
        assert between.target_from_source == expected
        assert dict(result.priors) == {("r1", "r2"): two, ("r1", "r3"): three, ("r2", "r3"): between}

    def test_of_one_robot_say_nothing_of_pairs_of_others(self, session, scripted):
        result = session.step({"r2": prior(1.0)}, r1=ONE, r2=TWO, r3=THREE)
        assert scripted.priors == [prior(1.0), None, None]
        assert set(result.priors) == {("r1", "r2")}

    def test_without_any_there_are_none(self, session, scripted):
        assert session.step(r1=ONE, r2=TWO).priors == {}
        assert scripted.priors == [None]

    @pytest.mark.parametrize("later", [prior(1.5), prior(1.0, 0.0, 0.01), prior(1.0, sigma_m=2.0), None])
    def test_that_changed_are_matched_anew_at_the_next_map(self, session, scripted, later):
        session.step({"r2": prior(1.0)}, r1=ONE, r2=TWO)
        scripted.calls()
        session.step({"r2": later} if later else {}, r3=THREE)
        assert scripted.calls() == [(ONE, TWO), (ONE, THREE), (TWO, THREE)]
        assert scripted.priors[1:] == [later, None, None]

    def test_that_appear_are_matched_anew(self, session, scripted):
        session.step(r1=ONE, r2=TWO)
        session.step({"r2": prior(1.0)}, r3=THREE)
        assert scripted.priors == [None, prior(1.0), None, None]

    def test_without_a_new_map_change_nothing(self, session, scripted):
        session.step({"r2": prior(1.0)}, r1=ONE, r2=TWO)
        scripted.calls()
        result = session.step({"r2": prior(5.0)}, r2=TWO)
        assert scripted.calls() == []
        assert result.priors["r1", "r2"] == prior(1.0)

    def test_jitter_is_no_change(self, session, scripted):
        session.step({"r2": prior(1.0)}, r1=ONE, r2=TWO)
        scripted.calls()
        result = session.step({"r2": prior(1.009, 0.009, 0.001)}, r3=THREE)
        assert scripted.calls() == [(ONE, THREE), (TWO, THREE)]
        assert result.priors["r1", "r2"] == prior(1.0)

    def test_little_by_little_is_a_change_in_the_end(self, session, scripted):
        session.step({"r2": prior(1.0)}, r1=ONE, r2=TWO)
        for number in range(1, 4):
            scripted.calls()
            session.step({"r2": prior(1.0 + 0.004 * number)}, r3=THREE + number)
        assert scripted.calls()[0] == (ONE, TWO)

    def test_that_are_contradicted_are_what_is_shown(self, session, scripted):
        """Another pair scores higher, but here somebody was wrong."""
        scripted.misfits(ONE, THREE, 5.0, ReasonCode.PRIOR_CONTRADICTED)
        elsewhere = Rival(Sim2(9.0), 60.0)
        match = scripted.answers[ONE, THREE]
        scripted.answers[ONE, THREE] = Match(Sim2(1.0), match.scores, False, match.reason, rivals=(elsewhere,))
        scripted.misfits(TWO, THREE, 8.0)
        result = session.step({"r3": prior(1.0)}, r1=ONE, r2=TWO, r3=THREE)
        outcome = result.robots["r3"]
        assert outcome.shown_pair == ("r1", "r3")
        assert outcome.reason.code is ReasonCode.PRIOR_CONTRADICTED
        assert result.pairs["r1", "r3"].rivals == (elsewhere,)


class TestConfidence:
    def test_is_that_of_all_matches_up_to_the_reference(self, scripted):
        session = Session(scripted, ROBOTS)
        scripted.fits(ONE, TWO, Sim2(1.0), confidence=0.99)
        scripted.fits(TWO, THREE, Sim2(1.0), confidence=0.9)
        scripted.fits(THREE, FOUR, Sim2(1.0), confidence=0.5)
        robots = session.step(r1=ONE, r2=TWO, r3=THREE, r4=FOUR).robots
        assert robots["r1"].confidence is None
        found = [robots[robot].confidence for robot in ROBOTS[1:]]
        assert found == pytest.approx([0.99, 0.99 * 0.9, 0.99 * 0.9 * 0.5])

    def test_is_not_known_where_one_of_them_states_none(self, session, scripted):
        scripted.fits(ONE, TWO, Sim2(1.0))
        scripted.fits(TWO, THREE, Sim2(1.0), confidence=0.9)
        robots = session.step(r1=ONE, r2=TWO, r3=THREE).robots
        assert [robots[robot].confidence for robot in ("r2", "r3")] == [None, None]

    def test_is_not_known_of_what_is_not_placed(self, session, scripted):
        scripted.fits(TWO, THREE, Sim2(1.0), confidence=0.9)
        robots = session.step(r1=ONE, r2=TWO, r3=THREE).robots
        assert [outcome.confidence for outcome in robots.values()] == [None] * 3


class TestState:
    def test_a_step_leaves_earlier_results_as_they_were(self, scripted):
        scripted.fits(ONE, TWO, Sim2(1.0))
        session = Session(scripted)
        result = session.step(r1=ONE, r2=TWO)
        frozen = dict(result.robots), dict(result.grids), dict(result.pairs), result.changes
        cells = result.merged.cells.copy()
        scripted.fits(THREE, FOUR, Sim2(0.5))
        session.step(r1=THREE, r2=FOUR, r3=ONE)
        assert frozen == (result.robots, result.grids, result.pairs, result.changes)
        np.testing.assert_array_equal(result.merged.cells, cells)

    def test_what_did_not_change_is_the_same_merged_map(self, session, scripted):
        scripted.fits(ONE, TWO, Sim2(1.0))
        merged = session.step(r1=ONE, r2=TWO).merged
        assert session.step(r3=THREE).merged is merged
        assert session.step(r1=ONE).merged is merged
        assert session.step(r1=THREE).merged is not merged

    def test_the_outcome_can_be_read_by_name(self, session):
        result = session.step(r1=ONE)
        assert list(result.robots) == list(ROBOTS[:3])
        assert all(isinstance(outcome.reason, Reason) for outcome in result.robots.values())


POSES = (IDENTITY, Sim2(0.31, -0.2, 0.4), Sim2(-1.0, 0.5, -2.0), Sim2(0.5, 0.25), Sim2(3.0, 1.0))


class Changing:
    """A robot's map that changes in a part, grows, is forgotten and comes back."""

    def __init__(self, value):
        self.value = value
        self.cells = np.full((60, 50), value, np.int8)
        self.first_row = 0

    def changed(self, rng):
        top, left = rng.integers(0, 40, 2)
        self.cells = self.cells.copy()
        self.cells[top : top + 15, left : left + 15] = self.value if rng.random() < 0.5 else -1
        if rng.random() < 0.2:
            self.cells = np.pad(self.cells, ((3, 0), (0, 0)), constant_values=self.value)
            self.first_row -= 3
        if rng.random() < 0.2:
            return filled(-1, 2, 2)
        return Grid(self.cells, 0.05, Sim2(0.0, 0.05 * self.first_row))


class TestMerged:
    @pytest.mark.parametrize("seed", range(12))
    def test_is_what_is_fused_anew_whatever_happened(self, scripted, seed):
        """Robots move, and their maps change, that of the reference as well."""
        rng = np.random.default_rng(seed)
        session = Session(scripted)
        maps = {robot: Changing(value) for robot, value in zip(ROBOTS, (ONE, TWO, THREE), strict=False)}
        for _ in range(30):
            for pair in ((ONE, TWO), (ONE, THREE), (TWO, THREE)):
                if rng.random() < 0.1:
                    scripted.fits(*pair, POSES[rng.integers(len(POSES))], score_m=rng.uniform(40.0, 60.0))
            chosen = rng.choice(list(maps), rng.integers(1, 4), replace=False).tolist()
            result = session.step(**{robot: maps[robot].changed(rng) for robot in chosen})
            placed = {robot: outcome for robot, outcome in result.robots.items() if outcome.merged_from_map is not None}
            assert (result.merged is None) == (placed == {})
            if not placed:
                continue
            layers = [Layer(result.grids[robot], outcome.merged_from_map) for robot, outcome in placed.items()]
            anew = fuse(layers, result.grids["r1"], scripted.config.cells)
            assert result.merged.cells.shape == anew.grid.cells.shape
            assert np.count_nonzero(result.merged.cells != anew.grid.cells) <= anew.grid.cells.size / 1000
            overlaps_m2 = [outcome.agreement.overlap_m2 for outcome in placed.values()]
            expected_m2 = [agreement.overlap_m2 for agreement in anew.agreements]
            assert overlaps_m2 == pytest.approx(expected_m2, rel=0.01, abs=0.05)


ORDERS = {
    "in turns": ["r1", "r2", "r1", "r2", "r1", "r2"],
    "r1 first": ["r1", "r1", "r1", "r2", "r2", "r2"],
    "r2 first": ["r2", "r2", "r2", "r1", "r1", "r1"],
}


@pytest.fixture(scope="module")
def finals():
    """Return the truth of two robots' last maps, and the last results of merging them in several orders."""
    runs = {"r1": office_run(4, 0.0, 0.7, 0.4, 1), "r2": office_run(4, 1.0, 0.3, 1.9, 2)}
    results = {}
    for name, order in ORDERS.items():
        merger, left = Merger(("r1", "r2")), {robot: list(runs[robot].snapshots) for robot in runs}
        for robot in order:
            result = merger.step({robot: left[robot].pop(0).grid})
        results[name] = result
    return pair_of(runs["r1"], runs["r2"]), results


class TestSimulated:
    """Two robots' growing maps, with the default method."""

    @pytest.mark.parametrize("order", ORDERS)
    def test_the_last_placement_is_right_whatever_came_first(self, finals, order):
        pair, results = finals
        outcome = results[order].robots["r2"]
        assert outcome.status is Status.MERGED
        position_m, angle_deg = pair.errors(outcome.merged_from_map)
        assert position_m < 0.1
        assert angle_deg < 0.5
        other = results["in turns"].robots["r2"].merged_from_map
        assert errors(outcome.merged_from_map, other, pair.shared_m)[0] < 0.02

    def test_the_merged_map_knows_what_both_know(self, finals):
        pair, results = finals
        merged = results["in turns"].merged
        assert merged.known_area_m2 > 1.05 * max(pair.target.known_area_m2, pair.source.known_area_m2)
        assert merged.known_area_m2 < pair.target.known_area_m2 + pair.source.known_area_m2
        assert results["in turns"].robots["r2"].agreement.acceptance > 0.95

    def test_a_map_of_another_floor_is_withdrawn(self):
        pair = office_pair(4)
        merger = Merger(("r1", "r2"))
        result = merger.step({"r1": pair.target, "r2": pair.source})
        assert changes(result) == [("r2", ChangeKind.PLACED)]
        result = merger.step({"r2": last_map_of_a_run()})
        assert changes(result) == [("r2", ChangeKind.JUMPED), ("r2", ChangeKind.WITHDRAWN)]
        assert [change.trigger for change in result.changes] == [None, Trigger.MAP_JUMPED]
        assert result.merged.same_as(pair.target.cropped_to_known())


FREE = MergeConfig(scale="free")
FACTORS = (1.0, 1.1, 0.5)


@pytest.fixture(scope="module")
def mislabelled():
    """Return the truth of three robots' maps, two of which have wrong resolutions, and what is merged of them."""
    runs = [office_run(4, *run) for run in ((0.0, 0.7, 0.4, 1), (1.0, 0.3, 1.9, 2), (0.8, 0.1, -0.7, 3))]
    grids = [with_another_label(last_map(run), factor) for run, factor in zip(runs, FACTORS, strict=True)]
    robots = ("r1", "r2", "r3")
    result = Merger(robots, FREE).step(dict(zip(robots, grids, strict=True)))
    return [pair_of(runs[0], run) for run in runs], result


class TestFreeScale:
    """With the default method."""

    def test_scales_are_those_of_the_labels(self, mislabelled):
        pairs, result = mislabelled
        for pair, outcome, factor in zip(pairs, result.robots.values(), FACTORS, strict=True):
            assert outcome.merged_from_map.scale == pytest.approx(1.0 / factor, rel=0.01)
            position_m, angle_deg = pair.errors(outcome.merged_from_map @ Sim2(scale=factor))
            assert position_m < 0.15
            assert angle_deg < 0.5

    def test_the_merged_map_is_of_the_references_size(self, mislabelled):
        pairs, result = mislabelled
        assert result.merged.resolution_m == pairs[0].target.resolution_m
        true = fuse([Layer(pair.source, pair.target_from_source) for pair in pairs], pairs[0].target, FREE.cells)
        assert result.merged.known_area_m2 == pytest.approx(true.grid.known_area_m2, rel=0.02)
        for outcome, agreement in zip(result.robots.values(), true.agreements, strict=True):
            assert outcome.agreement.acceptance == pytest.approx(agreement.acceptance, abs=0.03)
            assert outcome.agreement.overlap_m2 == pytest.approx(agreement.overlap_m2, rel=0.03)

    def test_a_change_of_scale_is_a_move(self, session, scripted):
        session.step(r1=ONE)
        reported = []
        for number, scale in enumerate((1.0, 1.005, 1.02)):
            scripted.fits(ONE, TWO + number, Sim2(scale=scale))
            reported.append(bool(changes(session.step(r2=TWO + number))))
        assert reported == [True, False, True]
