"""Placing robots by the matches of pairs."""

import itertools
import math

import numpy as np
import pytest

from mapmerge.graph import Edge, place
from mapmerge.sim2 import IDENTITY, Sim2

ROBOTS = ("a", "b", "c", "d", "e")
TRUE = {
    "a": IDENTITY,
    "b": Sim2(1.0, 2.0, 0.5),
    "c": Sim2(-4.0, 0.5, -2.0),
    "d": Sim2(7.0, -3.0, 3.0),
    "e": Sim2(0.1, 9.0, 1.5),
}


def edge(target, source, weight=1.0, error=IDENTITY):
    """Return a match that is right but for an error of the source's pose."""
    return Edge(target, source, TRUE[target].inverse() @ TRUE[source] @ error, weight, (0.0, 0.0))


def placed(robots, *edges):
    return place(robots, edges, distance_m=0.5, angle_rad=math.radians(5.0))


def assert_close(one, other):
    np.testing.assert_allclose(one.matrix, other.matrix, atol=1e-9)


class TestTrees:
    def test_without_matches_everyone_is_alone(self):
        forest = placed(ROBOTS)
        for robot in ROBOTS:
            placement = forest.placements[robot]
            assert (placement.component, placement.component_from_map, placement.via) == (robot, IDENTITY, None)
        assert forest.contradicted == ()

    def test_a_chain_composes(self):
        forest = placed("abc", edge("a", "b"), edge("b", "c"))
        assert_close(forest.placements["c"].component_from_map, TRUE["c"])
        assert [forest.placements[robot].via for robot in "abc"] == [None, "a", "b"]

    def test_a_match_places_its_target_as_well(self):
        forest = placed("abc", edge("c", "a"), edge("b", "c"))
        assert_close(forest.placements["c"].component_from_map, TRUE["c"])
        assert_close(forest.placements["b"].component_from_map, TRUE["b"])
        assert [forest.placements[robot].via for robot in "abc"] == [None, "c", "a"]

    def test_a_component_is_named_after_its_first_robot_whose_frame_it_has(self):
        forest = placed("cabde", edge("a", "b"), edge("b", "c"), edge("e", "d"))
        assert [forest.placements[robot].component for robot in "abcde"] == ["c", "c", "c", "d", "d"]
        assert forest.placements["c"].component_from_map == IDENTITY
        assert_close(forest.placements["a"].component_from_map, TRUE["c"].inverse())
        assert forest.placements["d"].component_from_map == IDENTITY

    @pytest.mark.parametrize("robots", list(itertools.permutations("abcd"))[::3])
    def test_the_order_of_robots_changes_names_only(self, robots):
        edges = [edge("a", "b", 3.0), edge("b", "c", 2.0), edge("c", "a", 1.0), edge("d", "b", 4.0)]
        forest = placed(robots, *edges)
        first = robots[0]
        for robot in robots:
            placement = forest.placements[robot]
            assert placement.component == first
            assert_close(TRUE[first] @ placement.component_from_map, TRUE[robot])
        assert forest.contradicted == ()

    @pytest.mark.parametrize("order", list(itertools.permutations(range(4)))[::5])
    def test_the_order_of_matches_changes_nothing(self, order):
        wrong = Sim2(3.0, 0.0, 0.0)
        edges = [edge("a", "b", 2.0), edge("b", "c", 2.0), edge("a", "c", 2.0, wrong), edge("d", "c", 2.0)]
        assert placed("abcd", *(edges[index] for index in order)) == placed("abcd", *edges)


class TestLoops:
    LOOP = (("a", "b"), ("b", "c"), ("c", "d"), ("d", "a"))

    def test_a_loop_that_closes_is_fine(self):
        slightly = Sim2(0.05, 0.02, math.radians(0.3))
        edges = [edge(*pair, weight, slightly) for pair, weight in zip(self.LOOP, (4.0, 3.0, 2.0, 1.0), strict=True)]
        assert placed("abcd", *edges).contradicted == ()

    @pytest.mark.parametrize("weakest", range(4))
    def test_the_weakest_match_is_blamed(self, weakest):
        weights = [5.0, 4.0, 3.0, 2.0]
        weights[weakest] = 1.0
        wrong = Sim2(6.0, 0.0, 1.0)
        edges = [
            edge(*pair, weight, wrong if index == weakest else IDENTITY)
            for index, (pair, weight) in enumerate(zip(self.LOOP, weights, strict=True))
        ]
        forest = placed("abcd", *edges)
        assert forest.contradicted == (edges[weakest],)
        for robot in "abcd":
            assert_close(forest.placements[robot].component_from_map, TRUE[robot])

    def test_a_wrong_match_that_is_stronger_wins_and_the_weakest_right_one_is_blamed(self):
        edges = [edge("a", "b", 3.0, Sim2(6.0)), edge("b", "c", 2.0), edge("c", "a", 1.0)]
        forest = placed("abc", *edges)
        assert forest.contradicted == (edges[2],)

    @pytest.mark.parametrize(("error", "contradicts"), [(Sim2(0.49), False), (Sim2(0.51), True)])
    def test_how_far_a_loop_may_miss(self, error, contradicts):
        forest = placed("abc", edge("a", "b", 3.0), edge("b", "c", 3.0), edge("a", "c", 1.0, error))
        assert bool(forest.contradicted) is contradicts

    @pytest.mark.parametrize(("degrees", "contradicts"), [(4.9, False), (-5.1, True)])
    def test_how_far_a_loop_may_turn(self, degrees, contradicts):
        turned = Sim2(yaw_rad=math.radians(degrees))
        forest = placed("abc", edge("a", "b", 3.0), edge("b", "c", 3.0), edge("a", "c", 1.0, turned))
        assert bool(forest.contradicted) is contradicts

    def test_two_wrong_matches_are_both_blamed(self):
        wrong = [edge("a", "d", 0.5, Sim2(9.0)), edge("b", "d", 0.4, Sim2(-9.0))]
        forest = placed("abcd", *(edge(*pair, 5.0) for pair in self.LOOP[:3]), *wrong)
        assert set(forest.contradicted) == set(wrong)

    def test_a_robot_of_many_is_placed_by_its_strongest_match(self):
        forest = placed("abcd", edge("a", "b", 9.0), edge("a", "c", 9.0), edge("b", "d", 2.0), edge("c", "d", 3.0))
        assert forest.placements["d"].via == "c"


class TestVotes:
    """Several loops say which match is the wrong one, however strong it is."""

    WRONG = Sim2(9.0, 0.0)

    def test_a_strong_wrong_match_is_outvoted(self):
        wrong = edge("a", "b", 5.0, self.WRONG)
        right = [edge(*pair, 3.0) for pair in ("ac", "bc", "ad", "bd")]
        forest = placed("abcd", wrong, *right)
        assert forest.contradicted == (wrong,)
        for robot in "abcd":
            assert_close(forest.placements[robot].component_from_map, TRUE[robot])

    def test_two_strong_wrong_matches_of_one_robot_are_outvoted(self):
        wrong = [edge("a", "b", 5.0, self.WRONG), edge("a", "c", 4.5, Sim2(0.0, -7.0))]
        right = [edge(*pair, 3.0) for pair in ("ad", "ae", "bd", "be", "cd", "ce", "de")]
        forest = placed(ROBOTS, *wrong, *right)
        assert set(forest.contradicted) == set(wrong)

    def test_votes_never_cut_a_robot_off(self):
        only = edge("a", "b", 1.0)
        forest = placed("abcd", only, edge("b", "c", 2.0), edge("c", "d", 2.0), edge("b", "d", 2.0, self.WRONG))
        assert {placement.component for placement in forest.placements.values()} == {"a"}

    @pytest.mark.parametrize("order", list(itertools.permutations(range(5)))[::17])
    def test_the_order_of_matches_changes_no_vote(self, order):
        edges = [edge("a", "b", 5.0, self.WRONG), *(edge(*pair, 3.0) for pair in ("ac", "bc", "ad", "bd"))]
        forest = placed("abcd", *(edges[index] for index in order))
        assert forest.contradicted == (edges[0],)
