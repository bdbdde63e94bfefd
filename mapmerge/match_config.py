"""Settings of the default method, which correlates maps: how candidates are found, aligned and bent."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

from mapmerge.settings import Above, Settings, Within


@dataclass(frozen=True, slots=True)
class SearchConfig(Settings):
    """How candidates for a placement are found.

    Parameters
    ----------
    wall_spacing_m
        Walls are thinned to one point per square of this side or, in coarser maps, per cell, which then stands for
        a cell of wall: a metre of wall weighs about the same in maps of any resolution.
    angle_step_rad
        Step of the orientation spectrum.
    rotations
        Rotations taken from the correlation of each of the two kinds of spectra; each is tried as it is and turned by
        180°.
    cell_m, large_cell_m
        Side of the cells of the coarse maps that are correlated: the second where there would be more than
        `many_side_cells` of the first a side. Larger where the maps have larger cells, or would need more than
        `max_side_cells` of them.
    free_weights
        What a wall in the other map's free space costs, against 1 for a wall on a wall: candidates are taken for each
        of these, as maps that are bent ask for a low weight and maps that share little for a high one.
    shifts
        Peaks of the correlation surface that are taken for each rotation.
    peak_distance_m
        Least distance of two peaks of one surface.
    many_side_cells, max_side_cells
        So many cells a side are many, and the most, of the correlated maps.
    max_candidates
        Candidates of all rotations that are aligned, for each weight.
    sweep_step_rad, sweep_cell_m, sweep_free_weights, sweep_shifts, sweep_candidates
        The same for the second look, at all rotations.
    scale_step, distinct_scale
        Ratio of two scales that are tried, where the scale is free, and how far the logarithms of two are apart that
        can be told from each other.
    clear_agreement, clear_wall_m, clear_likeness
        A placement is clear, and no second look is taken, with at least this wall agreement and so much matched wall,
        and no rival that is more than so many times as good.
    weighed, worth_weighing
        How many distinct placements at most are weighed against each other, and what share of the largest score each
        of them must have.
    working_cell_m
        Two maps are matched at the coarser of their resolutions, and never finer than this.
    """

    wall_spacing_m: Annotated[float, Above(0.0, 10.0)] = 0.10
    angle_step_rad: Annotated[float, Within(0.001, 0.5)] = math.radians(1.0)
    rotations: tuple[Annotated[int, Within(0, 1000)], Annotated[int, Within(0, 1000)]] = (4, 3)
    cell_m: Annotated[float, Above(0.0, 10.0)] = 0.20
    large_cell_m: Annotated[float, Within(0.0, 10.0)] = 0.30
    free_weights: tuple[float, ...] = (0.5, 1.8)
    shifts: Annotated[int, Within(0, 1_000)] = 8
    peak_distance_m: Annotated[float, Within(0.0, 100.0)] = 0.8
    many_side_cells: Annotated[int, Within(1, 4_000)] = 640
    max_side_cells: Annotated[int, Within(1, 4_000)] = 1000
    max_candidates: Annotated[int, Within(0, 10_000)] = 40
    sweep_step_rad: Annotated[float, Within(0.005, 0.5)] = math.radians(2.5)
    sweep_cell_m: Annotated[float, Above(0.0, 10.0)] = 0.25
    sweep_free_weights: tuple[float, ...] = (1.5,)
    sweep_shifts: Annotated[int, Within(0, 1_000)] = 6
    sweep_candidates: Annotated[int, Within(0, 10_000)] = 240
    scale_step: Annotated[float, Within(1.005, 10.0)] = 1.05
    distinct_scale: Annotated[float, Within(0.001, 10.0)] = 0.15
    clear_agreement: float = 0.9
    clear_wall_m: float = 10.0
    clear_likeness: float = 0.5
    weighed: Annotated[int, Within(1, 1_000)] = 8
    worth_weighing: float = 0.15
    working_cell_m: Annotated[float, Within(0.0, 10.0)] = 0.05


@dataclass(frozen=True, slots=True)
class RefineConfig(Settings):
    """How candidates are aligned (ICP against the nearest walls).

    Parameters
    ----------
    rough_reject_m, reject_m
        One step for each of these, beyond which pairs are left out: of the first pass, with all candidates, and of the
        second, with the best of them.
    rough_points, points
        Wall points used in these passes, evenly thinned.
    rough_probes, probes
        Points that are looked up in the other map to rank candidates after these passes.
    survivors
        Candidates that take part in the second pass.
    iterations
        Most steps of the last, finest alignment.
    max_polish_points
        Wall cells used in it.
    blur_cells
        Standard deviation, in cells, by which walls are blurred there.
    """

    rough_reject_m: tuple[Annotated[float, Within(0.001, 20.0)], ...] = (1.0, 0.8, 0.8, 0.5, 0.5, 0.5, 0.3, 0.3)
    reject_m: tuple[Annotated[float, Within(0.001, 20.0)], ...] = (0.4, 0.3, 0.2, 0.2, 0.15, 0.15)
    rough_points: Annotated[int, Within(1, 100_000)] = 300
    points: Annotated[int, Within(1, 100_000)] = 1000
    rough_probes: Annotated[int, Within(1, 100_000)] = 400
    probes: Annotated[int, Within(1, 100_000)] = 2000
    survivors: Annotated[int, Within(0, 10_000)] = 16
    iterations: Annotated[int, Within(0, 1_000)] = 12
    max_polish_points: Annotated[int, Within(1, 100_000)] = 1500
    blur_cells: Annotated[float, Within(0.1, 10.0)] = 1.0


@dataclass(frozen=True, slots=True)
class SlackConfig(Settings):
    """How far maps may be bent, as by a SLAM's drift.

    Parameters
    ----------
    cell_m
        Side of the squares of the field of shifts.
    length_m
        Shifts are alike over about this distance.
    most_m
        Largest shift.
    reject_m
        One step for each of these, beyond which walls are not drawn to each other.
    stiffness_m
        How much wall it takes to shift its surroundings, in each step, by half of what it asks for.
    """

    cell_m: Annotated[float, Within(0.05, 100.0)] = 0.5
    length_m: Annotated[float, Above(0.0, 20.0)] = 1.5
    most_m: Annotated[float, Within(0.0, 20.0)] = 0.9
    reject_m: tuple[Annotated[float, Within(0.001, 20.0)], ...] = (0.9, 0.9, 0.7, 0.5, 0.4, 0.3)
    stiffness_m: Annotated[float, Above(0.0, 1000.0)] = 3.0
