"""Pieces of furniture as a lidar near the floor sees them: legs, feet, and the blocks that reach down.

Every maker returns a `Piece`: convex polygons around its own origin. Its x axis runs along the wall it may stand
against, with the wall towards negative y.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from mapmerge.sim2 import Points, Sim2
from samples.world import Rng, disc, rectangle


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """Something that stands on the floor: its polygons, and the size of the area it takes."""

    polygons: tuple[Points, ...]
    length_m: float
    depth_m: float


Maker = Callable[[Rng], Piece]


def _block(length_m: tuple[float, float], depth_m: tuple[float, float]) -> Maker:
    def make(rng: Rng) -> Piece:
        length, depth = float(rng.uniform(*length_m)), float(rng.uniform(*depth_m))
        return Piece((rectangle(length, depth, Sim2()),), length, depth)

    return make


def _round(radius_m: tuple[float, float]) -> Maker:
    def make(rng: Rng) -> Piece:
        radius = float(rng.uniform(*radius_m))
        return Piece((disc(radius, 0.0, 0.0),), 2.0 * radius, 2.0 * radius)

    return make


def _legs(length_m: float, depth_m: float, leg_m: float) -> Iterator[Points]:
    for x_m in (-0.5 * length_m + leg_m, 0.5 * length_m - leg_m):
        for y_m in (-0.5 * depth_m + leg_m, 0.5 * depth_m - leg_m):
            yield rectangle(leg_m, leg_m, Sim2(x_m, y_m))


def _office_chair(at: Sim2) -> Iterator[Points]:
    """Yield the column and the five castors of a swivel chair."""
    yield disc(0.04, at.x_m, at.y_m)
    for castor in range(5):
        turn_rad = at.yaw_rad + castor * math.tau / 5
        yield disc(0.035, at.x_m + 0.27 * math.cos(turn_rad), at.y_m + 0.27 * math.sin(turn_rad))


def _chair(at: Sim2) -> Iterator[Points]:
    """Yield the four legs of a chair."""
    for corner in rectangle(0.4, 0.4, at):
        yield rectangle(0.035, 0.035, Sim2(corner[0], corner[1], at.yaw_rad))


def desk(rng: Rng) -> Piece:
    """Return a desk on legs with its pedestal and a swivel chair in front of it."""
    length_m, depth_m = float(rng.uniform(1.2, 1.8)), float(rng.uniform(0.7, 0.85))
    to_wall_m = -0.5 * 0.7
    parts = [leg + np.array([0.0, to_wall_m]) for leg in _legs(length_m, depth_m, 0.06)]
    if rng.uniform() < 0.75:
        end_m = float(rng.choice([-1.0, 1.0])) * (0.5 * length_m - 0.3)
        parts.append(rectangle(0.42, 0.55, Sim2(end_m, to_wall_m)))
    chair = Sim2(float(rng.uniform(-0.3, 0.3)), 0.5 * depth_m + float(rng.uniform(-0.2, 0.1)), float(rng.uniform(0, 6)))
    return Piece((*parts, *_office_chair(chair)), length_m, depth_m + 0.7)


def table(rng: Rng) -> Piece:
    """Return a long table with chairs along both sides, none of them quite in its place."""
    length_m, depth_m = float(rng.uniform(1.6, 3.6)), float(rng.uniform(0.9, 1.2))
    parts = list(_legs(length_m, depth_m, 0.08))
    seats = int(length_m / 0.75)
    for seat in range(2 * seats):
        if rng.uniform() < 0.2:
            continue
        side = 1.0 if seat % 2 else -1.0
        x_m = ((seat // 2 + 0.5) / seats - 0.5) * length_m + float(rng.normal(0.0, 0.08))
        y_m = side * (0.5 * depth_m + float(rng.uniform(0.0, 0.3)))
        parts += _chair(Sim2(x_m, y_m, float(rng.normal(0.0, 0.25))))
    return Piece(tuple(parts), length_m + 0.3, depth_m + 1.1)


def round_table(rng: Rng) -> Piece:
    """Return a round table on one foot with a few chairs."""
    parts = [disc(float(rng.uniform(0.2, 0.3)), 0.0, 0.0)]
    start_rad, chairs = float(rng.uniform(0.0, 6.0)), int(rng.integers(2, 5))
    for chair in range(chairs):
        turn_rad = start_rad + chair * math.tau / chairs + float(rng.normal(0.0, 0.2))
        parts += _chair(Sim2(0.75 * math.cos(turn_rad), 0.75 * math.sin(turn_rad), turn_rad))
    return Piece(tuple(parts), 2.0, 2.0)


def stack(rng: Rng) -> Piece:
    """Return a few boxes put down any way."""
    parts: list[Points] = []
    for _ in range(int(rng.integers(1, 4))):
        length_m, depth_m = rng.uniform(0.25, 0.55, 2).tolist()
        x_m, y_m = rng.uniform(-0.3, 0.3, 2).tolist()
        parts.append(rectangle(length_m, depth_m, Sim2(x_m, y_m, float(rng.uniform(0.0, 3.0)))))
    return Piece(tuple(parts), 1.0, 1.0)


def chamfer(rng: Rng) -> Piece:
    """Return a corner cut off at an angle."""
    length_m, depth_m = rng.uniform(0.7, 2.0, 2).tolist()
    half = np.array([[-0.5 * length_m, -0.5 * depth_m]])
    corners = half + np.array([[0.0, 0.0], [length_m, 0.0], [0.0, depth_m]])
    return Piece((corners,), length_m, depth_m)


def curved_counter(rng: Rng) -> Piece:
    """Return a counter bent round a corner, as at a reception."""
    radius_m = float(rng.uniform(1.3, 2.0))
    turn = np.linspace(0.0, math.pi / 2, 9)
    outer = radius_m * np.stack([np.cos(turn), np.sin(turn)], axis=1) - 0.5 * radius_m
    inner = (radius_m - 0.5) * np.stack([np.cos(turn), np.sin(turn)], axis=1) - 0.5 * radius_m
    return Piece((np.vstack([outer, inner[::-1]]),), radius_m, radius_m)


SHELF = _block((0.8, 3.0), (0.32, 0.42))
CABINET = _block((0.6, 1.4), (0.42, 0.55))
LAB_BENCH = _block((1.6, 3.0), (0.7, 0.8))
COUNTER = _block((1.8, 3.6), (0.6, 0.65))
SOFA = _block((1.5, 2.2), (0.8, 0.95))
MACHINE = _block((0.9, 1.8), (0.8, 1.4))
LOCKER = _block((0.5, 2.0), (0.3, 0.45))
PILASTER = _block((0.35, 0.6), (0.2, 0.45))
SHAFT = _block((0.7, 1.7), (0.5, 1.1))
PILLAR = _block((0.35, 0.5), (0.35, 0.5))
COLUMN = _round((0.18, 0.3))
PLANT = _round((0.14, 0.24))
BIN = _round((0.12, 0.17))
BED = _block((1.9, 2.1), (0.9, 1.8))
RACK = _block((2.5, 6.0), (0.8, 1.1))
PALLET = _block((0.8, 1.2), (0.8, 1.2))
