"""Maps that jumped, and maps that only grew: has a robot's map contradicted itself?"""

import itertools

import numpy as np
import pytest

from mapmerge.config import MergeConfig
from mapmerge.grid import Grid
from mapmerge.jump import jump
from mapmerge.lattice import changed_box
from mapmerge.merger import Merger
from mapmerge.outcome import ChangeKind
from mapmerge.sim2 import IDENTITY, Sim2
from tests.floors import FLAT_M, FLAT_WALLS, drawn, flat, in_frame, last_map, office_run, within

CONFIG = MergeConfig()
RUN = (4, 0.0, 0.7, 0.4, 1)
DOORS = [(3.5, 2.2, 3.6, 3.1), (6.2, 1.3, 6.3, 2.2), (1.2, 4.4, 2.1, 4.5)]
ELSEWHERE = {
    "on the same cells": Sim2(3.0, -2.0),
    "on the same cells, where nothing was": Sim2(400.0),
    "on other cells": Sim2(3.01, -2.02),
    "on other cells, where nothing was": Sim2(0.0, -333.02),
    "turned": Sim2(3.0, -2.0, 1.0),
    "turned by a quarter": Sim2(yaw_rad=np.pi / 2),
}


def jumps(before, after):
    """Tell whether a map jumped, as the merger asks."""
    before, after = before.cropped_to_known(), after.cropped_to_known()
    return jump(before, after, changed_box(before, after), before.known_area_m2, CONFIG) is not None


def snapshots(**options):
    return [snapshot.grid for snapshot in office_run(*RUN, maps=10, **options).snapshots]


def padded(grid, low, high):
    """Return the same map on a grid that reaches so many cells farther: down and left, and up and right."""
    corner = Sim2(-low * grid.resolution_m, -low * grid.resolution_m)
    cells = np.pad(grid.cells, (low, high), constant_values=-1)
    return Grid(cells, grid.resolution_m, grid.map_from_grid @ corner)


def with_people(grid, count, seed):
    """Return the map with people of 0.2 × 0.2 m standing about where it is free."""
    cells = grid.cells.copy()
    rng = np.random.default_rng(seed)
    for at in rng.choice(np.flatnonzero(grid.known & (cells <= CONFIG.cells.max_free_percent)), count):
        row, col = np.unravel_index(at, cells.shape)
        cells[row : row + 4, col : col + 4] = 100
    return Grid(cells, grid.resolution_m, grid.map_from_grid)


class TestNone:
    @pytest.mark.parametrize("resolution_m", [0.05, 0.1])
    def test_while_a_map_grows(self, resolution_m):
        maps = snapshots(resolution_m=resolution_m)
        assert maps[-1].known_area_m2 > 4.0 * maps[0].known_area_m2
        assert len({grid.map_from_grid for grid in maps}) > 1
        assert not any(jumps(before, after) for before, after in itertools.pairwise(maps))

    def test_from_the_first_map_to_the_last(self):
        maps = snapshots()
        assert not jumps(maps[0], maps[-1])

    @pytest.mark.parametrize("frame", [IDENTITY, Sim2(-70.0, 31.0, 0.8)])
    def test_where_only_the_origin_moves(self, frame):
        before, after = (in_frame(grid, frame) for grid in (snapshots()[4], snapshots()[5]))
        assert not jumps(padded(before, 3, 40), padded(after, 57, 2))
        assert not jumps(padded(after, 57, 2), after)

    def test_where_people_walk_about(self):
        maps = snapshots(people=8)
        assert not any(jumps(before, after) for before, after in itertools.pairwise(maps))
        assert not maps[-1].same_as(snapshots()[-1])

    def test_where_people_stand_about(self):
        """At other places whenever a map is sent."""
        maps = [with_people(grid, 8, seed) for seed, grid in enumerate(snapshots())]
        assert not any(jumps(before, after) for before, after in itertools.pairwise(maps))
        assert not jumps(maps[-1], snapshots()[-1])

    def test_where_doors_open_and_close(self):
        walls = {"inside": within(0.0, 0.0, *FLAT_M), "size_m": (11.0, 8.0), "floor_from_map": Sim2(-1.0, -1.0)}
        opened, closed = drawn(walls=FLAT_WALLS, **walls), drawn(walls=[*FLAT_WALLS, *DOORS], **walls)
        assert np.count_nonzero(opened.cells != closed.cells) > 80
        assert not jumps(opened, closed)
        assert not jumps(closed, opened)

    @pytest.mark.parametrize("off", [Sim2(0.02, 0.013), Sim2(0.025, -0.025), Sim2(yaw_rad=0.002)])
    def test_where_the_cells_lie_a_little_off(self, off):
        """The same place, drawn on cells that begin by a fraction of a cell elsewhere."""
        corner = Sim2(-1.0, -1.0)
        other = flat(corner @ off)
        assert not jumps(flat(corner), in_frame(other, off))

    @pytest.mark.parametrize("off", [Sim2(0.1, 0.1), Sim2(-0.1, 0.1)])
    def test_where_all_of_it_moves_by_less_than_walls_may_differ(self, off):
        grid = last_map(office_run(*RUN))
        assert not jumps(grid, in_frame(grid, off))
        assert jumps(grid, in_frame(grid, Sim2(3.0 * off.x_m, 3.0 * off.y_m)))

    @pytest.mark.parametrize("resolutions_m", [(0.05, 0.05), (0.05, 0.1), (0.1, 0.05), (0.05, 0.08)])
    def test_where_the_resolution_changes(self, resolutions_m):
        """A new wall of 6 m is too little of a contradiction at any of them."""
        before, after = (flat(resolution_m=resolution_m) for resolution_m in resolutions_m)
        assert not jumps(before, after)
        wall = drawn(
            within(0.0, 0.0, *FLAT_M),
            [*FLAT_WALLS, (1.0, 3.2, 7.0, 3.3)],
            size_m=(11.0, 8.0),
            resolution_m=resolutions_m[1],
            floor_from_map=Sim2(-1.0, -1.0),
        )
        assert not jumps(before, wall)

    def test_of_a_map_that_forgets_less_than_half(self):
        grid = last_map(office_run(*RUN))
        known = np.flatnonzero(grid.known)
        for share, is_jump in ((0.45, False), (0.55, True)):
            cells = grid.cells.copy()
            cells.ravel()[known[: int(share * len(known))]] = -1
            assert jumps(grid, Grid(cells, grid.resolution_m, grid.map_from_grid)) == is_jump

    def test_of_the_same_map(self):
        grid = last_map(office_run(*RUN))
        assert not jumps(grid, Grid(grid.cells.copy(), grid.resolution_m, grid.map_from_grid))


class TestLoopClosure:
    @staticmethod
    def closed(grid, shift_m, share=0.5):
        """Return the map with a part of it moved, as after a loop was closed."""
        cells, shift = grid.cells.copy(), round(shift_m / grid.resolution_m)
        first = round((1.0 - share) * grid.cols)
        cells[:, first:] = -1
        cells[shift:, first:] = grid.cells[:-shift, first:]
        return Grid(cells, grid.resolution_m, grid.map_from_grid)

    @pytest.mark.parametrize(("shift_m", "is_jump"), [(0.1, False), (0.4, True), (1.0, True)])
    def test_moves_a_part_of_the_walls(self, shift_m, is_jump):
        """By more than what two maps of one place may differ anyway."""
        grid = padded(last_map(office_run(*RUN)), 5, 30)
        assert jumps(grid, self.closed(grid, shift_m)) == is_jump
        assert jumps(self.closed(grid, shift_m), grid) == is_jump

    def test_walls_may_only_come_or_only_go(self):
        grid = last_map(office_run(*RUN))
        cells = np.where(grid.cells[:, : grid.cols // 2] >= 65, 0, grid.cells[:, : grid.cols // 2])
        bare = Grid(np.hstack([cells, grid.cells[:, grid.cols // 2 :]]), grid.resolution_m, grid.map_from_grid)
        assert jumps(grid, bare)
        assert jumps(bare, grid)

    def test_also_where_the_map_grows_meanwhile(self):
        before, after = snapshots()[-3], self.closed(padded(snapshots()[-1], 7, 30), 0.5)
        assert jumps(before, after)

    def test_of_a_small_corner_is_none(self):
        grid = padded(last_map(office_run(*RUN)), 5, 30)
        assert not jumps(grid, self.closed(grid, 0.5, share=0.1))


class TestBegunAnew:
    @pytest.mark.parametrize("where", ELSEWHERE)
    @pytest.mark.parametrize("number", [0, 3, 9])
    def test_in_another_frame(self, where, number):
        """With a first small map, or with all of it at once."""
        before = snapshots()[-1]
        assert jumps(before, in_frame(snapshots()[number], ELSEWHERE[where]))

    @pytest.mark.parametrize("off", [IDENTITY, Sim2(0.01, 0.02)])
    def test_in_the_same_place(self, off):
        """What is known again lies where it was, but nearly all was forgotten."""
        assert jumps(snapshots()[-1], in_frame(snapshots()[0], off))

    @pytest.mark.parametrize("resolutions_m", [(0.05, 0.1), (0.1, 0.05)])
    def test_with_another_resolution(self, resolutions_m):
        before, after = (last_map(office_run(*RUN, resolution_m=resolution_m)) for resolution_m in resolutions_m)
        assert not jumps(before, after)
        assert jumps(before, in_frame(after, Sim2(2.0, 1.0, 0.4)))


class TestReported:
    @pytest.mark.parametrize("robot", ["r1", "r2"])
    def test_by_the_merger(self, robot):
        """Of every robot, the reference as well; it says that it jumped, and not why a pair was searched."""
        maps = dict(zip(("r1", "r2"), (flat(ragged=1), flat(ragged=2)), strict=True))
        merger = Merger(("r1", "r2"), CONFIG)
        assert [change.kind for change in merger.step(maps).changes] == [ChangeKind.PLACED]
        result = merger.step({robot: in_frame(maps[robot], Sim2(3.0, -2.0, 1.0))})
        told = [(change.robot, change.kind, change.trigger is None) for change in result.changes]
        assert told == [(robot, ChangeKind.JUMPED, True), ("r2", ChangeKind.MOVED, False)]
        assert merger.step({robot: in_frame(flat(ragged=3), Sim2(3.0, -2.0, 1.0))}).changes == ()

    def test_not_of_a_first_map(self):
        merger = Merger(("r1", "r2"), CONFIG)
        assert merger.step({"r1": flat()}).changes == ()
        nothing = Grid(np.full((4, 4), -1, np.int8), 0.05)
        assert merger.step({"r1": nothing}).changes == ()
        assert merger.step({"r1": in_frame(flat(), Sim2(9.0))}).changes == ()
