"""What a simulated floor is made of: rooms, doors, and the edges that stop a laser beam."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapmerge.sim2 import Points, Sim2

Edges = NDArray[np.float64]
Rng = np.random.Generator

CLEAR_GLASS = 0.45


@dataclass(frozen=True, slots=True)
class Box:
    """A rectangle along the axes, in metres."""

    x0_m: float
    y0_m: float
    x1_m: float
    y1_m: float

    @property
    def width_m(self) -> float:
        """Length along x."""
        return self.x1_m - self.x0_m

    @property
    def height_m(self) -> float:
        """Length along y."""
        return self.y1_m - self.y0_m

    @property
    def area_m2(self) -> float:
        """Width times height."""
        return self.width_m * self.height_m

    def grown(self, margin_m: float) -> Box:
        """Return the box with every side moved outwards by ``margin_m``, inwards if negative."""
        return Box(self.x0_m - margin_m, self.y0_m - margin_m, self.x1_m + margin_m, self.y1_m + margin_m)

    def overlaps(self, other: Box) -> bool:
        """Tell whether both boxes share some area."""
        return self.x0_m < other.x1_m and other.x0_m < self.x1_m and self.y0_m < other.y1_m and other.y0_m < self.y1_m

    def holds(self, other: Box) -> bool:
        """Tell whether ``other`` lies inside this box."""
        return (
            self.x0_m <= other.x0_m and other.x1_m <= self.x1_m and self.y0_m <= other.y0_m and other.y1_m <= self.y1_m
        )


@dataclass(frozen=True, slots=True)
class Room:
    """A room or a piece of corridor.

    Parameters
    ----------
    kind
        What it is used for: a key of `samples.furniture.FURNISHING`.
    box
        Between the centre lines of its walls.
    """

    kind: str
    box: Box


@dataclass(frozen=True, slots=True)
class Door:
    """An opening in the wall between two rooms.

    Parameters
    ----------
    rooms
        Indices of the two rooms; the second has the higher x or y.
    vertical
        Whether the wall runs along y.
    at_m
        Where the wall's centre line is: x if ``vertical``, else y.
    lo_m, hi_m
        From where to where along the wall the opening is.
    leaf_deg
        How far the leaf is open: 0 is closed, None has no leaf.
    hinge_low, swings_up
        Whether the hinge is at ``lo_m``, and whether the leaf turns into the second room.
    """

    rooms: tuple[int, int]
    vertical: bool
    at_m: float
    lo_m: float
    hi_m: float
    leaf_deg: float | None = None
    hinge_low: bool = True
    swings_up: bool = True

    @property
    def is_closed(self) -> bool:
        """Whether nobody can pass."""
        return self.leaf_deg == 0.0

    @property
    def centre_m(self) -> tuple[float, float]:
        """Middle of the opening."""
        along = 0.5 * (self.lo_m + self.hi_m)
        return (self.at_m, along) if self.vertical else (along, self.at_m)

    def keep_clear(self, depth_m: float) -> Box:
        """Return the area in front of both sides of the opening."""
        if self.vertical:
            return Box(self.at_m - depth_m, self.lo_m - 0.1, self.at_m + depth_m, self.hi_m + 0.1)
        return Box(self.lo_m - 0.1, self.at_m - depth_m, self.hi_m + 0.1, self.at_m + depth_m)


@dataclass(frozen=True, slots=True, eq=False)
class World:
    """A floor as a robot meets it.

    Parameters
    ----------
    extent
        Outline of the floor; everything lies inside.
    rooms, doors
        Where one can be, and pass.
    edges_m
        Shape (N, 4): x0, y0, x1, y1 of what stops a laser beam.
    opacity
        Shape (N,): chance that an edge stops a beam that meets it; 1 for anything but glass.
    """

    extent: Box
    rooms: tuple[Room, ...]
    doors: tuple[Door, ...]
    edges_m: Edges
    opacity: NDArray[np.float64]


def polygon_edges(corners_m: Points) -> Edges:
    """Return the edges of a closed polygon with corners of shape (N, 2)."""
    return np.hstack([corners_m, np.roll(corners_m, -1, axis=0)])


def rectangle(length_m: float, depth_m: float, at: Sim2) -> Points:
    """Return the corners of a rectangle centred on the pose ``at``."""
    half = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]) * (0.5 * length_m, 0.5 * depth_m)
    return at.apply(half)


def disc(radius_m: float, x_m: float, y_m: float) -> Points:
    """Return the corners of a polygon that stands for a disc, finer for larger ones."""
    sides = int(np.clip(math.ceil(radius_m * 60.0), 6, 24))
    turn = np.arange(sides) * (math.tau / sides)
    return np.stack([x_m + radius_m * np.cos(turn), y_m + radius_m * np.sin(turn)], axis=1)
