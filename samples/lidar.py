"""A planar laser scanner."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapmerge.sim2 import Points, Sim2
from samples.world import Edges, Rng, World

Ranges = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Lidar:
    """A scanner on the robot's axis, looking forwards.

    Parameters
    ----------
    beams_per_turn
        Angular resolution; 360 is a degree.
    field_rad
        Field of view, centred on the robot's x axis.
    max_range_m
        Nothing beyond is seen.
    noise_m
        Standard deviation of a range.
    dropout
        Share of beams that return nothing, at random.
    """

    beams_per_turn: int = 480
    field_rad: float = math.tau
    max_range_m: float = 10.0
    noise_m: float = 0.02
    dropout: float = 0.005

    @property
    def angles_rad(self) -> NDArray[np.float64]:
        """Directions of the beams in the robot's frame, ascending."""
        step_rad = math.tau / self.beams_per_turn
        beams = min(int(self.field_rad / step_rad + 1e-9), self.beams_per_turn)
        angles: NDArray[np.float64] = (np.arange(beams, dtype=np.float64) - 0.5 * (beams - 1)) * step_rad
        return angles

    def scan(self, world: World, world_from_robot: Sim2, rng: Rng) -> Ranges:
        """Return the range of every beam in metres; infinite where nothing came back."""
        angles_rad = self.angles_rad
        start_rad = world_from_robot.yaw_rad + float(angles_rad[0])
        ranges = self._cast(world, (world_from_robot.x_m, world_from_robot.y_m), start_rad, rng)
        ranges = ranges[: angles_rad.size] + rng.normal(0.0, self.noise_m, angles_rad.size)
        lost = (ranges > self.max_range_m) | (rng.uniform(size=ranges.size) < self.dropout)
        return np.where(lost, np.inf, np.maximum(ranges, 0.01))

    def _cast(self, world: World, at_m: tuple[float, float], start_rad: float, rng: Rng) -> Ranges:
        """Return the distances to the nearest edge for a full turn of beams that begins at ``start_rad``.

        Only the beams that can meet an edge are intersected with it, which is far fewer than all.
        """
        edges, opacity = _near(world, at_m, self.max_range_m)
        step_rad = math.tau / self.beams_per_turn
        low_rad, span_rad = _bearings(edges)
        first = np.ceil(np.mod(low_rad - start_rad, math.tau) / step_rad)
        last = np.floor((np.mod(low_rad - start_rad, math.tau) + span_rad) / step_rad)
        count = np.maximum(last - first + 1, 0).astype(np.intp)
        edge = np.repeat(np.arange(len(edges)), count)
        nth = np.arange(edge.size) - np.repeat(np.cumsum(count) - count, count)
        beam = (first.astype(np.intp)[edge] + nth) % self.beams_per_turn
        distance = _distances(edges[edge], start_rad + beam * step_rad)
        distance[rng.uniform(size=edge.size) >= opacity[edge]] = np.inf
        ranges = np.full(self.beams_per_turn, np.inf)
        np.minimum.at(ranges, beam, distance)
        return ranges


def beam_ends(ranges_m: Ranges, angles_rad: NDArray[np.float64], map_from_robot: Sim2) -> Points:
    """Return where the beams end, shape (N, 2), in the map frame; ranges must be finite."""
    points = ranges_m[:, None] * np.stack([np.cos(angles_rad), np.sin(angles_rad)], axis=1)
    return map_from_robot.apply(points)


def _near(world: World, at_m: tuple[float, float], reach_m: float) -> tuple[Edges, NDArray[np.float64]]:
    """Return the edges that may be within reach, relative to the position, and their opacity."""
    edges = world.edges_m - np.array([*at_m, *at_m])
    lowest = np.minimum(edges[:, :2], edges[:, 2:])
    highest = np.maximum(edges[:, :2], edges[:, 2:])
    near = ((lowest < reach_m) & (highest > -reach_m)).all(axis=1)
    return edges[near], world.opacity[near]


def _bearings(edges: Edges) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the direction of the clockwise end of every edge, and the angle to its other end, seen from (0, 0)."""
    one = np.arctan2(edges[:, 1], edges[:, 0])
    other = np.arctan2(edges[:, 3], edges[:, 2])
    turn = np.mod(other - one + math.pi, math.tau) - math.pi
    return np.where(turn >= 0.0, one, other), np.abs(turn)


def _distances(edges: Edges, beams_rad: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how far along its beam every edge lies; beam n is paired with edge n and meets it."""
    along = edges[:, 2:] - edges[:, :2]
    direction = np.stack([np.cos(beams_rad), np.sin(beams_rad)], axis=1)
    across = direction[:, 0] * along[:, 1] - direction[:, 1] * along[:, 0]
    moment = edges[:, 0] * along[:, 1] - edges[:, 1] * along[:, 0]
    parallel = np.abs(across) < 1e-12
    return np.where(parallel, np.inf, moment / np.where(parallel, 1.0, across))
