"""Laws of exports and comparisons."""

from __future__ import annotations

import tempfile
import warnings
from pathlib import Path

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from ruamel.yaml import YAML

from mapmerge.grid import Grid
from mapmerge.sim2 import IDENTITY, Sim2
from replay.codec import decode
from replay.comparison.differences import Tolerance, compare
from replay.export.map_server import files
from replay.export.placed import placed
from replay.run_result import RobotResult, RunResult
from replay.sources import open_source

shapes = st.tuples(st.integers(1, 12), st.integers(1, 12))
cells = hnp.arrays(np.int8, shapes, elements=st.integers(-1, 100))
places = st.floats(-1000.0, 1000.0)
poses = st.builds(Sim2, places, places, st.floats(-3.14, 3.14))
grids = st.builds(Grid, cells, st.sampled_from([0.05, 0.1, 0.025, 0.033, 1.0]), poses)


@given(grids, st.sampled_from(["trinary", "scale", "raw"]))
def test_what_is_loaded_is_what_was_written(grid: Grid, mode: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        for path, content in files(grid, Path(folder) / "map", mode).items():
            path.write_bytes(content)
        with open_source(path) as source:  # the last one leads to the others
            (raw,) = source.messages(["/map"])
    found = decode(raw).grid
    known = grid.cells
    expected = np.select([known < 0, known <= 25, known >= 65], [-1, 0, 100], -1) if mode == "trinary" else known
    assert np.array_equal(found.cells, expected)
    assert found.resolution_m == grid.resolution_m
    assert found.map_from_grid.is_close(grid.map_from_grid, distance_m=1e-8, angle_rad=1e-8, at_m=(0.0, 0.0))


@given(cells, cells, st.integers(-9, 9), st.integers(-9, 9))
def test_a_map_that_lies_by_whole_cells_is_copied(own: np.ndarray, merged: np.ndarray, rows: int, cols: int) -> None:
    whole = placed(Grid(own, 0.1), Sim2(cols * 0.1, rows * 0.1), Grid(merged, 0.1))
    corner = whole.map_from_grid
    row, col = rows - round(corner.y_m / 0.1), cols - round(corner.x_m / 0.1)
    known = np.argwhere(own >= 0)
    assert np.count_nonzero(whole.cells >= 0) == len(known)
    for at_row, at_col in known:
        assert whole.cells[row + at_row, col + at_col] == own[at_row, at_col]
    assert whole.rows >= merged.shape[0]
    assert whole.cols >= merged.shape[1]


@given(
    st.floats(1e-6, 100.0),
    st.builds(Sim2, st.floats(-1e8, 1e8), st.floats(-1e-3, 1e-3), st.floats(-1e-3, 1e-3)),
    st.sampled_from(["trinary", "scale", "raw"]),
)
def test_numbers_are_numbers_for_all_readers_of_yaml(resolution_m: float, pose: Sim2, mode: str) -> None:
    """YAML 1.1, which most loaders of maps read, takes 1e-05 for a text."""
    grid = Grid(np.zeros((1, 1), np.int8), resolution_m, pose)
    (text,) = [content for path, content in files(grid, Path("map"), mode).items() if path.suffix == ".yaml"]
    reader = YAML(typ="safe", pure=True)
    reader.version = (1, 1)
    with warnings.catch_warnings(action="error"):  # which is what this reader says of such a text, and takes it
        found = reader.load(text.decode())
    assert found["resolution"] == resolution_m
    assert all(isinstance(each, float) for each in (*found["origin"], found["resolution"]))
    assert np.abs(np.subtract(found["origin"], (pose.x_m, pose.y_m, pose.yaw_rad))).max() <= 1e-9
    assert all(isinstance(found[key], float) for key in ("occupied_thresh", "free_thresh"))


shares = st.none() | st.floats(0.0, 1.0)


def robot(name: str, status: str, pose: Sim2, share: float | None, time_s: float | None) -> RobotResult:
    is_placed = status in ("reference", "merged")
    reason = "accepted" if is_placed else "ambiguous"
    return RobotResult(name, status, reason, "", pose if is_placed else None, share, share, share, time_s, "map")


@st.composite
def results(draw: st.DrawFn) -> RunResult:
    names = draw(st.lists(st.sampled_from("abcde"), max_size=5, unique=True))
    statuses = st.sampled_from(["merged", "unmerged", "no_map"])
    robots = {
        name: robot(name, draw(statuses), draw(poses), draw(shares), draw(st.none() | st.floats(0, 999)))
        for name in names
    }
    robots = {"r1": robot("r1", "reference", IDENTITY, draw(shares), None), **robots}
    skipped = draw(st.dictionaries(st.sampled_from(["damaged", "empty"]), st.integers(1, 9)))
    return RunResult(Path("run.json"), "r1", robots, skipped, "1", {}, ())


@given(results())
def test_a_run_does_not_differ_from_itself(run: RunResult) -> None:
    assert compare(run, run, Tolerance(0.0, 0.0, 0.0, 0.0, 0.0)).differences == ()


_MIRRORED = {"appeared": "vanished", "vanished": "appeared", "placed": "lost", "lost": "placed"}


@given(results(), results())
def test_what_appears_one_way_vanishes_the_other(one: RunResult, other: RunResult) -> None:
    there = compare(one, other, Tolerance()).differences
    back = compare(other, one, Tolerance()).differences
    mirrored = {(item.robot, _MIRRORED.get(item.what, item.what), item.after, item.before) for item in there}
    assert mirrored == {(item.robot, item.what, item.before, item.after) for item in back}
