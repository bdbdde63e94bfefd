"""Robots' own maps, each at its place on the cells of the merged map."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from mapmerge.config import CellConfig, MergeConfig
from mapmerge.extents import Extent
from mapmerge.fuse import fuse
from mapmerge.grid import UNKNOWN_BYTE, Grid
from mapmerge.plane import Box, read
from mapmerge.sim2 import Sim2
from mapmerge.warp import Layer
from replay.documents import Node
from replay.errors import InputError, UsageError
from replay.events import Noted
from replay.export.maps import THE_MAP, Maps, Say, grid_topics, maps_at, one_map
from replay.export.same_inputs import refuse_left_out, refuse_others
from replay.options import RunOptions, TimeBound
from replay.plain_text import listed
from replay.report_file import holds_mcap, read_report
from replay.run_result import RunInput, RunResult
from replay.runs import RunPath, TopicChoice
from replay.settings.of_run import reading_of
from replay.sinks.mcap_file import topic_parts


def placed_maps(
    result: RunResult, robots: Sequence[str], recordings: Sequence[RunPath], at: TimeBound | None, say: Say
) -> Maps:
    """Return robots' own maps at their places, as of the time of a run's outcome.

    Parameters
    ----------
    result
        The outcome, as of that time.
    recordings
        What was merged; nothing to take the maps from the run's MCAP, which has them if it was told to.
    at
        That time; None for the end of the run.

    Raises
    ------
    ReplayError
        If a robot is not placed, or there is no map of it.
    """
    poses = {name: _pose(result, name) for name in robots}
    own = _own_maps(result, robots, recordings, at, say)
    missing = [name for name in robots if name not in own.grids]
    if missing:
        raise UsageError(f"there is no map of {listed(missing)} by that time")
    is_mcap = holds_mcap(result.name)
    merged = one_map(result.name, None, at, say).grids[THE_MAP] if is_mcap else _merged(result, own)
    return replace(own, grids={name: placed(own.grids[name], pose, merged) for name, pose in poses.items()})


def placed(grid: Grid, merged_from_map: Sim2, merged: Grid) -> Grid:
    """Return a robot's map on the cells of the merged map, and as large: each cell is that of the map at its middle.

    Nothing is interpolated; a map that is finer is pooled, so that thin walls stay.

    Raises
    ------
    InputError
        If it would be larger than any merged map may be.
    """
    extent = Extent.of(grid.cropped_to_known(), merged.map_from_grid.inverse() @ merged_from_map)
    coarsened = replace(extent, cell_m=merged.resolution_m)
    if not coarsened.fits(MergeConfig().max_canvas_cells):
        cols, rows = coarsened.sides_cells
        raise InputError(f"the map would have {cols} × {rows} cells on those of the merged map, more than are made")
    return _as_large(fuse([Layer(grid, merged_from_map)], merged, CellConfig()).grid, merged)


def _as_large(grid: Grid, merged: Grid) -> Grid:
    """Return a grid on the cells of another one, with unknown cells around it as far as that reaches."""
    shift, cell_m = merged.map_from_grid.inverse() @ grid.map_from_grid, merged.resolution_m
    own = Box(0, 0, *grid.cells.shape).shifted(round(shift.y_m / cell_m), round(shift.x_m / cell_m))
    whole = Box(0, 0, *merged.cells.shape).union(own)
    cells = read(grid.cells.view(np.uint8), whole.shifted(-own.top, -own.left), UNKNOWN_BYTE).view(np.int8)
    return Grid(cells, cell_m, merged.map_from_grid @ Sim2(whole.left * cell_m, whole.top * cell_m), is_own=True)


def _merged(result: RunResult, own: Maps) -> Grid:
    """Merge the maps at the places that a report says, where there is no merged map to look at."""
    reference = own.grids.get(result.reference)
    if reference is None:
        raise UsageError(f"there is no map of {result.reference}, the reference, by that time")
    layers = [
        Layer(grid, pose)
        for name, grid in own.grids.items()
        if (pose := result.robots[name].merged_from_map) is not None
    ]
    return fuse(layers, reference, CellConfig()).grid


def _pose(result: RunResult, robot: str) -> Sim2:
    found = result.robots[robot]
    if found.merged_from_map is None:
        raise UsageError(f"--robots: {robot} is not placed: {found.message}")
    return found.merged_from_map


def _own_maps(
    result: RunResult, robots: Sequence[str], recordings: Sequence[RunPath], at: TimeBound | None, say: Say
) -> Maps:
    if recordings:
        merged = _merged_inputs(result, at)
        options = _as_merged(result, recordings, merged)
        if not all(item.sha256 for item in merged):
            say(Noted("", f"{result.name} holds no digests of what was merged; recordings are told by name and size"))
        return maps_at(options, at or _end(result), say, partial(refuse_others, merged))
    copies = {name: f"/{part}/map" for name, part in topic_parts(list(result.robots)).items()}
    there = grid_topics(result.name) if holds_mcap(result.name) else []
    missing = [name for name in robots if copies[name] not in there]
    if missing:
        raise UsageError(
            f"{result.name} holds no map of {listed(missing)}; give the recordings that were merged, as "
            "--maps run.mcap, or merge again with --copy-maps"
        )
    found = {name: topic for name, topic in copies.items() if topic in there}
    choices = tuple(TopicChoice(name, topic) for name, topic in found.items())
    return maps_at(RunOptions((RunPath(None, result.name),), tuple(found), choices), at, say)


def _merged_inputs(result: RunResult, at: TimeBound | None) -> tuple[RunInput, ...]:
    """Return what was merged; only the last report of a run knows the digests."""
    return result.inputs if at is None else RunResult.of(read_report(result.name), result.name).inputs


def _as_merged(result: RunResult, recordings: Sequence[RunPath], merged: Sequence[RunInput]) -> RunOptions:
    """Return how the recordings were read, so that maps and times are those of the run.

    Raises
    ------
    UsageError
        If some of those that were merged are missing.
    InputError
        If the report's settings are not those of a run.
    """
    given = Counter(run.path.name for run in recordings)
    left = list(merged)
    for item in merged:
        if given[item.name]:
            given[item.name] -= 1
            left.remove(item)
    refuse_left_out(left)
    settings = Node(result.name, result.settings, ("settings",))
    return RunOptions(tuple(recordings), tuple(result.robots), **reading_of(settings))


def _end(result: RunResult) -> TimeBound | None:
    """Return the time of the run's last maps: with --stop there may be later ones in the recordings."""
    return None if result.stamp_ns is None else TimeBound(result.stamp_ns, relative=False)
