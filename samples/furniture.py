"""Furniture: which pieces a room of a kind gets, and where they stand."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mapmerge.sim2 import Points, Sim2
from samples.pieces import (
    BED,
    BIN,
    CABINET,
    COLUMN,
    COUNTER,
    LAB_BENCH,
    LOCKER,
    MACHINE,
    PALLET,
    PILASTER,
    PILLAR,
    PLANT,
    RACK,
    SHAFT,
    SHELF,
    SOFA,
    Maker,
    Piece,
    chamfer,
    curved_counter,
    desk,
    round_table,
    stack,
    table,
)
from samples.world import Box, Rng, Room, rectangle

_TRIES = 25


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


_CORNER_SHAFT = Lot(SHAFT, 0, 1, in_corner=True)


FURNISHING: Mapping[str, tuple[Lot, ...]] = {
    "corridor": (
        Lot(PILASTER, 1, 3),
        Lot(LOCKER, 0, 3),
        Lot(BIN, 0, 2),
        Lot(PLANT, 0, 2),
    ),
    "office": (
        _CORNER_SHAFT,
        Lot(desk, 2, 3),
        Lot(SHELF, 1, 2),
        Lot(CABINET, 0, 2),
        Lot(PLANT, 0, 1),
        Lot(BIN, 1, 1),
    ),
    "open_office": (
        Lot(chamfer, 0, 1, in_corner=True),
        Lot(PILLAR, 0, 1, against_wall=False),
        Lot(desk, 2, 3),
        Lot(desk, 1, 2, against_wall=False),
        Lot(SHELF, 1, 2),
        Lot(CABINET, 0, 2),
        Lot(PLANT, 1, 2),
        Lot(BIN, 1, 2),
    ),
    "meeting": (
        Lot(chamfer, 0, 1, in_corner=True),
        Lot(table, 1, 1, against_wall=False),
        Lot(CABINET, 0, 1),
        Lot(PLANT, 1, 2),
    ),
    "lab": (
        _CORNER_SHAFT,
        Lot(LAB_BENCH, 1, 3),
        Lot(LAB_BENCH, 0, 2, against_wall=False),
        Lot(COLUMN, 0, 1, against_wall=False),
        Lot(CABINET, 1, 2),
        Lot(stack, 0, 1),
        Lot(BIN, 0, 2),
    ),
    "lounge": (
        Lot(curved_counter, 0, 1, in_corner=True),
        Lot(COLUMN, 0, 2, against_wall=False),
        Lot(SOFA, 1, 2),
        Lot(round_table, 1, 3, against_wall=False, any_turn=True),
        Lot(PLANT, 1, 3),
    ),
    "workshop": (
        Lot(chamfer, 0, 1, in_corner=True),
        Lot(MACHINE, 1, 3, against_wall=False, any_turn=True),
        Lot(LAB_BENCH, 1, 2),
        Lot(SHELF, 1, 2),
        Lot(stack, 1, 3, against_wall=False, any_turn=True),
        Lot(PILLAR, 0, 1, against_wall=False),
    ),
    "kitchen": (
        Lot(COUNTER, 1, 2),
        Lot(round_table, 1, 1, against_wall=False, any_turn=True),
        Lot(BIN, 1, 2),
    ),
    "store": (
        Lot(SHELF, 2, 4),
        Lot(stack, 1, 3, any_turn=True),
    ),
    "copier": (
        Lot(MACHINE, 1, 1),
        Lot(SHELF, 1, 2),
        Lot(BIN, 1, 1),
    ),
    "bedroom": (
        Lot(BED, 1, 1),
        Lot(CABINET, 1, 2),
        Lot(BIN, 0, 1),
    ),
    "living": (
        Lot(SOFA, 1, 2),
        Lot(table, 1, 1, against_wall=False),
        Lot(SHELF, 1, 2),
        Lot(round_table, 0, 1, against_wall=False, any_turn=True),
        Lot(PLANT, 0, 2),
    ),
    "bath": (
        Lot(COUNTER, 1, 1),
        Lot(BIN, 0, 1),
    ),
    "hall": (
        Lot(PILLAR, 0, 1, against_wall=False),
        Lot(RACK, 0, 2, against_wall=False),
        Lot(PALLET, 1, 4, against_wall=False, any_turn=True),
        Lot(stack, 0, 2, against_wall=False, any_turn=True),
        Lot(MACHINE, 0, 1, against_wall=False, any_turn=True),
        Lot(COLUMN, 0, 1, against_wall=False),
    ),
}
