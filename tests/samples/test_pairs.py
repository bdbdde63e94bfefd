"""Simulated pairs are what they claim to be: their truth puts walls on walls, and they repeat themselves."""

import functools
import math

import numpy as np
import pytest

from mapmerge.sim2 import IDENTITY, Sim2
from samples.kinds import KINDS, altered
from samples.likeness import agreement, explains_as_well, look, shared_m2
from samples.mission import known_at
from samples.pairs import STRANGERS, mission, pair, pairs, strangers
from samples.rivals import has_rival
from samples.sites import Bend, Changes, bent, reflected, visited
from samples.slam import Warp, drawn_warp
from tests.floors import drawn, outline, within

cached_pair = functools.cache(pair)
NO_CHANGES = Changes()


def edges_in_order(edges):
    """Return edges independent of their direction and order, rounded to a millimetre."""
    ends = np.round(edges.reshape(-1, 2, 2), 3) + 0.0
    return sorted(tuple(sorted(map(tuple, ends.tolist()))) for ends in ends)


@pytest.mark.parametrize("kind", KINDS)
class TestKinds:
    def test_the_truth_puts_walls_on_walls(self, kind):
        found = cached_pair(kind, 3)
        looks = look(found.target), look(found.source)
        assert agreement(*looks, found.truth) > 0.75
        beside = Sim2(0.7, -0.4) @ found.truth
        assert agreement(*looks, beside) < agreement(*looks, found.truth)

    def test_the_overlap_is_that_of_the_maps(self, kind):
        found = cached_pair(kind, 3)
        centres_m = found.source.centres_m(found.source.known)
        both = known_at(found.target, found.truth.apply(centres_m))
        smaller_m2 = min(found.target.known_area_m2, found.source.known_area_m2)
        area_m2 = both.mean() * found.source.known_area_m2
        assert found.overlap == pytest.approx(area_m2 / smaller_m2, abs=0.05)
        np.testing.assert_allclose(found.centre_m, centres_m[both].mean(axis=0), atol=0.3)

    def test_a_site_is_found_as_it_was_left(self, kind):
        one, same = (visited(KINDS[kind](4), NO_CHANGES, 1) for _ in range(2))
        assert np.array_equal(one.world.edges_m, same.world.edges_m)
        moved = visited(KINDS[kind](4), Changes(0.5, 0.5, 0.5), 1)
        other = visited(KINDS[kind](5), NO_CHANGES, 1)
        assert edges_in_order(other.plan.edges_m) != edges_in_order(one.plan.edges_m)
        bare = KINDS[kind](4).style.furniture == 0.0
        assert bare or edges_in_order(moved.plan.edges_m) != edges_in_order(one.plan.edges_m)

    def test_symmetries_put_walls_on_walls(self, kind):
        site = KINDS[kind](6)
        for symmetry in site.symmetries[:1]:
            turned = reflected(site, flip_x=True, flip_y=True)
            assert symmetry.yaw_rad == pytest.approx(math.pi)
            boxes = [sorted((room.box.x0_m, room.box.y0_m) for room in item.rooms) for item in (site, turned)]
            np.testing.assert_allclose(*boxes, atol=1e-6)

    def test_the_next_floor_has_the_same_outline(self, kind):
        site = KINDS[kind](7)
        other = altered(site, 8)
        assert other.extent == site.extent
        assert sum(room.box.area_m2 for room in other.rooms) == pytest.approx(
            sum(room.box.area_m2 for room in site.rooms)
        )


def test_pairs_repeat_themselves():
    one, same, other = pair("home", 5), pair("home", 5), pair("home", 6)
    assert one.target.same_as(same.target)
    assert one.source.same_as(same.source)
    assert (one.truth, one.overlap, one.ambiguous) == (same.truth, same.overlap, same.ambiguous)
    assert not one.target.same_as(other.target)


def test_the_overlap_follows_what_is_wanted():
    found = [pair("symmetric", 1, overlap).overlap for overlap in (0.2, 0.5, 0.8)]
    np.testing.assert_allclose(found, [0.2, 0.5, 0.8], atol=0.15)
    assert found == sorted(found)


@pytest.mark.parametrize("related", STRANGERS)
def test_strangers_have_no_truth(related):
    found = strangers("home", 9, related)
    assert found.truth is None
    assert found.related == related
    assert found.overlap == 0.0


def test_one_mission_yields_many_pairs():
    found = list(pairs(mission("symmetric", 2, robots=3, maps=2)))
    assert len(found) > 3
    assert len({item.name for item in found}) == len(found)
    for item in found:
        assert 0.05 <= item.overlap <= 1.0
        assert agreement(look(item.target), look(item.source), item.truth) > 0.6


class TestAmbiguous:
    def test_a_bare_corridor_is(self):
        seed = next(seed for seed in range(20) if KINDS["corridor"](seed).style.furniture == 0.0)
        assert any(item.ambiguous for item in pairs(mission("corridor", seed, robots=2, maps=2)))

    def test_an_office_is_not(self):
        assert not cached_pair("office", 3).ambiguous

    def test_a_plain_room_is(self):
        room = {"walls": outline(0.0, 0.0, 6.0, 4.0), "size_m": (7.0, 5.0), "floor_from_map": Sim2(-0.5, -0.5)}
        plain = [look(drawn(within(0.0, 0.0, 6.0, 4.0), ragged=seed, **room)) for seed in (1, 2)]
        assert has_rival(*plain, IDENTITY)
        room["walls"] = [*room["walls"], (1.0, 0.0, 1.1, 2.5), (1.0, 2.5, 2.5, 2.6)]
        told_apart = [look(drawn(within(0.0, 0.0, 6.0, 4.0), ragged=seed, **room)) for seed in (1, 2)]
        assert not has_rival(*told_apart, IDENTITY)

    def test_the_truth_explains_itself(self):
        found = cached_pair("symmetric", 3)
        looks = look(found.target), look(found.source)
        assert explains_as_well(*looks, found.truth, found.truth)
        assert not explains_as_well(*looks, found.truth, Sim2(500.0, 0.0) @ found.truth)
        assert shared_m2(*looks, Sim2(500.0, 0.0) @ found.truth) == 0.0


class TestBend:
    @pytest.mark.parametrize("folded", [False, True])
    @pytest.mark.parametrize("turn_rad", [0.6, -0.6])
    def test_ends_keep_their_shape(self, folded, turn_rad):
        bend = Bend(axis_m=5.0, start_m=8.0, length_m=10.0, turn_rad=turn_rad, folded=folded)
        corners = np.array([[20.0, 1.0], [24.0, 1.0], [24.0, 9.0], [20.0, 9.0]])
        np.testing.assert_allclose(bend.apply(corners - [18.0, 0.0]), corners - [18.0, 0.0], atol=1e-9)
        there = bend.apply(corners)
        sides = np.roll(there, -1, axis=0) - there
        np.testing.assert_allclose(np.hypot(*sides.T), [4.0, 8.0, 4.0, 8.0], atol=1e-9)
        assert math.atan2(sides[0, 1], sides[0, 0]) == pytest.approx(turn_rad)

    @pytest.mark.parametrize("folded", [False, True])
    def test_nothing_is_torn(self, folded):
        bend = Bend(axis_m=5.0, start_m=8.0, length_m=10.0, turn_rad=0.6, folded=folded)
        along = np.linspace(0.0, 30.0, 3001)
        for y_m in (0.0, 5.0, 10.0):
            steps = np.hypot(*np.diff(bend.apply(np.stack([along, np.full_like(along, y_m)], axis=1)), axis=0).T)
            assert steps.min() > 0.002
            assert steps.max() < 0.02

    def test_walls_meet_after_it(self):
        plan = visited(KINDS["round"](1), NO_CHANGES, 0).plan
        there = bent(plan, Bend(6.0, 5.0, 15.0, 0.8))
        assert len(there.edges_m) > len(plan.edges_m)
        assert len(there.opacity) == len(there.edges_m)


class TestWarp:
    def test_none_leaves_poses_alone(self):
        assert Warp().apply(Sim2(3.0, 4.0, 0.5)) == Sim2(3.0, 4.0, 0.5)
        assert drawn_warp(0.0, np.random.default_rng(0)) == Warp()

    def test_shifts_by_no_more_than_it_should(self):
        warp = drawn_warp(0.3, np.random.default_rng(1))
        shifts = [
            math.hypot(moved.x_m - x, moved.y_m - y)
            for x in range(0, 60, 5)
            for y in range(0, 60, 5)
            for moved in [warp.apply(Sim2(x, y))]
        ]
        assert 0.1 < max(shifts) <= 0.3 + 1e-9
