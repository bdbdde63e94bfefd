"""What several maps say together that no pair of them can tell."""

import functools
import itertools
from dataclasses import replace

import pytest

from mapmerge.config import HIGHEST_CONFIDENCE, MergeConfig, VerifyConfig
from mapmerge.graph import Edge, place
from mapmerge.merger import Merger
from mapmerge.outcome import Status
from mapmerge.pairs import News
from mapmerge.prior import Prior
from mapmerge.reasons import ReasonCode
from mapmerge.sim2 import IDENTITY, Sim2
from mapmerge.unions import Unions
from mapmerge.unite import united
from tests.floors import CONFIG, FLAT_WALLS, drawn, errors, hall_and_part, within

ROBOTS = ("r1", "r2", "r3", "r4")
ONE, TWO, THREE, FOUR = 10, 20, 30, 40
APART = Sim2(5.0)
"""Where the second map lies on the first: maps are 1 m wide, so that merged ones show the values of both."""
THERE = Sim2(2.0, 3.0, 0.3)


class Session:
    """Steps one after the other; maps are given by what fills them."""

    def __init__(self, matcher, robots=ROBOTS[:3]):
        self.matcher = matcher
        self.merger = Merger(robots, matcher.config)

    def step(self, priors=None, *, is_last=False, **values):
        updates = {robot: self.matcher.map_of(value) for robot, value in values.items()}
        return self.merger.step(updates, priors, is_last=is_last)


def of_merged_maps(calls):
    return [pair for pair in calls if any(isinstance(who, tuple) for who in pair)]


@pytest.fixture
def linked(scripted):
    """Two robots that fit each other, beside a third that may lie on the first."""
    scripted.fits(ONE, TWO, APART, confidence=0.999)
    scripted.misfits(ONE, THREE, code=ReasonCode.LOW_CONFIDENCE, confidence=0.3)
    return scripted


class TestMergedMaps:
    def test_place_a_robot_that_no_pair_can(self, linked):
        linked.fits((ONE, TWO), THREE, THERE, confidence=0.995)
        result = Session(linked).step(r1=ONE, r2=TWO, r3=THREE)
        outcome = result.robots["r3"]
        assert (outcome.status, outcome.merged_from_map) == (Status.MERGED, THERE)
        assert outcome.confidence == pytest.approx(0.995)
        assert "those of r1, r2 merged" in outcome.reason.message
        assert result.pairs["r1", "r3"].accepted
        assert result.merged.known_area_m2 == pytest.approx(3.0, abs=0.05)

    def test_place_a_component_as_a_whole(self, scripted):
        scripted.fits(TWO, THREE, APART)
        scripted.misfits(ONE, THREE, code=ReasonCode.AMBIGUOUS, confidence=0.5)
        scripted.fits(ONE, (TWO, THREE), THERE, confidence=0.995)
        result = Session(scripted).step(r1=ONE, r2=TWO, r3=THREE)
        assert result.robots["r2"].merged_from_map == THERE
        assert result.robots["r3"].merged_from_map == THERE @ APART
        assert "those of r2, r3 merged" in result.pairs["r1", "r2"].reason.message

    def test_place_one_robot_after_the_other(self, linked):
        linked.fits((ONE, TWO), THREE, THERE, confidence=0.995)
        linked.misfits(TWO, FOUR, code=ReasonCode.LOW_CONFIDENCE, confidence=0.2)
        linked.fits((ONE, TWO, THREE), FOUR, THERE.inverse(), confidence=0.995)
        result = Session(linked, ROBOTS).step(r1=ONE, r2=TWO, r3=THREE, r4=FOUR)
        assert result.robots["r4"].merged_from_map == THERE.inverse()
        assert [outcome.status for outcome in result.robots.values()][1:] == [Status.MERGED] * 3

    def test_the_surest_comes_first(self, linked):
        linked.fits((ONE, TWO), THREE, THERE, confidence=0.995)
        linked.misfits(TWO, FOUR, code=ReasonCode.LOW_CONFIDENCE, confidence=0.2)
        linked.fits((ONE, TWO), FOUR, THERE.inverse(), confidence=0.999)
        linked.misfits((ONE, TWO, FOUR), THREE)
        result = Session(linked, ROBOTS).step(r1=ONE, r2=TWO, r3=THREE, r4=FOUR)
        assert [outcome.status for outcome in result.robots.values()][2:] == [Status.UNMERGED, Status.MERGED]

    def test_that_are_refused_leave_what_is_said_of_pairs(self, linked):
        linked.misfits((ONE, TWO), THREE, code=ReasonCode.AMBIGUOUS, confidence=0.5)
        result = Session(linked).step(r1=ONE, r2=TWO, r3=THREE)
        assert of_merged_maps(linked.calls()) == [((ONE, TWO), THREE)]
        assert result.robots["r3"].status is Status.UNMERGED
        assert result.pairs["r1", "r3"].reason.code is ReasonCode.LOW_CONFIDENCE

    def test_are_what_is_explained_where_they_place_a_robot(self, linked):
        linked.answers[ONE, THREE] = replace(linked.answers[ONE, THREE], evidence=("of the pair",))
        linked.misfits((ONE, TWO), THREE, confidence=0.5, evidence=("of merged maps",))
        session = Session(linked)
        session.step(r1=ONE, r2=TWO, r3=THREE)
        assert session.merger.explain(("r1", "r3")) == ("of the pair",)
        linked.fits((ONE, TWO), THREE, THERE, confidence=0.995)
        linked.answers[(ONE, TWO), THREE] = replace(linked.answers[(ONE, TWO), THREE], evidence=("of merged maps",))
        session = Session(linked)
        session.step(r1=ONE, r2=TWO, r3=THREE)
        assert session.merger.explain(("r1", "r3")) == ("of merged maps",)
        assert session.merger.explain(("r2", "r3")) == ()

    def test_are_explained_by_those_that_placed_the_robot(self, linked):
        """Others of the same two frames were merged before, and were refused."""
        linked.misfits((ONE, TWO), THREE, confidence=0.5, evidence=("of two",))
        linked.fits(TWO, FOUR, APART, confidence=0.999)
        linked.fits((ONE, TWO, FOUR), THREE, THERE, confidence=0.995)
        linked.answers[(ONE, TWO, FOUR), THREE] = replace(
            linked.answers[(ONE, TWO, FOUR), THREE], evidence=("of three",)
        )
        session = Session(linked, ROBOTS)
        session.step(r1=ONE, r2=TWO, r3=THREE)
        result = session.step(r4=FOUR)
        assert result.robots["r3"].status is Status.MERGED
        assert session.merger.explain(("r1", "r3")) == ("of three",)

    @pytest.mark.parametrize("confidence", [None, 0.0, 0.049])
    def test_are_not_tried_without_hope(self, linked, confidence):
        linked.misfits(ONE, THREE, code=ReasonCode.LOW_CONFIDENCE, confidence=confidence)
        Session(linked).step(r1=ONE, r2=TWO, r3=THREE)
        assert of_merged_maps(linked.calls()) == []

    def test_are_of_several_robots(self, scripted):
        scripted.misfits(ONE, TWO, code=ReasonCode.LOW_CONFIDENCE, confidence=0.9)
        Session(scripted).step(r1=ONE, r2=TWO, r3=THREE)
        assert scripted.calls() == [(ONE, TWO), (ONE, THREE), (TWO, THREE)]

    def test_say_nothing_where_something_is_believed(self, linked):
        linked.fits((ONE, TWO), THREE, THERE, confidence=0.995)
        believed = {"r3": Prior(Sim2(1.0), 0.1, 0.1, 0.1, "given for r3")}
        result = Session(linked).step(believed, r1=ONE, r2=TWO, r3=THREE)
        assert result.robots["r3"].status is Status.UNMERGED
        assert of_merged_maps(linked.calls()) == []


class TestKept:
    @pytest.fixture
    def session(self, linked):
        linked.misfits((ONE, TWO), THREE, confidence=0.5)
        session = Session(linked, ROBOTS)
        session.step(r1=ONE, r2=TWO, r3=THREE)
        assert of_merged_maps(linked.calls()) == [((ONE, TWO), THREE)]
        return session

    def test_while_their_maps_are_the_same(self, session, linked):
        session.step(r4=FOUR)
        session.step(r4=FOUR + 1, r1=ONE)
        assert of_merged_maps(linked.calls()) == []

    @pytest.mark.parametrize("robot", ["r1", "r2", "r3"])
    def test_until_one_changes(self, session, linked, robot):
        changed = {"r1": 11, "r2": 21, "r3": 31}[robot]
        old = {"r1": ONE, "r2": TWO, "r3": THREE}
        one, two, three = ({**old, robot: changed}[name] for name in old)
        linked.fits(one, two, APART, confidence=0.999)
        linked.misfits(one, three, code=ReasonCode.LOW_CONFIDENCE, confidence=0.3)
        session.step(**{robot: changed})
        assert of_merged_maps(linked.calls()) == [((one, two), three)]
        assert len(session.merger.unions) == 1

    def test_until_one_moves(self, linked):
        linked.misfits((ONE, TWO), THREE, confidence=0.5)
        grids = {robot: linked.map_of(value) for robot, value in zip(ROBOTS, (ONE, TWO, THREE), strict=False)}
        matches = {("r1", "r3"): linked.answers[ONE, THREE]}
        unions = Unions(linked, linked.config)
        for pose, asked in ((APART, 1), (APART, 0), (Sim2(5.05), 0), (Sim2(5.5), 1), (APART, 1)):
            edge = Edge("r1", "r2", pose, 9.0, (0.0, 0.0))
            forest = place(list(grids), [edge], distance_m=0.75, angle_rad=0.1)
            unions.update(grids, News(frozenset(), frozenset(), "r1", is_last=False))
            found = united(forest, grids, matches, (), unions, linked.config)
            assert found is None
            assert len(of_merged_maps(linked.calls())) == asked

    @pytest.mark.parametrize(("robot", "kept"), [("r4", 1), ("r2", 0), ("r3", 0)])
    def test_until_one_jumps(self, session, robot, kept):
        news = News(frozenset([robot]), frozenset([robot]), "r1", is_last=False)
        session.merger._unions.update(ROBOTS, news)
        assert len(session.merger.unions) == kept

    @pytest.mark.parametrize(("robot", "kept"), [("r4", 1), ("r2", 0), ("r3", 0)])
    def test_until_one_is_gone(self, session, robot, kept):
        news = News(frozenset([robot]), frozenset(), "r1", is_last=False)
        session.merger._unions.update(set(ROBOTS) - {robot}, news)
        assert len(session.merger.unions) == kept

    def test_that_are_refused_again_and_again_are_asked_for_less_often(self, linked):
        """After 1, 2, 4, … updates; and by the last maps, once more."""
        linked.misfits((ONE, TWO), THREE, confidence=0.5)
        session, asked = Session(linked), []
        for update in range(12):
            value = THREE + update
            linked.misfits(ONE, value, code=ReasonCode.LOW_CONFIDENCE, confidence=0.3)
            linked.misfits((ONE, TWO), value, confidence=0.5)
            session.step(is_last=update == 11, **({"r1": ONE, "r2": TWO} if update == 0 else {}), r3=value)
            if of_merged_maps(linked.calls()):
                asked.append(update)
        assert asked == [0, 1, 3, 7, 11]


class TestWitnesses:
    """Two pairs that are not sure enough, each by itself."""

    @pytest.fixture
    def strict(self, scripted):
        limits = VerifyConfig(min_confidence=0.999, witness_confidence=0.9, nearly_sure_confidence=0.99)
        scripted.config = MergeConfig(method="scripted", verify=limits)
        scripted.fits(ONE, TWO, APART, confidence=0.9995)
        return scripted

    @staticmethod
    def outcome(matcher, first=0.995, second=0.95, *, off=IDENTITY, code=ReasonCode.LOW_CONFIDENCE, **options):
        """Return what becomes of a robot that lies on both others, on the second off by so much."""
        matcher.misfits(ONE, THREE, pose=THERE, confidence=first, code=code, score_m=9.0, **options)
        matcher.misfits(TWO, THREE, pose=APART.inverse() @ off @ THERE, confidence=second, code=code, **options)
        return Session(matcher).step(r1=ONE, r2=TWO, r3=THREE).robots["r3"]

    @pytest.mark.parametrize("off", [IDENTITY, Sim2(0.5, 0.2), Sim2(0.0, 0.0, 0.05)])
    @pytest.mark.parametrize("code", [ReasonCode.LOW_CONFIDENCE, ReasonCode.WALLS_DISAGREE])
    def test_that_agree_are_believed(self, strict, off, code):
        found = self.outcome(strict, off=off, code=code)
        assert (found.status, found.merged_from_map) == (Status.MERGED, THERE)
        assert "2 pairs of maps agree where r3 lies on r1" in found.reason.message
        assert "30 does not fit 10" in found.reason.message
        assert found.confidence == pytest.approx(1.0 - 0.005 * 0.05)
        assert of_merged_maps(strict.calls()) == []

    def test_may_be_what_it_takes_with_the_limits_by_default(self, strict):
        limits = VerifyConfig()
        strict.config = MergeConfig(method="scripted")
        first, second = limits.nearly_sure_confidence, limits.witness_confidence
        assert second < first < limits.min_confidence
        assert self.outcome(strict, first, second).status is Status.MERGED
        assert self.outcome(strict, first - 1e-6, second).status is Status.UNMERGED
        assert self.outcome(strict, first, second - 1e-6).status is Status.UNMERGED

    @pytest.mark.parametrize("off", [Sim2(1.0), Sim2(0.0, 0.0, 0.1), Sim2(0.5, 0.6)])
    def test_that_disagree_are_not(self, strict, off):
        assert self.outcome(strict, off=off).status is Status.UNMERGED

    @pytest.mark.parametrize(
        "code", [ReasonCode.AMBIGUOUS, ReasonCode.TOO_LITTLE_OVERLAP, ReasonCode.PRIOR_CONTRADICTED]
    )
    def test_that_are_contested_or_saw_too_little_are_not(self, strict, code):
        assert self.outcome(strict, code=code).status is Status.UNMERGED

    @pytest.mark.parametrize(
        ("rival", "status"), [(0.04, Status.MERGED), (0.06, Status.UNMERGED), (3.0, Status.UNMERGED)]
    )
    @pytest.mark.parametrize("code", [ReasonCode.LOW_CONFIDENCE, ReasonCode.WALLS_DISAGREE])
    def test_that_have_a_rival_are_not_whatever_they_were_refused_for(self, strict, rival, status, code):
        assert self.outcome(strict, rival=rival, code=code).status is status

    def test_walls_most_of_which_disagree_are_none(self, strict):
        """However sure they are otherwise, and how many."""
        assert self.outcome(strict, 0.9999, 0.9999, wall_agreement=0.69).status is Status.UNMERGED

    @pytest.mark.parametrize(("first", "second"), [(0.9899, 0.98), (0.995, 0.89), (0.995, 0.5), (None, None)])
    def test_that_are_not_nearly_sure_are_not(self, strict, first, second):
        assert self.outcome(strict, first, second).status is Status.UNMERGED

    def test_the_surer_one_may_be_either(self, strict):
        found = self.outcome(strict, 0.95, 0.995)
        assert found.status is Status.MERGED
        assert errors(found.merged_from_map, THERE, (0.0, 0.0)) == pytest.approx((0.0, 0.0), abs=1e-9)
        assert "where r3 lies on r2" in found.reason.message

    def test_where_something_is_believed_are_not_asked(self, strict):
        strict.misfits(ONE, THREE, pose=THERE, confidence=0.995, code=ReasonCode.LOW_CONFIDENCE)
        strict.misfits(TWO, THREE, pose=APART.inverse() @ THERE, confidence=0.995, code=ReasonCode.LOW_CONFIDENCE)
        believed = {"r3": Prior(Sim2(1.0), 0.1, 0.1, 0.1, "given for r3")}
        result = Session(strict).step(believed, r1=ONE, r2=TWO, r3=THREE)
        assert result.robots["r3"].status is Status.UNMERGED

    def test_a_third_makes_it_no_surer(self, strict):
        strict.fits(ONE, FOUR, APART.inverse(), confidence=0.9995)
        for who, on in ((ONE, IDENTITY), (TWO, APART), (FOUR, APART.inverse())):
            strict.misfits(
                *((THREE, FOUR) if who == FOUR else (who, THREE)),
                pose=THERE.inverse() @ on if who == FOUR else on.inverse() @ THERE,
                confidence=0.995 if who == ONE else 0.95,
                code=ReasonCode.LOW_CONFIDENCE,
            )
        found = Session(strict, ROBOTS).step(r1=ONE, r2=TWO, r3=THREE, r4=FOUR).robots["r3"]
        assert found.confidence == pytest.approx(1.0 - 0.005 * 0.05)
        assert found.reason.message.startswith("placed on r1: 3 pairs of maps agree")

    def test_none_are_surer_than_was_measured(self, strict):
        assert self.outcome(strict, 0.9989, 0.9989).confidence == HIGHEST_CONFIDENCE

    @pytest.mark.parametrize("off", [IDENTITY, Sim2(1.0)])
    def test_between_components_either_may_be_the_target(self, strict, off):
        """One match takes the one component's robot to the other's, the second the other way round."""
        strict.answers.clear()
        strict.fits(ONE, FOUR, APART, confidence=0.9995)
        strict.fits(TWO, THREE, Sim2(0.0, 4.0), confidence=0.9995)
        strict.misfits(ONE, TWO, pose=THERE, confidence=0.995, code=ReasonCode.LOW_CONFIDENCE)
        four_on_three = (off @ THERE @ Sim2(0.0, 4.0)).inverse() @ APART
        strict.misfits(THREE, FOUR, pose=four_on_three, confidence=0.95, code=ReasonCode.LOW_CONFIDENCE)
        robots = Session(strict, ROBOTS).step(r1=ONE, r2=TWO, r3=THREE, r4=FOUR).robots
        is_merged = off == IDENTITY
        assert (robots["r2"].status is Status.MERGED) == is_merged
        assert (robots["r3"].status is Status.MERGED) == is_merged


PARTS_M = {"r1": (0.0, 0.0, 9.0, 5.0), "r2": (0.0, 1.8, 9.0, 6.0), "r3": (3.1, 0.0, 5.7, 6.0)}
FLOOR_FROM_MAP = {"r1": Sim2(-1.0, -1.0), "r2": Sim2(10.2, 1.3, 2.2), "r3": Sim2(-0.6, 6.9, -0.8)}


def part_of_the_flat(robot):
    """Return the map of a robot that saw a part of the flat; the last one's shares too little with either other's."""
    x0_m, y0_m, x1_m, y1_m = PARTS_M[robot]
    low_x, low_y, high_x, high_y = x0_m - 0.1, y0_m - 0.1, x1_m + 0.1, y1_m + 0.1
    walls = [
        (max(left, low_x), max(low, low_y), min(right, high_x), min(high, high_y))
        for left, low, right, high in FLAT_WALLS
        if left < high_x and right > low_x and low < high_y and high > low_y
    ]
    return drawn(
        within(x0_m, y0_m, x1_m, y1_m),
        walls,
        size_m=(13.0, 11.0),
        floor_from_map=FLOOR_FROM_MAP[robot],
        ragged=int(robot[1:]),
    )


@pytest.fixture(scope="module")
def flats():
    return {robot: part_of_the_flat(robot) for robot in PARTS_M}


class TestRealMaps:
    @staticmethod
    @functools.cache
    def surety_of_the_first(*maps):
        order = tuple(PARTS_M)
        merger = Merger(order, CONFIG)
        merger.step(dict(zip(order, maps, strict=True)))
        (union,) = merger.unions.values()
        return union.confidence

    def surety(self, flats):
        return self.surety_of_the_first(*(flats[robot] for robot in PARTS_M))

    @pytest.mark.parametrize("order", list(itertools.permutations(PARTS_M)))
    def test_all_are_placed_in_any_order(self, flats, order):
        merger = Merger(order, CONFIG)
        result = merger.step({robot: flats[robot] for robot in order})
        (union,) = merger.unions.values()
        assert union.confidence == pytest.approx(self.surety(flats), abs=1e-3)  # in whatever order
        for robot in order[1:]:
            found = result.robots[robot]
            assert found.status is Status.MERGED
            true = FLOOR_FROM_MAP[order[0]].inverse() @ FLOOR_FROM_MAP[robot]
            error_m, error_deg = errors(found.merged_from_map, true, (5.0, 4.0))
            assert error_m < 0.1
            assert error_deg < 1.0

    @pytest.mark.parametrize("kept", list(itertools.combinations(PARTS_M, 2)))
    def test_no_pair_places_the_third(self, flats, kept):
        result = Merger(kept, CONFIG).step({robot: flats[robot] for robot in kept})
        assert [pair.accepted for pair in result.pairs.values()] == ["r3" not in kept]

    def test_a_stranger_stays_out(self, flats):
        _, stranger, _ = hall_and_part((2.0, 28.0), 0.4)
        robots = ("r1", "r2", "r4", "r3")
        merger = Merger(robots, CONFIG)
        result = merger.step({**flats, "r4": stranger})
        assert [outcome.status for outcome in result.robots.values()][1:] == [
            Status.MERGED,
            Status.UNMERGED,
            Status.MERGED,
        ]
        assert not any(match.accepted for key, match in merger.unions.items() if "r4" in dict(sum(key, ())))
