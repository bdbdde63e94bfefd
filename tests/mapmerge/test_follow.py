"""Placements that are followed while maps grow, and put right once the maps say that they were wrong."""

import functools
import itertools
from dataclasses import replace

import numpy as np
import pytest

from mapmerge.grid import Grid
from mapmerge.match.correlation import CorrelationMatcher
from mapmerge.merger import Merger
from mapmerge.outcome import ChangeKind, Status
from mapmerge.prior import Prior
from mapmerge.reasons import Reason, ReasonCode
from mapmerge.sim2 import Sim2
from mapmerge.verify import verify
from mapmerge.watch import Trigger, Watch
from tests.floors import (
    CONFIG,
    drawn,
    errors,
    in_frame,
    last_map,
    office_pair,
    office_run,
    pair_of,
    pair_of_maps,
    within,
)

MATCHER = CorrelationMatcher()
CELL_M = 0.05
PAIR = ("r1", "r2")
SEEDS = (0, 2, 5, 6)


def runs(seed):
    return office_run(seed, 0.0, 0.7, 0.4, 1, maps=16), office_run(seed, 1.0, 0.3, 1.9, 2, maps=16)


@functools.cache
def mission(seed, robots=PAIR):
    """Return the results of merging two robots' growing maps in turns, in either order of the robots."""
    merger, results = Merger(robots, CONFIG), []
    for both in zip(*(run.snapshots for run in runs(seed)), strict=True):
        results.extend(merger.step({robot: snapshot.grid}) for robot, snapshot in zip(PAIR, both, strict=True))
    return results


def poses(results, pair=PAIR):
    """Return where the source lies on the target after each step; None where that is not known."""
    matches = (result.pairs.get(pair) for result in results)
    return [match.target_from_source if match and match.accepted else None for match in matches]


@pytest.mark.parametrize("seed", SEEDS)
class TestGrowing:
    def test_a_followed_placement_moves_by_no_more_than_a_cell_and_mostly_not_at_all(self, seed):
        """If it moves by more, it was found amid little overlap, and becomes better."""
        pair, results = pair_of(*runs(seed)), mission(seed)
        followed = [
            (before, after, errors(after, before, result.grids["r2"].middle_m)[0])
            for (before, after), result in zip(itertools.pairwise(poses(results)), results[1:], strict=True)
            if before and after and not result.searched
        ]
        assert len(followed) > 8
        assert sum(before == after for before, after, _ in followed) >= 0.8 * len(followed)
        for before, after, moved_m in followed:
            assert moved_m <= CELL_M or pair.errors(after)[0] < pair.errors(before)[0] - CELL_M
            assert moved_m <= 2 * CELL_M

    def test_it_is_right_all_along(self, seed):
        pair = pair_of(*runs(seed))
        found = [pose for pose in poses(mission(seed)) if pose]
        assert max(pair.errors(pose)[0] for pose in found) < 0.15
        assert pair.errors(found[-1])[0] < 0.05

    def test_once_found_it_is_never_lost(self, seed):
        found = poses(mission(seed))
        first = next(index for index, pose in enumerate(found) if pose)
        assert None not in found[first:]

    def test_most_updates_search_nothing(self, seed):
        placed = [result for result, pose in zip(mission(seed), poses(mission(seed)), strict=True) if pose]
        assert sum(bool(result.searched) for result in placed) <= len(placed) / 3

    def test_swapping_the_robots_gives_the_inverse(self, seed):
        there, back = mission(seed), mission(seed, PAIR[::-1])
        for one, other, result in zip(poses(there), poses(back, PAIR[::-1]), there, strict=True):
            assert (one is None) == (other is None)
            if one:
                at_m = result.grids["r2"].middle_m
                assert errors(other.inverse(), one, at_m) == pytest.approx((0.0, 0.0), abs=1e-6)
        assert [list(result.searched.values()) for result in there] == [
            list(result.searched.values()) for result in back
        ]


@pytest.fixture(scope="module")
def found():
    """Two maps, prepared, and their match."""
    pair = office_pair(4)
    maps = [MATCHER.prepare(grid, CELL_M, CONFIG) for grid in (pair.target, pair.source)]
    match = MATCHER.match(*maps, CONFIG)
    assert match.accepted
    return pair, maps, match


def moved_by(match, off, at_m):
    """Return the match with its placement turned and shifted about a point of the source."""
    x_m, y_m = at_m
    about = Sim2(x_m, y_m) @ off @ Sim2(-x_m, -y_m)
    return replace(match, target_from_source=match.target_from_source @ about)


class TestOneStep:
    def test_what_still_fits_is_kept_to_the_bit(self, found):
        _, maps, match = found
        again = MATCHER.follow(*maps, match, CONFIG)
        assert again.accepted
        assert again.target_from_source == match.target_from_source
        assert (again.confidence, again.cues) == (match.confidence, match.cues)
        assert "followed" in again.reason.message

    def test_what_is_off_by_less_than_can_be_told_is_kept_as_well(self, found):
        pair, maps, match = found
        near = moved_by(match, Sim2(0.01, -0.01), pair.shared_m)
        assert MATCHER.follow(*maps, near, CONFIG).target_from_source == near.target_from_source

    @pytest.mark.parametrize("off", [Sim2(0.15, 0.1), Sim2(-0.2, 0.0, 0.01), Sim2(0.05, 0.05, -0.02)])
    def test_what_is_off_by_more_is_put_right(self, found, off):
        pair, maps, match = found
        again = MATCHER.follow(*maps, moved_by(match, off, pair.shared_m), CONFIG)
        assert again.accepted
        error_m, error_deg = errors(again.target_from_source, match.target_from_source, pair.shared_m)
        assert error_m < 0.01
        assert error_deg < 0.05

    def test_scores_are_about_those_of_a_search(self, found):
        _, maps, match = found
        scores = MATCHER.follow(*maps, match, CONFIG).scores
        assert scores.overlap_m2 == pytest.approx(match.scores.overlap_m2, rel=0.03)
        assert scores.wall_agreement == pytest.approx(match.scores.wall_agreement, abs=0.02)
        assert scores.matched_wall_m == pytest.approx(match.scores.matched_wall_m, rel=0.05)

    @pytest.mark.parametrize("off", [Sim2(), Sim2(0.15, 0.1)])
    def test_of_swapped_maps_is_the_inverse(self, found, off):
        pair, maps, match = found
        known = moved_by(match, off, pair.shared_m)
        there, back = MATCHER.follow(*maps, known, CONFIG), MATCHER.follow(*maps[::-1], known.inverse(), CONFIG)
        inverse = back.target_from_source.inverse()
        assert errors(inverse, there.target_from_source, pair.shared_m) == pytest.approx((0.0, 0.0), abs=1e-6)
        assert (there.accepted, there.scores.overlap_m2) == (back.accepted, back.scores.overlap_m2)
        assert [rival.score_m for rival in there.rivals] == [rival.score_m for rival in back.rivals]

    @pytest.mark.parametrize("off", [Sim2(3.0), Sim2(0.0, 0.0, 1.0)])
    def test_what_fits_no_more_is_refused(self, found, off):
        pair, maps, match = found
        assert not MATCHER.follow(*maps, moved_by(match, off, pair.shared_m), CONFIG).accepted

    def test_what_is_not_believed_is_refused(self, found):
        _, maps, match = found
        for off_m, is_allowed in ((0.5, True), (5.0, False)):
            pose = match.target_from_source
            prior = Prior(Sim2(pose.x_m + off_m, pose.y_m, pose.yaw_rad), 0.5, 0.5, 0.1, "given for r2")
            assert MATCHER.follow(*maps, match, CONFIG, prior).accepted == is_allowed


BAY_M, BAYS, HEIGHT_M = 4.0, 8, 9.0
CORRIDOR_M = (4.5, 6.5)
LENGTH_M = BAYS * BAY_M
HALL_M = 6 * BAY_M
FRAMES = {"r1": Sim2(-0.5, -0.5), "r2": Sim2(33.0, 12.0, 2.8)}
ONE_BAY_BACK = Sim2(-BAY_M)
ENTRANCE = [(0.0, -0.1, 0.1, HEIGHT_M), (1.0, 2.0, 3.0, 2.1), (1.9, 2.1, 2.0, 3.6), (1.2, 7.4, 2.6, 7.5)]
ENDS = {
    "hall": [*ENTRANCE, (24.0, 5.0, 27.5, 5.1), (27.4, 5.0, 27.5, 7.4), (29.0, 0.0, 29.1, 3.0), (30.0, 6.2, 32.0, 6.3)],
    "other hall": [
        *ENTRANCE,
        (25.5, 3.0, 30.5, 3.1),
        (25.5, 3.0, 25.6, 6.0),
        (30.4, 1.0, 30.5, 3.0),
        (28.0, 7.0, 28.1, 9.0),
    ],
}


def corridor_walls(end):
    """Return a corridor with equal bays on both sides; instead of the last two it may have a hall, and an entrance."""
    bays = BAYS if end == "no hall" else round(HALL_M / BAY_M)
    walls = [(0.0, -0.1, LENGTH_M, 0.0), (0.0, HEIGHT_M, LENGTH_M, HEIGHT_M + 0.1)]
    walls.append((LENGTH_M, 0.0, LENGTH_M + 0.1, HEIGHT_M))
    for bay in range(bays + 1):
        at_m = bay * BAY_M
        walls.append((at_m - 0.05, 0.0, at_m + 0.05, CORRIDOR_M[0]))
        walls.append((at_m - 0.05, CORRIDOR_M[1], at_m + 0.05, HEIGHT_M))
        for y_m in CORRIDOR_M if bay < bays else ():
            walls.append((at_m, y_m - 0.05, at_m + 1.5, y_m + 0.05))
            walls.append((at_m + 2.4, y_m - 0.05, at_m + BAY_M, y_m + 0.05))
    return [*walls, *ENDS.get(end, [])]


@functools.cache
def corridor(robot, from_m, to_m, end):
    """Return what a robot knows of the corridor between two places along it."""
    frame = FRAMES[robot]
    grid = drawn(
        within(from_m, -0.1, to_m, HEIGHT_M + 0.1),
        corridor_walls(end),
        size_m=(36.0, 24.0),
        floor_from_map=frame,
        ragged=int(robot[1:]),
    )
    x_m, _ = frame.apply(grid.centres_m(np.ones(grid.cells.shape, np.bool_))).T
    seen = ((x_m >= from_m) & (x_m < to_m)).reshape(grid.cells.shape)
    return Grid(np.where(seen, grid.cells, -1).astype(np.int8), grid.resolution_m)


def merged_one_bay_off(end):
    """Return a merger that was made to place the second robot one bay off, by bays that nobody can tell apart."""
    merger = Merger(PAIR, CONFIG)
    maps = {"r1": corridor("r1", 4.2, 21.0, end), "r2": corridor("r2", 8.2, 22.0, end)}
    result = merger.step(maps)
    (match,) = result.pairs.values()
    assert match.reason.code is ReasonCode.AMBIGUOUS
    wrong = FRAMES["r1"].inverse() @ ONE_BAY_BACK @ FRAMES["r2"]
    pair = pair_of_maps(*maps.values())
    if pair.target.map.known_area_m2 < pair.source.map.known_area_m2:
        raise AssertionError("the target is expected to be the larger map")
    scores = verify(pair.target.map, pair.source.map, pair.between_grids(wrong), CONFIG.verify)
    assert scores.wall_agreement > 0.9
    believed = replace(
        match,
        target_from_source=wrong,
        scores=scores,
        accepted=True,
        reason=Reason(ReasonCode.ACCEPTED, "by force"),
        rivals=(),
    )
    merger._pairs.matches[PAIR] = believed
    areas_m2 = maps["r1"].known_area_m2, maps["r2"].known_area_m2
    merger._pairs._watches[PAIR] = Watch.of(believed, areas_m2, None, CONFIG.watch)
    result = merger.step({"r1": corridor("r1", 4.1, 21.0, end)})
    assert [(change.kind, change.trigger) for change in result.changes] == [(ChangeKind.PLACED, None)]
    assert errors(result.robots["r2"].merged_from_map, wrong, (20.0, 12.0))[0] < 0.1
    return merger


def grown(merger, end, *, other=None):
    """Let both maps grow to the ends of the corridor, in steps; return what changed.

    The second robot may see another hall; then nobody goes as far as the entrance.
    """
    found = []
    for to_m, back_m in ((23.5, 0.0), (25.0, 0.0), (27.0, 1.0), (29.0, 2.5), (31.0, 4.0), (LENGTH_M + 0.1, 9.0)):
        for robot, from_m, inside in (("r1", 4.1, end), ("r2", 8.2, other or end)):
            result = merger.step(
                {robot: corridor(robot, from_m if other else max(-0.1, from_m - back_m), to_m, inside)}
            )
            found.extend(result.changes)
    return [*found, *merger.step({}, is_last=True).changes]


class TestRevoked:
    """A wrong placement among look-alike places goes on to fit, until something else is seen."""

    def test_look_alike_places_alone_do_not_tell(self):
        merger = merged_one_bay_off("no hall")
        for to_m in (21.4, 21.8):
            result = merger.step({"r1": corridor("r1", 4.1, to_m, "no hall")})
            assert (result.changes, result.searched) == ((), {})
        result = merger.step({}, is_last=True)
        assert result.robots["r2"].status is Status.UNMERGED
        assert [(change.kind, change.trigger) for change in result.changes] == [(ChangeKind.WITHDRAWN, Trigger.END)]

    def test_a_distinctive_place_puts_it_right(self):
        merger = merged_one_bay_off("hall")
        changes = grown(merger, "hall")
        assert changes[0].kind in {ChangeKind.MOVED, ChangeKind.WITHDRAWN}
        assert changes[0].trigger in {Trigger.WEAKENED, Trigger.OVERLAP_GREW, Trigger.MAPS_GREW, Trigger.RIVAL_GAINED}
        outcome = merger.result.robots["r2"]
        assert outcome.status is Status.MERGED
        true = FRAMES["r1"].inverse() @ FRAMES["r2"]
        error_m, error_deg = errors(outcome.merged_from_map, true, (10.0, 8.0))
        assert error_m < 0.05
        assert error_deg < 0.2

    def test_places_that_differ_withdraw_it(self):
        """They turn out to be two corridors of one building, of equal bays."""
        merger = merged_one_bay_off("hall")
        changes = grown(merger, "hall", other="other hall")
        assert changes[0].kind is ChangeKind.WITHDRAWN
        assert changes[0].trigger is not None
        assert merger.result.robots["r2"].status is Status.UNMERGED

    def test_of_another_place_altogether_at_once(self):
        pair = office_pair(4)
        merger = Merger(PAIR, CONFIG)
        merger.step({"r1": pair.target, "r2": pair.source})
        anew = in_frame(last_map(office_run(1, 0.0, 0.7, 0.4, 1)), Sim2(2.0, 1.0, 0.3))
        result = merger.step({"r2": anew})
        assert [(change.kind, change.trigger) for change in result.changes] == [
            (ChangeKind.JUMPED, None),
            (ChangeKind.WITHDRAWN, Trigger.MAP_JUMPED),
        ]
