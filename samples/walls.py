"""The walls of rooms as edges: faces with gaps for doors and panes for windows, jambs and leaves of doors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mapmerge.sim2 import Points, Sim2
from samples.world import Box, Door, Edges, Rng, Room, polygon_edges, rectangle

TOUCHING_M = 1e-6

Interval = tuple[float, float]


@dataclass(frozen=True, slots=True)
class WallStyle:
    """What outer walls are made of.

    Parameters
    ----------
    wall_m
        Thickness of all walls.
    window_share
        Share of the outer walls' length that is glass.
    """

    wall_m: float
    window_share: float


def room_walls(
    index: int, rooms: Sequence[Room], doors: Sequence[Door], style: WallStyle, rng: Rng
) -> tuple[Edges, Edges]:
    """Return the solid and the glass edges of one room's four walls, as seen from inside."""
    solid: list[list[float]] = []
    glass: list[list[float]] = []
    for vertical in (True, False):
        for is_high in (False, True):
            side = _Side(rooms[index].box, vertical, is_high)
            gaps = [(door.lo_m, door.hi_m) for door in doors if index in door.rooms and side.has(door)]
            panes = _windows(side, index, rooms, style, rng)
            inner = side.along(-0.5 * style.wall_m)
            solid += [side.edge(piece, style.wall_m) for piece in _left_over(inner, [*gaps, *panes])]
            glass += [side.edge(pane, style.wall_m) for pane in panes]
    return np.reshape(solid, (-1, 4)), np.reshape(glass, (-1, 4))


@dataclass(frozen=True, slots=True)
class _Side:
    """One of the four sides of a room."""

    box: Box
    vertical: bool
    is_high: bool

    @property
    def at_m(self) -> float:
        """Where the wall's centre line is."""
        if self.vertical:
            return self.box.x1_m if self.is_high else self.box.x0_m
        return self.box.y1_m if self.is_high else self.box.y0_m

    def along(self, margin_m: float = 0.0) -> Interval:
        """Return from where to where the side runs."""
        box = self.box.grown(margin_m)
        return (box.y0_m, box.y1_m) if self.vertical else (box.x0_m, box.x1_m)

    def has(self, door: Door) -> bool:
        """Tell whether a door of this room is in this side."""
        return door.vertical == self.vertical and abs(door.at_m - self.at_m) < TOUCHING_M

    def touches(self, other: Box) -> bool:
        """Tell whether the side lies against another room."""
        other_m = _Side(other, self.vertical, not self.is_high).at_m
        return abs(other_m - self.at_m) < TOUCHING_M

    def edge(self, piece: Interval, wall_m: float) -> list[float]:
        """Return the inner face of a piece of this side."""
        face_m = self.at_m + (-0.5 if self.is_high else 0.5) * wall_m
        lo_m, hi_m = piece
        return [face_m, lo_m, face_m, hi_m] if self.vertical else [lo_m, face_m, hi_m, face_m]


def _left_over(whole: Interval, gaps: Sequence[Interval]) -> list[Interval]:
    """Return what is left of an interval without the gaps."""
    pieces: list[Interval] = []
    start = whole[0]
    for lo, hi in sorted(gaps):
        end = min(lo, whole[1])
        if end > start:
            pieces.append((start, end))
        start = max(start, hi)
    if start < whole[1]:
        pieces.append((start, whole[1]))
    return pieces


def _windows(side: _Side, index: int, rooms: Sequence[Room], style: WallStyle, rng: Rng) -> list[Interval]:
    """Return the panes in a side, in the parts of it that no other room lies against."""
    whole = side.along(-0.6)
    neighbours = [room.box for other, room in enumerate(rooms) if other != index and side.touches(room.box)]
    outside = _left_over(whole, [_Side(box, side.vertical, False).along() for box in neighbours])
    panes: list[Interval] = []
    for lo_m, hi_m in outside:
        at_m = lo_m
        while at_m + 0.8 < hi_m:
            length_m = min(float(rng.uniform(0.8, 2.2)), hi_m - at_m)
            if rng.uniform() < style.window_share:
                panes.append((at_m, at_m + length_m))
            at_m += length_m + float(rng.uniform(0.2, 0.9))
    return panes


def door_edges(door: Door, wall_m: float) -> Edges:
    """Return the jambs and the leaf of a door."""
    half_m = 0.5 * wall_m
    jambs = np.array([[along, -half_m, along, half_m] for along in (door.lo_m, door.hi_m)])
    parts = [jambs] if door.leaf_deg is None else [jambs, polygon_edges(_leaf(door, half_m))]
    edges = np.vstack(parts)
    across = edges[:, 1::2] + door.at_m
    columns = (across, edges[:, 0::2]) if door.vertical else (edges[:, 0::2], across)
    return np.stack([columns[0][:, 0], columns[1][:, 0], columns[0][:, 1], columns[1][:, 1]], axis=1)


def _leaf(door: Door, half_wall_m: float) -> Points:
    """Return the corners of the leaf as (along the wall, across it)."""
    turn_rad = math.radians(door.leaf_deg or 0.0)
    width_m = door.hi_m - door.lo_m
    middle = 0.5 * width_m * np.array([math.cos(turn_rad), math.sin(turn_rad)])
    corners = rectangle(width_m, 0.045, Sim2(middle[0], middle[1], turn_rad))
    flip = (1.0 if door.hinge_low else -1.0, 1.0 if door.swings_up else -1.0)
    hinge = (door.lo_m if door.hinge_low else door.hi_m, flip[1] * (half_wall_m - 0.03))
    return corners * flip + hinge
