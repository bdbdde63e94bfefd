"""Part (a): recordings of real buildings, replayed through the pipeline and checked tick by tick.

A robot must be placed rightly by the tick at which what its map truly shares with the others' reaches half of what it
shares in the end, and from then on; before that it may be refused. A placement elsewhere is wrong at any tick.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.verdicts import MAX_ERROR_CELLS, MAX_ERROR_CELLS_BENT, Tolerance
from mapmerge.config import MergeConfig
from mapmerge.grid import Grid
from mapmerge.sim2 import IDENTITY, Sim2
from replay.evaluation.truth import RobotTruth, load_truth
from replay.events import Merged
from replay.options import RunOptions
from replay.pipeline import merge
from replay.placement_error import PlacementError, error_of
from replay.runs import RunPath
from samples.mission import known_at

RECORDINGS = (
    "intel_two.mcap",
    "intel_res.mcap",
    "intel_noise.mcap",
    "intel_three.bag",
    "fr101_two",
    "fr101_half.mcap",
    "fhw_two.mcap",
    "other_place.mcap",
    "odd_one_out.mcap",
)
HELD_OUT = ("fhw_two",)
BENT = ("fr101_half", "fhw_two")
_DUE_SHARE = 0.5
_MOST_POINTS = 20_000


@dataclass(frozen=True, slots=True)
class Moment:
    """One robot after one tick.

    Parameters
    ----------
    time_s
        Since the first tick.
    overlap_m2
        What its map truly shares with those of the other robots of the same place.
    error
        Of its placement; None if it is not placed, infinite if it must not be.
    allowed
        How far off it may be.
    """

    time_s: float
    overlap_m2: float
    error: PlacementError | None
    allowed: Tolerance

    @property
    def is_right(self) -> bool:
        """Whether it is placed, and near enough to the truth."""
        return self.error is not None and self.allowed.admits(self.error)


@dataclass(frozen=True, slots=True)
class Course:
    """How one robot fared in one recording.

    Parameters
    ----------
    method, recording, robot
        Which.
    belongs
        Whether its map is of the reference's place.
    reason
        What was said of it in the end.
    acceptance
        Its acceptance index in the end, or that of its best refused candidate.
    moments
        Each tick at which it had a map.
    """

    method: str
    recording: str
    robot: str
    belongs: bool
    reason: str
    acceptance: float | None
    moments: tuple[Moment, ...]

    @property
    def due(self) -> int:
        """Number of the moment from which on it must be placed; past the end if it must not be."""
        if not self.belongs:
            return len(self.moments)
        half_m2 = _DUE_SHARE * self.moments[-1].overlap_m2
        return next(number for number, moment in enumerate(self.moments) if moment.overlap_m2 >= half_m2)

    @property
    def first(self) -> int | None:
        """Number of the first moment at which it was placed."""
        return next((number for number, moment in enumerate(self.moments) if moment.error is not None), None)

    @property
    def wrong(self) -> int:
        """At how many moments it was placed elsewhere, or though it does not belong."""
        return sum(moment.error is not None and moment.error.is_elsewhere for moment in self.moments)

    @property
    def late(self) -> int:
        """At how many moments from the due one on it was not placed rightly."""
        return sum(
            moment.error is None or not moment.error.within(moment.allowed.distance_m, moment.allowed.angle_deg)
            for moment in self.moments[self.due :]
        )

    @property
    def is_right(self) -> bool:
        """Whether all was as it should be."""
        return self.wrong == 0 and self.late == 0


def courses(path: Path, method: str) -> list[Course]:
    """Replay a recording and return how each robot but the reference fared."""
    name = path.name.partition(".")[0]
    truths = load_truth(path.parent / f"{name}.truth.json").robots
    moments: dict[str, list[Moment]] = {robot: [] for robot in truths}
    last: Merged | None = None
    first_ns: int | None = None
    for event in _ticks(path, method):
        first_ns = event.stamp_ns if first_ns is None else first_ns
        time_s = (event.stamp_ns - first_ns) / 1e9
        last = event
        for robot, truth in truths.items():
            if robot in event.result.grids:
                moments[robot].append(_moment(event, robot, truths, truth, time_s, name))
    if last is None:
        return []
    outcomes = last.result.robots
    return [
        Course(
            method,
            path.name,
            robot,
            truth.reference_from_map is not None,
            outcomes[robot].reason.code.value,
            agreement.acceptance if (agreement := outcomes[robot].agreement) else None,
            tuple(moments[robot]),
        )
        for robot, truth in truths.items()
    ]


def _ticks(path: Path, method: str) -> Iterator[Merged]:
    options = RunOptions(runs=(RunPath(None, path),), images="none", merge=MergeConfig(method=method))
    for event in merge(options):
        if isinstance(event, Merged):
            yield event


def _moment(
    event: Merged, robot: str, truths: Mapping[str, RobotTruth], truth: RobotTruth, time_s: float, recording: str
) -> Moment:
    grid = event.result.grids[robot]
    cells = MAX_ERROR_CELLS_BENT if recording in BENT else MAX_ERROR_CELLS
    coarsest_m = max(item.resolution_m for item in event.result.grids.values())
    allowed = Tolerance(cells * coarsest_m)
    pose = event.result.robots[robot].merged_from_map
    if truth.reference_from_map is None:
        return Moment(time_s, 0.0, None if pose is None else PlacementError(np.inf, np.inf), allowed)
    area_m2, centre_m = _shared_with_others(event.result.grids, robot, grid, truths, truth.reference_from_map)
    error = None if pose is None else error_of(pose, truth.reference_from_map, centre_m or truth.at_m)
    return Moment(time_s, area_m2, error, allowed)


def _shared_with_others(
    grids: Mapping[str, Grid], robot: str, grid: Grid, truths: Mapping[str, RobotTruth], reference_from_map: Sim2
) -> tuple[float, tuple[float, float] | None]:
    """Return the area that a map truly shares with all others of its place together, and its middle."""
    points = grid.centres_m(grid.known)
    points = points[:: max(1, len(points) // _MOST_POINTS)]
    in_reference = reference_from_map.apply(points)
    shared = np.zeros(len(points), np.bool_)
    for other, other_grid in grids.items():
        reference_from_other = truths[other].reference_from_map if other in truths else IDENTITY
        if other != robot and reference_from_other is not None:
            shared |= known_at(other_grid, reference_from_other.inverse().apply(in_reference))
    if not shared.any():
        return 0.0, None
    x_m, y_m = points[shared].mean(axis=0).tolist()
    return float(shared.mean()) * grid.known_area_m2, (x_m, y_m)


def last_grids(path: Path) -> dict[str, Grid]:
    """Return the last map of each robot of a recording, the reference first."""
    grids: dict[str, Grid] = {}
    for event in _ticks(path, MergeConfig().method):
        grids = {robot: event.result.grids[robot] for robot in event.result.robots if robot in event.result.grids}
    return grids
