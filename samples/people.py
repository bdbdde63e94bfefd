"""People who walk about while a robot maps: they hide what is behind them, and leave specks."""

from __future__ import annotations

import math

import numpy as np

from mapmerge.sim2 import Points, Sim2
from samples.lidar import Lidar, Ranges
from samples.world import Rng

_BODY_M = 0.17
_STRIDE_M = 0.4
_NEAR_M, _FAR_M = 1.0, 7.0


class Crowd:
    """Some people around a robot; who is left behind turns up again somewhere near it.

    Parameters
    ----------
    count
        How many.
    rng
        Source of chance.
    """

    __slots__ = ("_count", "_rng", "_world_m")

    def __init__(self, count: int, rng: Rng) -> None:
        self._count = count
        self._rng = rng
        self._world_m: Points | None = None

    def hide(self, ranges_m: Ranges, lidar: Lidar, world_from_robot: Sim2) -> Ranges:
        """Return a scan with the people in it, who then walk on."""
        if self._count == 0:
            return ranges_m
        robot_m = self._walk(world_from_robot)
        distance_m = np.hypot(robot_m[:, 0], robot_m[:, 1])
        bearing_rad = np.arctan2(robot_m[:, 1], robot_m[:, 0])
        off_rad = np.abs(np.mod(lidar.angles_rad[None] - bearing_rad[:, None] + math.pi, math.tau) - math.pi)
        stops = np.sin(np.minimum(off_rad, math.pi / 2)) * distance_m[:, None] < _BODY_M
        stops &= off_rad < math.pi / 2
        nearest_m = np.where(stops, distance_m[:, None] - _BODY_M, np.inf).min(axis=0)
        hidden: Ranges = np.minimum(ranges_m, np.maximum(nearest_m, 0.05))
        return hidden

    def _walk(self, world_from_robot: Sim2) -> Points:
        """Move everybody by a stride and return where they are, in the robot's frame."""
        if self._world_m is None:
            self._world_m = world_from_robot.apply(self._around())
        self._world_m = self._world_m + self._rng.normal(0.0, _STRIDE_M, self._world_m.shape)
        robot_m = world_from_robot.inverse().apply(self._world_m)
        gone = np.hypot(robot_m[:, 0], robot_m[:, 1]) > _FAR_M + 1.0
        robot_m[gone] = self._around()[gone]
        self._world_m = world_from_robot.apply(robot_m)
        return robot_m

    def _around(self) -> Points:
        distance_m = self._rng.uniform(_NEAR_M, _FAR_M, self._count)
        bearing_rad = self._rng.uniform(0.0, math.tau, self._count)
        return np.stack([distance_m * np.cos(bearing_rad), distance_m * np.sin(bearing_rad)], axis=1)
