"""Furniture as a lidar near the floor sees it: legs, feet, and the blocks that reach down.

Every maker returns a `Piece`: convex polygons around its own origin. Its x axis runs along the wall it may stand
against, with the wall towards negative y.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mapmerge.sim2 import Points, Sim2
from samples.world import Box, Rng, Room, disc, rectangle

_TRIES = 25


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """Something that stands on the floor: its polygons, and the size of the area it takes."""

    polygons: tuple[Points, ...]
    length_m: float
    depth_m: float


Maker = Callable[[Rng], Piece]


@dataclass(frozen=True, slots=True)
class Lot:
    """How many of one kind of piece a room gets.

    Parameters
    ----------
    make
        Maker of the piece.
    least, most
        How many, at furniture 1.
    against_wall
        Along a wall, or anywhere.
    any_turn
        Turned at random rather than nearly along the walls.
    in_corner
        Built into a corner, without a gap.
    """

    make: Maker
    least: int
    most: int
    against_wall: bool = True
    any_turn: bool = False
    in_corner: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """A piece where it stands: the middle of its area, and the direction of its own x axis."""

    piece: Piece
    at: Sim2

    @property
    def polygons(self) -> list[Points]:
        """Its polygons on the floor."""
        return [self.at.apply(polygon) for polygon in self.piece.polygons]


def furnish(room: Room, keep_clear: Sequence[Box], amount: float, rng: Rng) -> list[Placed]:
    """Return the furniture of a room, none of it in ``keep_clear``.

    Parameters
    ----------
    room
        With the box between the inner faces of its walls.
    keep_clear
        Where nothing may stand, as in front of doors.
    amount
        Scales how many pieces there are; 0 leaves the room empty.
    rng
        Source of chance.
    """
    gap_m = 1.0 if room.kind == "corridor" else 0.4
    size = float(np.clip(room.box.area_m2 / 22.0, 0.5, 2.5))
    taken = list(keep_clear)
    found: list[Placed] = []
    for lot in FURNISHING.get(room.kind, ()):
        count = round(amount * size * rng.integers(lot.least, lot.most + 1))
        for _ in range(count):
            placed = _place(lot, room.box, taken, gap_m, rng)
            if placed is not None:
                found.append(placed)
    return found


def _place(lot: Lot, inside: Box, taken: list[Box], gap_m: float, rng: Rng) -> Placed | None:
    """Return one piece where it stands, and note its area in ``taken``; None if there is no room."""
    piece = lot.make(rng)
    for _ in range(_TRIES):
        at = _pose(lot, piece, inside, rng)
        corners = rectangle(piece.length_m, piece.depth_m, at)
        (x0_m, y0_m), (x1_m, y1_m) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
        area = Box(x0_m, y0_m, x1_m, y1_m)
        if inside.grown(1e-6).holds(area) and not any(area.overlaps(other) for other in taken):
            taken.append(area.grown(gap_m))
            return Placed(piece, at)
    return None


def _pose(lot: Lot, piece: Piece, inside: Box, rng: Rng) -> Sim2:
    side = int(rng.integers(4))
    turn_rad = side * math.pi / 2
    across = side % 2 == 1
    half_x, half_y = 0.5 * inside.width_m, 0.5 * inside.height_m
    centre = Sim2(inside.x0_m + half_x, inside.y0_m + half_y, turn_rad)
    half_along, half_deep = (half_y, half_x) if across else (half_x, half_y)
    reach_along, reach_deep = half_along - 0.5 * piece.length_m, half_deep - 0.5 * piece.depth_m
    if lot.in_corner:
        return centre @ Sim2(-reach_along, -reach_deep)
    along_m = float(rng.uniform(-1.0, 1.0)) * reach_along
    if lot.against_wall:
        gap_m = float(rng.choice([0.0, 0.0, 0.03, 0.08]))
        return centre @ Sim2(along_m, gap_m - reach_deep)
    turn = float(rng.uniform(-math.pi, math.pi)) if lot.any_turn else float(rng.normal(0.0, 0.04))
    return centre @ Sim2(along_m, float(rng.uniform(-1.0, 1.0)) * reach_deep, turn)


# Pieces


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


def _desk(rng: Rng) -> Piece:
    """Return a desk on legs with its pedestal and a swivel chair in front of it."""
    length_m, depth_m = float(rng.uniform(1.2, 1.8)), float(rng.uniform(0.7, 0.85))
    to_wall_m = -0.5 * 0.7
    parts = [leg + np.array([0.0, to_wall_m]) for leg in _legs(length_m, depth_m, 0.06)]
    if rng.uniform() < 0.75:
        end_m = float(rng.choice([-1.0, 1.0])) * (0.5 * length_m - 0.3)
        parts.append(rectangle(0.42, 0.55, Sim2(end_m, to_wall_m)))
    chair = Sim2(float(rng.uniform(-0.3, 0.3)), 0.5 * depth_m + float(rng.uniform(-0.2, 0.1)), float(rng.uniform(0, 6)))
    return Piece((*parts, *_office_chair(chair)), length_m, depth_m + 0.7)


def _table(rng: Rng) -> Piece:
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


def _round_table(rng: Rng) -> Piece:
    """Return a round table on one foot with a few chairs."""
    parts = [disc(float(rng.uniform(0.2, 0.3)), 0.0, 0.0)]
    start_rad, chairs = float(rng.uniform(0.0, 6.0)), int(rng.integers(2, 5))
    for chair in range(chairs):
        turn_rad = start_rad + chair * math.tau / chairs + float(rng.normal(0.0, 0.2))
        parts += _chair(Sim2(0.75 * math.cos(turn_rad), 0.75 * math.sin(turn_rad), turn_rad))
    return Piece(tuple(parts), 2.0, 2.0)


def _stack(rng: Rng) -> Piece:
    """Return a few boxes put down any way."""
    parts: list[Points] = []
    for _ in range(int(rng.integers(1, 4))):
        length_m, depth_m = rng.uniform(0.25, 0.55, 2).tolist()
        x_m, y_m = rng.uniform(-0.3, 0.3, 2).tolist()
        parts.append(rectangle(length_m, depth_m, Sim2(x_m, y_m, float(rng.uniform(0.0, 3.0)))))
    return Piece(tuple(parts), 1.0, 1.0)


def _chamfer(rng: Rng) -> Piece:
    """Return a corner cut off at an angle."""
    length_m, depth_m = rng.uniform(0.7, 2.0, 2).tolist()
    half = np.array([[-0.5 * length_m, -0.5 * depth_m]])
    corners = half + np.array([[0.0, 0.0], [length_m, 0.0], [0.0, depth_m]])
    return Piece((corners,), length_m, depth_m)


def _curved_counter(rng: Rng) -> Piece:
    """Return a counter bent round a corner, as at a reception."""
    radius_m = float(rng.uniform(1.3, 2.0))
    turn = np.linspace(0.0, math.pi / 2, 9)
    outer = radius_m * np.stack([np.cos(turn), np.sin(turn)], axis=1) - 0.5 * radius_m
    inner = (radius_m - 0.5) * np.stack([np.cos(turn), np.sin(turn)], axis=1) - 0.5 * radius_m
    return Piece((np.vstack([outer, inner[::-1]]),), radius_m, radius_m)


_SHELF = _block((0.8, 3.0), (0.32, 0.42))
_CABINET = _block((0.6, 1.4), (0.42, 0.55))
_LAB_BENCH = _block((1.6, 3.0), (0.7, 0.8))
_COUNTER = _block((1.8, 3.6), (0.6, 0.65))
_SOFA = _block((1.5, 2.2), (0.8, 0.95))
_MACHINE = _block((0.9, 1.8), (0.8, 1.4))
_LOCKER = _block((0.5, 2.0), (0.3, 0.45))
_PILASTER = _block((0.35, 0.6), (0.2, 0.45))
_SHAFT = _block((0.7, 1.7), (0.5, 1.1))
_PILLAR = _block((0.35, 0.5), (0.35, 0.5))
_COLUMN = _round((0.18, 0.3))
_PLANT = _round((0.14, 0.24))
_BIN = _round((0.12, 0.17))
_BED = _block((1.9, 2.1), (0.9, 1.8))
_RACK = _block((2.5, 6.0), (0.8, 1.1))
_PALLET = _block((0.8, 1.2), (0.8, 1.2))
_CORNER_SHAFT = Lot(_SHAFT, 0, 1, in_corner=True)

FURNISHING: Mapping[str, tuple[Lot, ...]] = {
    "corridor": (
        Lot(_PILASTER, 1, 3),
        Lot(_LOCKER, 0, 3),
        Lot(_BIN, 0, 2),
        Lot(_PLANT, 0, 2),
    ),
    "office": (
        _CORNER_SHAFT,
        Lot(_desk, 2, 3),
        Lot(_SHELF, 1, 2),
        Lot(_CABINET, 0, 2),
        Lot(_PLANT, 0, 1),
        Lot(_BIN, 1, 1),
    ),
    "open_office": (
        Lot(_chamfer, 0, 1, in_corner=True),
        Lot(_PILLAR, 0, 1, against_wall=False),
        Lot(_desk, 2, 3),
        Lot(_desk, 1, 2, against_wall=False),
        Lot(_SHELF, 1, 2),
        Lot(_CABINET, 0, 2),
        Lot(_PLANT, 1, 2),
        Lot(_BIN, 1, 2),
    ),
    "meeting": (
        Lot(_chamfer, 0, 1, in_corner=True),
        Lot(_table, 1, 1, against_wall=False),
        Lot(_CABINET, 0, 1),
        Lot(_PLANT, 1, 2),
    ),
    "lab": (
        _CORNER_SHAFT,
        Lot(_LAB_BENCH, 1, 3),
        Lot(_LAB_BENCH, 0, 2, against_wall=False),
        Lot(_COLUMN, 0, 1, against_wall=False),
        Lot(_CABINET, 1, 2),
        Lot(_stack, 0, 1),
        Lot(_BIN, 0, 2),
    ),
    "lounge": (
        Lot(_curved_counter, 0, 1, in_corner=True),
        Lot(_COLUMN, 0, 2, against_wall=False),
        Lot(_SOFA, 1, 2),
        Lot(_round_table, 1, 3, against_wall=False, any_turn=True),
        Lot(_PLANT, 1, 3),
    ),
    "workshop": (
        Lot(_chamfer, 0, 1, in_corner=True),
        Lot(_MACHINE, 1, 3, against_wall=False, any_turn=True),
        Lot(_LAB_BENCH, 1, 2),
        Lot(_SHELF, 1, 2),
        Lot(_stack, 1, 3, against_wall=False, any_turn=True),
        Lot(_PILLAR, 0, 1, against_wall=False),
    ),
    "kitchen": (
        Lot(_COUNTER, 1, 2),
        Lot(_round_table, 1, 1, against_wall=False, any_turn=True),
        Lot(_BIN, 1, 2),
    ),
    "store": (
        Lot(_SHELF, 2, 4),
        Lot(_stack, 1, 3, any_turn=True),
    ),
    "copier": (
        Lot(_MACHINE, 1, 1),
        Lot(_SHELF, 1, 2),
        Lot(_BIN, 1, 1),
    ),
    "bedroom": (
        Lot(_BED, 1, 1),
        Lot(_CABINET, 1, 2),
        Lot(_BIN, 0, 1),
    ),
    "living": (
        Lot(_SOFA, 1, 2),
        Lot(_table, 1, 1, against_wall=False),
        Lot(_SHELF, 1, 2),
        Lot(_round_table, 0, 1, against_wall=False, any_turn=True),
        Lot(_PLANT, 0, 2),
    ),
    "bath": (
        Lot(_COUNTER, 1, 1),
        Lot(_BIN, 0, 1),
    ),
    "hall": (
        Lot(_PILLAR, 0, 1, against_wall=False),
        Lot(_RACK, 0, 2, against_wall=False),
        Lot(_PALLET, 1, 4, against_wall=False, any_turn=True),
        Lot(_stack, 0, 2, against_wall=False, any_turn=True),
        Lot(_MACHINE, 0, 1, against_wall=False, any_turn=True),
        Lot(_COLUMN, 0, 1, against_wall=False),
    ),
}
