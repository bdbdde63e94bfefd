"""The recordings that speed is measured on: what is in them, and that their truth is true."""

import numpy as np
import pytest

from benchmarks.huge_mission import HugeMission
from benchmarks.long_mission import MARGIN_CELLS, Mission, main
from benchmarks.made_once import recorded
from mapmerge.config import MergeConfig
from replay.codec import decode
from replay.evaluation.truth import load_truth
from replay.events import Merged
from replay.options import RunOptions
from replay.pipeline import merge
from replay.placement_error import error_of
from replay.runs import RunPath
from replay.sources import open_source

SMALL = Mission(robots=2, updates=5, side_cells=300)
THREE = Mission(robots=3, updates=2, side_cells=240)
HUGE = HugeMission(side_cells=1000, updates=2)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("missions")


def maps_of(path):
    """Return the maps of each robot, and the stamps of all."""
    maps, stamps = {}, []
    with open_source(path) as source:
        for raw in source.messages([item.name for item in source.info.topics]):
            message = decode(raw)
            maps.setdefault(raw.topic, []).append(message.grid)
            stamps.append(message.stamp_ns)
    return maps, stamps


@pytest.mark.parametrize("mission", [SMALL, THREE, HUGE], ids=lambda mission: mission.name)
class TestAnyMission:
    def test_the_truth_is_what_the_last_maps_are_merged_by(self, mission, folder):
        path = recorded(mission, folder)
        options = RunOptions(runs=(RunPath(None, path),), images="none", merge=MergeConfig())
        last = [event for event in merge(options) if isinstance(event, Merged)][-1]
        truths = load_truth(path.with_suffix(".truth.json")).robots
        assert set(truths) == set(last.result.robots) - {"r1"}
        for robot, truth in truths.items():
            error = error_of(last.result.robots[robot].merged_from_map, truth.reference_from_map, truth.at_m)
            assert error.distance_m < 0.03
            assert error.angle_deg < 0.1

    def test_maps_are_trinary_and_grow(self, mission, folder):
        maps, _ = maps_of(recorded(mission, folder))
        for grids in maps.values():
            assert len(grids) == mission.updates
            assert all(set(np.unique(grid.cells)) <= {-1, 0, 100} for grid in grids)
            assert set(np.unique(grids[-1].cells)) == {-1, 0, 100}
            areas_m2 = [grid.known_area_m2 for grid in grids]
            assert areas_m2 == sorted(areas_m2)
            assert areas_m2[-1] > areas_m2[0]
            assert 0.4 < grids[-1].cells.size / mission.side_cells**2 < 1.4

    def test_origins_move_by_whole_cells(self, mission, folder):
        maps, _ = maps_of(recorded(mission, folder))
        for grids in maps.values():
            origins = {(grid.map_from_grid.x_m, grid.map_from_grid.y_m) for grid in grids}
            moved = np.array(list(origins)) / grids[0].resolution_m
            assert np.allclose(moved, np.rint(moved), atol=1e-6)
            assert all(grid.map_from_grid.yaw_rad == 0.0 for grid in grids)

    def test_stamps_interleave(self, mission, folder):
        maps, stamps = maps_of(recorded(mission, folder))
        assert stamps == sorted(set(stamps))
        assert len(stamps) == mission.updates * len(maps)

    def test_equal_missions_give_equal_bytes(self, mission, folder, tmp_path):
        assert recorded(mission, tmp_path).read_bytes() == recorded(mission, folder).read_bytes()


def test_cells_change_near_the_robot_only(folder):
    maps, _ = maps_of(recorded(Mission(robots=1, updates=40, side_cells=500), folder))
    before, after = maps["/r1/map"][-2:]
    shift_m = np.subtract(*[(grid.map_from_grid.x_m, grid.map_from_grid.y_m) for grid in (before, after)])
    col, row = np.rint(shift_m / before.resolution_m).astype(int).tolist()
    changed = before.cells != after.cells[row : row + before.rows, col : col + before.cols]
    assert 0 < changed.sum() < 0.1 * before.known.sum()


def test_missions_that_differ_in_updates_alone_end_with_the_same_maps(folder):
    few, many = (Mission(1, updates, 200, scans=40) for updates in (2, 8))
    ends = [maps_of(recorded(mission, folder))[0]["/r1/map"][-1] for mission in (few, many)]
    assert ends[0].same_as(ends[1])


def test_there_is_a_margin_of_unknown_cells(folder):
    maps, _ = maps_of(recorded(SMALL, folder))
    for grid in maps["/r2/map"]:
        known = grid.cropped_to_known()
        assert (grid.rows, grid.cols) == (known.rows + 2 * MARGIN_CELLS, known.cols + 2 * MARGIN_CELLS)


def test_a_recording_is_made_once(tmp_path, capsys):
    arguments = ["--work", str(tmp_path), "--updates", "2", "--side", "200"]
    main(arguments)
    made = {path: path.stat().st_mtime_ns for path in tmp_path.iterdir()}
    main(arguments)
    assert made == {path: path.stat().st_mtime_ns for path in tmp_path.iterdir()}
    first, second = capsys.readouterr().out.split()
    assert first == second
    assert not list(tmp_path.glob("*.partial"))
