"""Where one simulated map truly lies on another, and what both know."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mapmerge.sim2 import Points, Sim2
from samples.explorers import Explored, MapOf
from samples.likeness import thinned
from samples.mission import known_at

_NEAR_M = 2.5
_AREA_POINTS, _FIT_POINTS, _POSES = 20_000, 300, 250


@dataclass(frozen=True, slots=True)
class Shared:
    """The truth between two maps.

    Parameters
    ----------
    target_from_source
        Between the map frames. Maps that are bent cannot be put together everywhere: it puts together what both show
        of the places that both know, in the sense of least squares.
    overlap
        Area that both maps know, as a share of the smaller one's.
    overlap_m2
        That area.
    centre_m
        Middle of that area in the source's map frame.
    bend_m
        How far apart both maps then show one place, root mean square.
    """

    target_from_source: Sim2
    overlap: float
    overlap_m2: float
    centre_m: tuple[float, float]
    bend_m: float


def target_from_source(target: Explored, source: Explored, move: Sim2 | None = None) -> Sim2:
    """Return where a source would lie if neither map were bent; if the site were moved first, where a ``move`` is."""
    target_from_world = target.published_from_map @ target.run.world_from_map.inverse()
    world_from_source = source.run.world_from_map @ source.published_from_map.inverse()
    return target_from_world @ (move or Sim2()) @ world_from_source


def shared(target: Explored, target_map: MapOf, source: Explored, source_map: MapOf) -> Shared | None:
    """Return the truth between two robots' maps of one site; None if they have nothing in common."""
    grid = source_map.grid
    centres_m = thinned(grid.centres_m(grid.known), _AREA_POINTS)
    both_m = centres_m[known_at(target_map.grid, target_from_source(target, source).apply(centres_m))]
    smaller_m2 = min(target_map.grid.known_area_m2, grid.known_area_m2)
    if len(both_m) == 0 or smaller_m2 <= 0.0:
        return None
    world_from_source = source.run.world_from_map @ source.published_from_map.inverse()
    world_m = world_from_source.apply(thinned(both_m, _FIT_POINTS))
    on_target, on_source = _shown(target, target_map, world_m), _shown(source, source_map, world_m)
    fitted = _fitted(on_target, on_source)
    overlap_m2 = grid.known_area_m2 * len(both_m) / len(centres_m)
    x_m, y_m = both_m.mean(axis=0).tolist()
    off_m = np.hypot(*(fitted.apply(on_source) - on_target).T)
    bend_m = float(np.sqrt(np.mean(off_m**2)))
    return Shared(fitted, min(1.0, overlap_m2 / smaller_m2), overlap_m2, (x_m, y_m), bend_m)


def _shown(robot: Explored, robot_map: MapOf, world_m: Points) -> Points:
    """Return where a robot's map shows places of the world: the mean over its poses nearby, until then."""
    run = robot.run
    until = max(1, sum(stamp_s <= robot_map.time_s for stamp_s, _ in run.poses))
    every = np.s_[: until : max(1, until // _POSES)]
    true_poses = run.world_from_robot[every]
    moves = [
        robot.published_from_map @ map_from_robot @ true_pose.inverse()
        for (_, map_from_robot), true_pose in zip(run.poses[every], true_poses, strict=True)
    ]
    at_m = np.array([(pose.x_m, pose.y_m) for pose in true_poses])
    away_m = np.hypot(*(world_m[:, None] - at_m[None]).transpose(2, 0, 1))
    weight = np.exp(-0.5 * ((away_m - away_m.min(axis=1, keepdims=True)) / _NEAR_M) ** 2)
    weight /= weight.sum(axis=1, keepdims=True)
    matrices = (weight @ np.array([move.matrix[:2].ravel() for move in moves])).reshape(-1, 2, 3)
    places = np.hstack([world_m, np.ones((len(world_m), 1))])
    shown: Points = np.einsum("nij,nj->ni", matrices, places)
    return shown


def _fitted(target_m: Points, source_m: Points) -> Sim2:
    """Return the rigid transform that takes source points to target points best."""
    target_mean, source_mean = target_m.mean(axis=0), source_m.mean(axis=0)
    target, source = target_m - target_mean, source_m - source_mean
    across = float(np.sum(source[:, 0] * target[:, 1] - source[:, 1] * target[:, 0]))
    turn = Sim2(yaw_rad=math.atan2(across, float(np.sum(source * target))))
    x_m, y_m = turn.apply_point(float(source_mean[0]), float(source_mean[1]))
    return Sim2(float(target_mean[0]) - x_m, float(target_mean[1]) - y_m, turn.yaw_rad)
