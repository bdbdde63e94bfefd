"""One robot's run through a world, and the truth between the maps of two."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from mapmerge.grid import Grid, Mask
from mapmerge.sim2 import Points, Sim2, wrap_angle
from samples.drive import Pace
from samples.lidar import Lidar, beam_ends
from samples.mapping import Mapper, SensorModel
from samples.people import Crowd
from samples.slam import Drift, Warp
from samples.world import Rng, World


@dataclass(frozen=True, slots=True)
class Robot:
    """What a robot sees with, drives like and maps like.

    Parameters
    ----------
    lidar, pace, model, drift, warp
        Its scanner, its speed, its way of mapping, its errors.
    scan_every_m, scan_every_rad
        A scan goes into the map once the robot has moved or turned this far since the last one.
    people
        How many walk about around it.
    """

    lidar: Lidar = field(default_factory=Lidar)
    pace: Pace = field(default_factory=Pace)
    model: SensorModel = field(default_factory=SensorModel)
    drift: Drift = field(default_factory=Drift)
    warp: Warp = field(default_factory=Warp)
    scan_every_m: float = 0.3
    scan_every_rad: float = 0.5
    people: int = 0

    def is_due(self, now: Sim2, last: Sim2 | None) -> bool:
        """Tell whether to map a scan at a pose, given the pose of the last one that was."""
        if last is None or math.hypot(now.x_m - last.x_m, now.y_m - last.y_m) >= self.scan_every_m:
            return True
        return abs(wrap_angle(now.yaw_rad - last.yaw_rad)) >= self.scan_every_rad


@dataclass(frozen=True, slots=True, eq=False)
class Snapshot:
    """The map as it was at a time after the start."""

    time_s: float
    grid: Grid


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """What came of one drive with one map.

    Parameters
    ----------
    world_from_map
        The truth: the robot's first pose is the origin of its map.
    snapshots
        The growing map.
    poses
        Estimated pose in the map frame at times after the start.
    duration_s
        Time of the last pose.
    world_from_robot
        True pose at each of the times of ``poses``.
    """

    world_from_map: Sim2
    snapshots: tuple[Snapshot, ...]
    poses: tuple[tuple[float, Sim2], ...]
    duration_s: float
    world_from_robot: tuple[Sim2, ...]


def explore(world: World, world_from_robot: Sequence[Sim2], robot: Robot, maps: int, rng: Rng) -> Run:
    """Return the run of a robot that maps while it drives.

    Parameters
    ----------
    world
        What it drives through.
    world_from_robot
        True poses, one per period of ``robot.pace``.
    robot
        What it is like.
    maps
        How many snapshots of the map to take; the last at the end.
    rng
        Source of chance.
    """
    world_from_map = world_from_robot[0]
    map_from_start = robot.warp.apply(world_from_map).inverse()
    period_s = robot.pace.period_s
    due = _snapshot_ticks(len(world_from_robot), maps, rng)
    mapper = Mapper(robot.model)
    snapshots: list[Snapshot] = []
    poses: list[tuple[float, Sim2]] = []
    mapped: Sim2 | None = None
    crowd = Crowd(robot.people, rng)
    errors = robot.drift.errors(len(world_from_robot), period_s, rng)
    for tick, (true_pose, error) in enumerate(zip(world_from_robot, errors, strict=True)):
        map_from_robot = map_from_start @ robot.warp.apply(true_pose) @ error
        poses.append((tick * period_s, map_from_robot))
        if robot.is_due(true_pose, mapped):
            mapped = true_pose
            ranges_m = crowd.hide(robot.lidar.scan(world, true_pose, rng), robot.lidar, true_pose)
            back = np.isfinite(ranges_m)
            ends_m = beam_ends(ranges_m[back], robot.lidar.angles_rad[back], map_from_robot)
            mapper.add((map_from_robot.x_m, map_from_robot.y_m), ends_m)
        if tick in due:
            snapshots.append(Snapshot(tick * period_s, mapper.grid()))
    duration_s = (len(world_from_robot) - 1) * period_s
    return Run(world_from_map, tuple(snapshots), tuple(poses), duration_s, tuple(world_from_robot))


def _snapshot_ticks(ticks: int, maps: int, rng: Rng) -> set[int]:
    """Return when to take snapshots: soon after the start, then not quite evenly, the last at the end."""
    shares = np.linspace(0.04, 1.0, maps)[:-1] + rng.uniform(-0.2, 0.2, maps - 1) / maps
    return {*(int(max(share, 0.02) * ticks) for share in shares), ticks - 1}


@dataclass(frozen=True, slots=True)
class Truth:
    """What is known of two maps because both were simulated.

    Parameters
    ----------
    ref_from_map
        The transform to find.
    overlap
        Area that both maps know, as a share of the smaller one's.
    centre_m
        Middle of that area in the map's own frame; None without overlap.
    """

    ref_from_map: Sim2
    overlap: float
    centre_m: tuple[float, float] | None


def truth(reference: Run, other: Run) -> Truth:
    """Return the truth between the frames of two runs' maps, and the overlap of their last maps."""
    ref_from_map = reference.world_from_map.inverse() @ other.world_from_map
    ref, grid = reference.snapshots[-1].grid, other.snapshots[-1].grid
    centres_m = grid.centres_m(grid.known)
    both = known_at(ref, ref_from_map.apply(centres_m))
    smaller = min(ref.known_area_m2, grid.known_area_m2)
    overlap = int(both.sum()) * grid.resolution_m**2 / smaller if smaller > 0.0 else 0.0
    if not both.any():
        return Truth(ref_from_map, 0.0, None)
    x_m, y_m = centres_m[both].mean(axis=0).tolist()
    return Truth(ref_from_map, overlap, (x_m, y_m))


def known_at(grid: Grid, points_m: Points) -> Mask:
    """Tell for points of the map frame, shape (N, 2), which lie in known cells."""
    cells = np.floor(grid.map_from_grid.inverse().apply(points_m) / grid.resolution_m).astype(np.intp)
    inside = ((cells >= 0) & (cells < (grid.cols, grid.rows))).all(axis=1)
    known = np.zeros(len(cells), np.bool_)
    known[inside] = grid.known[cells[inside, 1], cells[inside, 0]]
    return known


def truth_record(found: Truth) -> dict[str, object]:
    """Return the truth as it is written beside a recording."""
    centre = None if found.centre_m is None else [round(value, 3) for value in found.centre_m]
    pose = found.ref_from_map
    return {
        "same_place": found.overlap > 0.0,
        "overlap": round(found.overlap, 3),
        "overlap_centre_m": centre,
        "x_m": pose.x_m,
        "y_m": pose.y_m,
        "yaw_rad": pose.yaw_rad,
    }
