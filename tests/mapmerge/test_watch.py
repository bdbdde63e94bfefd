"""When pairs of maps are searched, followed or left alone, and why."""

from dataclasses import replace

import numpy as np
import pytest

from mapmerge.config import MergeConfig, WatchConfig
from mapmerge.grid import Grid
from mapmerge.match import Rival
from mapmerge.merger import Merger
from mapmerge.outcome import Change, ChangeKind, Status
from mapmerge.prior import Prior
from mapmerge.reasons import Reason, ReasonCode
from mapmerge.sim2 import Sim2
from mapmerge.watch import Trigger

ROBOTS = ("r1", "r2", "r3", "r4")
VALUES = dict(zip(ROBOTS, (10, 20, 30, 40), strict=True))
ONE_TWO, ONE_THREE, TWO_THREE = ("r1", "r2"), ("r1", "r3"), ("r2", "r3")
CELLS = 400
LIMITS = WatchConfig()
HERE = Sim2(1.0, 2.0, 0.3)
REFUSED = Reason(ReasonCode.WALLS_DISAGREE, "as the test says")


class Session:
    """Robots whose maps change as often as a test says, each told by the value that fills it."""

    def __init__(self, matcher, robots=ROBOTS[:2]):
        self.matcher = matcher
        self.merger = Merger(robots, matcher.config)
        self._versions = dict.fromkeys(robots, 0)
        self._cells = dict.fromkeys(robots, CELLS)

    def step(self, *robots, cells=None, away_m=0.0, priors=None, is_last=False):
        """Change these robots' maps; return which pairs were searched, and why."""
        for robot in robots:
            self._versions[robot] += 1
            self._cells[robot] = cells or self._cells[robot]
        maps = {robot: self.map_of(robot, away_m) for robot in robots}
        result = self.merger.step(maps, priors, is_last=is_last)
        if not is_last:
            assert set(result.updated) == set(robots)
        return dict(result.searched)

    def map_of(self, robot, away_m=0.0):
        """Return a row of so many known cells; each time another one is unknown between them."""
        row = np.full((1, self._cells[robot] + 1), VALUES[robot], np.int8)
        row[0, 1 + self._versions[robot]] = -1
        return Grid(row, 0.05, Sim2(x_m=away_m))

    def fits(self, target, source, **options):
        self.matcher.fits(VALUES[target], VALUES[source], HERE, **options)

    def misfits(self, target, source, **options):
        self.matcher.misfits(VALUES[target], VALUES[source], **options)

    def asked(self):
        """Return how often the matcher was asked to prepare, match, follow and glance since the last call."""
        lists = self.matcher.prepared, self.matcher.matched, self.matcher.followed, self.matcher.glanced
        counts = tuple(map(len, lists))
        for asked in lists:
            asked.clear()
        return counts


@pytest.fixture
def placed(scripted):
    """A robot that is placed on the other, and goes on to fit."""
    session = Session(scripted)
    session.fits(*ONE_TWO)
    scripted.follows = lambda known: known
    assert session.step("r1", "r2") == {ONE_TWO: Trigger.FIRST}
    assert session.asked() == (2, 1, 0, 0)
    return session


@pytest.fixture
def refused(scripted):
    """A robot that is placed on nobody."""
    session = Session(scripted)
    session.misfits(*ONE_TWO)
    session.step("r1", "r2")
    assert session.asked() == (2, 1, 0, 0)
    return session


def scored(**scores):
    """Return what following finds: the placement with other figures."""
    return lambda known: replace(known, scores=replace(known.scores, **scores))


class TestFirst:
    def test_maps_are_searched_when_both_are_there(self, scripted):
        session = Session(scripted, ROBOTS[:3])
        assert session.step("r2") == {}
        assert session.step("r1") == {ONE_TWO: Trigger.FIRST}
        assert session.step("r3") == {ONE_THREE: Trigger.FIRST, TWO_THREE: Trigger.FIRST}

    def test_also_when_one_of_them_was_gone(self, placed):
        """Though it is the map that was there before."""
        nothing = Grid(np.full((3, 3), -1, np.int8), 0.05)
        placed.merger.step({"r2": nothing})
        assert placed.merger.result.pairs == {}
        assert placed.asked() == (0, 0, 0, 0)
        assert placed.step("r2") == {ONE_TWO: Trigger.FIRST}

    def test_the_last_maps_as_well(self, scripted):
        assert Session(scripted).step("r1", "r2", is_last=True) == {ONE_TWO: Trigger.FIRST}


class TestPlaced:
    def test_a_placement_that_holds_is_followed_and_searched_after_long_only(self, placed):
        """Of what the maps show elsewhere, nothing tells where they were placed."""
        for _ in range(placed.matcher.config.watch.longest_search_wait - 1):
            assert placed.step("r2") == {}
            assert placed.asked() == (1, 0, 1, 0)
        assert placed.step("r1", "r2") == {ONE_TWO: Trigger.MAPS_GREW}
        assert placed.asked() == (2, 1, 1, 0)

    def test_what_is_followed_is_the_outcome(self, placed, scripted):
        moved = Sim2(1.3, 2.0, 0.3)
        scripted.follows = lambda known: replace(known, target_from_source=moved, confidence=0.7)
        placed.step("r2")
        result = placed.merger.result
        assert result.robots["r2"].merged_from_map == moved
        assert result.robots["r2"].confidence == 0.7
        assert result.changes == (Change("r2", ChangeKind.MOVED, result.robots["r2"].reason),)

    def test_a_method_that_cannot_follow_searches_whenever_a_map_changed(self, placed, scripted):
        scripted.follows = lambda _: None
        for _ in range(3):
            assert placed.step("r2") == {ONE_TWO: Trigger.CHANGED}
        assert placed.asked() == (3, 3, 3, 0)

    @pytest.mark.parametrize(("overlap_m2", "trigger"), [(29.9, None), (30.0, Trigger.OVERLAP_GREW)])
    def test_overlap_that_grew_by_half(self, placed, scripted, overlap_m2, trigger):
        scripted.follows = scored(overlap_m2=overlap_m2)
        assert placed.step("r2") == ({ONE_TWO: trigger} if trigger else {})

    def test_overlap_is_compared_with_that_of_the_last_search(self, placed, scripted):
        """Not with that of the last update; and once searched, it must grow by half again."""
        found = []
        for overlap_m2 in (24.0, 28.0, 33.0, 40.0, 48.0, 50.0, 70.0):
            scripted.follows = scored(overlap_m2=overlap_m2)
            answer = scripted.answers[10, 20]
            scripted.answers[10, 20] = replace(answer, scores=replace(answer.scores, overlap_m2=overlap_m2))
            found.append(placed.step("r2") == {ONE_TWO: Trigger.OVERLAP_GREW})
        assert found == [False, False, True, False, False, True, False]

    @pytest.mark.parametrize(("agreement", "trigger"), [(0.8501, None), (0.8499, Trigger.WEAKENED)])
    def test_walls_that_agree_less(self, placed, scripted, agreement, trigger):
        scripted.follows = scored(wall_agreement=agreement)
        assert placed.step("r2") == ({ONE_TWO: trigger} if trigger else {})

    def test_a_placement_that_must_be_refused(self, placed, scripted):
        scripted.follows = lambda known: replace(known, accepted=False, reason=REFUSED)
        assert placed.step("r2") == {ONE_TWO: Trigger.WEAKENED}
        assert placed.merger.result.robots["r2"].status is Status.MERGED  # the search says otherwise

    @pytest.mark.parametrize(("score_m", "trigger"), [(29.9, None), (30.1, Trigger.RIVAL_GAINED)])
    def test_a_rival_that_gained(self, scripted, score_m, trigger):
        """It scored half as much as the placement at the last search, and comes to 0.6 of it."""
        session = Session(scripted)
        session.fits(*ONE_TWO)
        answer = replace(scripted.answers[10, 20], rivals=(Rival(Sim2(9.0), 25.0), Rival(Sim2(-9.0), 24.0)))
        scripted.answers[10, 20] = answer
        session.step("r1", "r2")
        scripted.follows = lambda known: replace(known, rivals=(known.rivals[0], Rival(Sim2(-9.0), score_m)))
        assert session.step("r2") == ({ONE_TWO: trigger} if trigger else {})

    @pytest.mark.parametrize(("robot", "away_m"), [("r1", 30.0), ("r2", -30.0)])
    def test_a_map_that_jumped(self, placed, robot, away_m):
        """It forgot what it knew; that the placement goes on to fit is not asked for."""
        assert placed.step(robot, away_m=away_m) == {ONE_TWO: Trigger.MAP_JUMPED}
        assert placed.asked() == (1, 1, 0, 0)
        jumped, *more = placed.merger.result.changes
        assert (jumped.robot, jumped.kind, jumped.trigger) == (robot, ChangeKind.JUMPED, None)
        assert more == []
        assert placed.step(robot, away_m=away_m) == {}

    def test_what_is_believed_that_changed(self, placed, scripted):
        """A placement is followed within what is believed."""
        prior = Prior(HERE, 1.0, 1.0, 0.2, "recorded in /tf")
        assert placed.step("r2", priors={"r2": prior}) == {ONE_TWO: Trigger.PRIOR_CHANGED}
        assert placed.step("r2", priors={"r2": prior}) == {}
        assert scripted.priors == [None, prior, prior]
        assert placed.step("r2") == {ONE_TWO: Trigger.PRIOR_CHANGED}

    @pytest.mark.parametrize(
        ("follows", "trigger"),
        [
            (lambda known: replace(known, accepted=False, reason=REFUSED), Trigger.WEAKENED),
            (scored(overlap_m2=90.0), Trigger.OVERLAP_GREW),
            (lambda _: None, Trigger.CHANGED),
        ],
    )
    def test_what_a_search_brings_about_names_its_trigger(self, placed, scripted, follows, trigger):
        scripted.follows = follows
        placed.misfits(*ONE_TWO)
        placed.step("r2")
        (change,) = placed.merger.result.changes
        assert (change.robot, change.kind, change.trigger) == ("r2", ChangeKind.WITHDRAWN, trigger)

    def test_a_placement_that_was_withdrawn_is_tried_again_soon(self, placed, scripted):
        scripted.follows = lambda _: None
        placed.misfits(*ONE_TWO)
        placed.step("r2")
        placed.fits(*ONE_TWO)
        found = [placed.step("r2").get(ONE_TWO) for _ in range(2)]
        assert Trigger.RETRY in found
        assert placed.merger.result.robots["r2"].status is Status.MERGED


class TestJumpOfTheReference:
    @pytest.fixture
    def four(self, scripted):
        session = Session(scripted, ROBOTS)
        for number, target in enumerate(ROBOTS):
            for source in ROBOTS[number + 1 :]:
                session.fits(target, source)
        scripted.follows = lambda known: known
        session.step(*ROBOTS)
        assert session.asked() == (4, 6, 0, 0)
        return session

    def test_has_all_pairs_searched(self, four):
        """Those of others as well: the merged frame is another one."""
        searched = four.step("r1", away_m=30.0)
        assert set(searched.values()) == {Trigger.MAP_JUMPED}
        assert len(searched) == 6
        assert four.asked() == (1, 6, 0, 0)

    def test_that_of_another_robot_only_its_own(self, four):
        searched = four.step("r3", away_m=30.0)
        assert searched == dict.fromkeys([ONE_THREE, TWO_THREE, ("r3", "r4")], Trigger.MAP_JUMPED)
        assert four.asked() == (1, 3, 0, 0)


def due(session, updates, **options):
    """Return at which of so many updates the pair was searched; all for the same reason."""
    found = []
    for update in range(1, updates + 1):
        searched = session.step("r2", **options)
        assert set(searched.values()) <= {Trigger.RETRY}
        if searched:
            found.append(update)
    return found


class TestRefused:
    def test_are_searched_after_1_2_4_and_so_on_updates_while_there_is_hope(self, refused):
        assert due(refused, 64) == [1, 3, 7, 15, 31, 47, 63]

    def test_are_not_searched_without_hope(self, refused, scripted):
        """Only glanced at as often: 1, 3, 7, 15, 31, 47."""
        scripted.is_hope = False
        assert due(refused, 60) == []
        assert refused.asked() == (6, 0, 0, 6)

    def test_but_never_starve(self, refused, scripted):
        scripted.is_hope = False
        wait = LIMITS.longest_search_wait
        assert due(refused, 3 * wait) == [wait, 2 * wait, 3 * wait]

    def test_at_the_latest_after_as_many_updates_as_are_set(self, scripted):
        scripted.config = MergeConfig(
            method="scripted", watch=WatchConfig(longest_search_wait=5, longest_glance_wait=2)
        )
        session = Session(scripted)
        session.step("r1", "r2")
        scripted.is_hope = False
        assert due(session, 16) == [5, 10, 15]
        scripted.is_hope = True
        assert due(session, 8) == [1, 3, 5, 7]

    @pytest.mark.parametrize(("more", "is_due"), [(-1, False), (1, True)])
    @pytest.mark.parametrize("robot", ["r1", "r2"])
    def test_are_searched_once_one_has_grown_much(self, refused, scripted, more, is_due, robot):
        scripted.is_hope = False
        due(refused, 31)
        refused.step(robot, cells=500)
        cells = round(LIMITS.search_growth * CELLS) + more
        assert refused.step(robot, cells=cells) == ({ONE_TWO: Trigger.RETRY} if is_due else {})

    @pytest.mark.parametrize(("cells", "is_due"), [(459, False), (461, True)])
    @pytest.mark.parametrize("robot", ["r1", "r2"])
    def test_are_glanced_at_once_one_has_grown(self, refused, scripted, cells, is_due, robot):
        scripted.is_hope = False
        due(refused, 15)
        scripted.is_hope = True
        assert refused.step(robot, cells=cells) == ({ONE_TWO: Trigger.RETRY} if is_due else {})

    def test_are_searched_without_a_glance_if_they_were_nearly_placed(self, refused, scripted):
        refused.misfits(*ONE_TWO, confidence=0.05)
        assert due(refused, 1) == [1]
        scripted.is_hope = False
        del scripted.glanced[:]
        assert due(refused, 15) == [2, 6, 14]
        assert scripted.glanced == []
        refused.misfits(*ONE_TWO, confidence=0.049)
        assert due(refused, 40) == [15]

    def test_growth_that_was_seen_is_not_looked_at_again(self, refused, scripted):
        scripted.is_hope = False
        due(refused, 15)
        refused.asked()
        refused.step("r2", cells=500)
        assert refused.asked() == (1, 0, 0, 1)
        assert due(refused, 10) == []
        assert refused.asked() == (0, 0, 0, 0)

    def test_what_is_found_is_placed(self, refused):
        refused.fits(*ONE_TWO)
        refused.step("r2")
        (change,) = refused.merger.result.changes
        assert (change.robot, change.kind, change.trigger) == ("r2", ChangeKind.PLACED, Trigger.RETRY)

    def test_a_jump_begins_anew(self, refused):
        due(refused, 31)
        assert refused.step("r2", away_m=30.0) == {ONE_TWO: Trigger.MAP_JUMPED}
        assert due(refused, 8, away_m=30.0) == [1, 3, 7]

    def test_what_is_believed_that_changed(self, refused, scripted):
        scripted.is_hope = False
        prior = Prior(HERE, 1.0, 1.0, 0.2, "recorded in /tf")
        assert refused.step("r2", priors={"r2": prior}) == {ONE_TWO: Trigger.PRIOR_CHANGED}


class TestEnd:
    """The outcome of the last maps is that of a search."""

    def test_what_was_only_followed_is_searched(self, placed):
        placed.step("r2")
        assert placed.step("r2", is_last=True) == {ONE_TWO: Trigger.END}
        assert placed.asked() == (2, 1, 1, 0)  # following it as well would tell nothing

    def test_even_if_nothing_new_comes_with_the_end(self, placed):
        placed.step("r2")
        placed.asked()
        assert placed.step(is_last=True) == {ONE_TWO: Trigger.END}
        assert placed.asked() == (0, 1, 0, 0)
        assert placed.merger.result.updated == ()

    def test_what_was_searched_is_not_searched_again(self, placed, scripted):
        assert placed.step(is_last=True) == {}
        scripted.follows = scored(overlap_m2=90.0)
        placed.step("r1", "r2")
        placed.asked()
        for _ in range(2):
            assert placed.step(is_last=True) == {}
        assert placed.asked() == (0, 0, 0, 0)

    def test_what_is_not_placed_as_well(self, refused, scripted):
        scripted.is_hope = False
        refused.step("r2")
        assert refused.step(is_last=True) == {ONE_TWO: Trigger.END}
        assert refused.step(is_last=True) == {}

    def test_only_pairs_of_maps_that_changed_since(self, scripted):
        session = Session(scripted, ROBOTS[:3])
        session.fits(*ONE_TWO)
        scripted.follows = lambda known: known
        session.step("r1", "r2", "r3")
        session.step("r3")  # refused: searched again at once
        session.step("r2")
        assert session.step(is_last=True) == {ONE_TWO: Trigger.END, TWO_THREE: Trigger.END}

    def test_what_it_brings_about_says_so(self, placed):
        placed.step("r2")
        placed.misfits(*ONE_TWO)
        placed.step(is_last=True)
        (change,) = placed.merger.result.changes
        assert (change.kind, change.trigger) == (ChangeKind.WITHDRAWN, Trigger.END)


class TestUnchanged:
    @pytest.mark.parametrize("fits", [True, False])
    @pytest.mark.parametrize("seed", range(4))
    def test_pairs_of_unchanged_robots_cost_nothing(self, scripted, fits, seed):
        """In whatever order the robots' maps change: nothing is prepared, matched, followed or glanced at for them."""
        session = Session(scripted, ROBOTS)
        scripted.follows = lambda known: known
        for number, target in enumerate(ROBOTS):
            for source in ROBOTS[number + 1 :] if fits else ():
                session.fits(target, source)
        session.step(*ROBOTS)
        rng = np.random.default_rng(seed)
        for _ in range(40):
            changed = set(rng.choice(ROBOTS, rng.integers(1, 3), replace=False).tolist())
            session.asked()
            searched = session.step(*changed)
            values = {VALUES[robot] for robot in changed}
            asked = [*scripted.matched, *scripted.followed, *scripted.glanced]
            assert all(values & set(pair) for pair in asked)
            assert len(set(scripted.followed)) == len(scripted.followed)
            assert all(changed & set(pair) for pair in searched)
            assert len(scripted.matched) == len(searched)
            if fits:
                assert searched == {}
                assert {value for value, _ in scripted.prepared} == values
                assert len(scripted.prepared) == len(values)
