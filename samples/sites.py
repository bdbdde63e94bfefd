"""Sites: what of a building stays, and the worlds that robots find when they visit it.

A site is a floor plan. Between two visits furniture is moved and doors are opened and closed. A site may be bent: its
plan along the axes is what robots plan their ways on, and a `Bend` takes plan and ways to where they are.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mapmerge.sim2 import Points, Sim2
from samples.floorplan import FloorStyle, leaf_deg
from samples.furniture import Placed, furnish
from samples.walls import door_edges, room_walls
from samples.world import CLEAR_GLASS, Box, Door, Edges, Rng, Room, World, polygon_edges

OPEN_PLAN = "hall"
_CURVED_EDGE_M = 0.8
_MOVABLE_M2 = 2.6


@dataclass(frozen=True, slots=True)
class Bend:
    """Bends a plan along x: from ``start_m`` on for ``length_m`` the plan turns to the left by ``turn_rad``.

    Parameters
    ----------
    axis_m
        The y that keeps its length.
    start_m, length_m
        Where the bend is. Half of it lies on either side of the edge if it is folded.
    turn_rad
        By how much; 0 bends nothing.
    folded
        A sharp edge between straight walls, rather than an arc.
    """

    axis_m: float = 0.0
    start_m: float = 0.0
    length_m: float = 1.0
    turn_rad: float = 0.0
    folded: bool = False

    def apply(self, points_m: Points) -> Points:
        """Return where points of the plan, shape (N, 2), are on the site."""
        if self.turn_rad == 0.0:
            return points_m
        along = np.clip((points_m[:, 0] - self.start_m) / self.length_m, 0.0, 1.0)
        return self._folded(points_m, along) if self.folded else self._arc(points_m, along)

    def _arc(self, points_m: Points, along: Points) -> Points:
        turn = self.turn_rad * along
        radius_m = self.length_m / self.turn_rad
        before = np.minimum(points_m[:, 0], self.start_m)
        after = np.maximum(points_m[:, 0] - self.start_m - self.length_m, 0.0)
        across = points_m[:, 1] - self.axis_m
        x_m = before + radius_m * np.sin(turn) + after * np.cos(turn) - across * np.sin(turn)
        y_m = radius_m * (1.0 - np.cos(turn)) + after * np.sin(turn) + across * np.cos(turn)
        return np.stack([x_m, y_m + self.axis_m], axis=1)

    def _folded(self, points_m: Points, along: Points) -> Points:
        """Walls along x stay straight on both sides of the edge; those across turn little by little in the bend."""
        edge_m, half_m = self.start_m + 0.5 * self.length_m, 0.5 * self.length_m
        across = points_m[:, 1] - self.axis_m
        before = points_m[:, 0] <= edge_m
        squeeze = across * math.tan(0.5 * self.turn_rad) * 2.0 * np.where(before, along, 1.0 - along)
        from_edge = points_m[:, 0] - edge_m + np.where(before, -squeeze, squeeze) * (half_m > 0.0)
        cos, sin = math.cos(self.turn_rad), math.sin(self.turn_rad)
        x_m = edge_m + np.where(before, from_edge, cos * from_edge - sin * across)
        y_m = self.axis_m + np.where(before, across, sin * from_edge + cos * across)
        return np.stack([x_m, y_m], axis=1)


@dataclass(frozen=True, slots=True)
class Site:
    """A floor plan of some kind.

    Parameters
    ----------
    seed
        Of its windows and its furniture.
    extent, rooms, doors, style
        The plan. There is no wall between two rooms of kind `OPEN_PLAN` that a door joins.
    bend
        Where the plan really is.
    symmetries
        Moves of the plan, besides staying, that put its walls onto its walls, whatever stands in the rooms.
    """

    seed: int
    extent: Box
    rooms: tuple[Room, ...]
    doors: tuple[Door, ...]
    style: FloorStyle
    bend: Bend = Bend()
    symmetries: tuple[Sim2, ...] = ()


@dataclass(frozen=True, slots=True)
class Changes:
    """What differs between two visits of one site.

    Parameters
    ----------
    moved
        Share of the pieces that can be moved and are: a quarter of them taken away, the others pushed aside.
    refurnished
        Share of the rooms that are furnished anew.
    doors
        Share of the doors whose leaf is turned to another angle.
    """

    moved: float = 0.0
    refurnished: float = 0.0
    doors: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Visit:
    """A site as one robot finds it.

    Parameters
    ----------
    plan
        The world before it is bent; ways are found here.
    world
        The world as it is.
    bend
        From one to the other.
    """

    plan: World
    world: World
    bend: Bend


def visited(site: Site, changes: Changes, visit: int) -> Visit:
    """Return the site at a visit; visits with one number find the same."""
    rng = np.random.default_rng([site.seed, 20, visit])
    doors = tuple(
        replace(door, leaf_deg=leaf_deg(rng, spare=False))
        if door.leaf_deg is not None and rng.uniform() < changes.doors
        else door
        for door in site.doors
    )
    walls, panes = _walls(site, doors)
    furniture = [
        polygon_edges(polygon)
        for index, room in enumerate(site.rooms)
        for polygon in _furniture(site, index, room, changes, rng)
    ]
    opaque = np.vstack([walls, *furniture])
    edges = np.vstack([opaque, panes])
    opacity = np.concatenate([np.ones(len(opaque)), np.full(len(panes), CLEAR_GLASS)])
    plan = World(site.extent, site.rooms, doors, edges, opacity)
    return Visit(plan, bent(plan, site.bend), site.bend)


def bent(plan: World, bend: Bend) -> World:
    """Return the world that a bend makes of a plan; its rooms and doors stay those of the plan."""
    if bend.turn_rad == 0.0:
        return plan
    edges_m = plan.edges_m
    lengths_m = np.hypot(edges_m[:, 2] - edges_m[:, 0], edges_m[:, 3] - edges_m[:, 1])
    pieces = np.ceil(lengths_m / _CURVED_EDGE_M).clip(1).astype(np.intp)
    edge = np.repeat(np.arange(len(edges_m)), pieces)
    nth = np.arange(edge.size) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    begin, end = edges_m[edge, :2], edges_m[edge, 2:]
    low, high = (nth / pieces[edge])[:, None], ((nth + 1) / pieces[edge])[:, None]
    ends = [bend.apply(begin + share * (end - begin)) for share in (low, high)]
    return replace(plan, edges_m=np.hstack(ends), opacity=plan.opacity[edge])


def _walls(site: Site, doors: Sequence[Door]) -> tuple[Edges, Edges]:
    rng = np.random.default_rng([site.seed, 21])
    walls = [room_walls(index, site.rooms, doors, site.style.walls, rng) for index in range(len(site.rooms))]
    real = [door for door in doors if not _is_open_plan(site, door)]
    solid = [edges for edges, _ in walls] + [door_edges(door, site.style.wall_m) for door in real]
    return np.vstack(solid), np.vstack([panes for _, panes in walls])


def _is_open_plan(site: Site, door: Door) -> bool:
    return all(site.rooms[index].kind == OPEN_PLAN for index in door.rooms)


def _furniture(site: Site, index: int, room: Room, changes: Changes, rng: Rng) -> list[Points]:
    clear = [door.keep_clear(1.05) for door in site.doors if index in door.rooms and not _is_open_plan(site, door)]
    inside = Room(room.kind, room.box.grown(-0.5 * site.style.wall_m))
    anew = rng.uniform() < changes.refurnished
    stream = rng if anew else np.random.default_rng([site.seed, 22, index])
    polygons: list[Points] = []
    for placed in furnish(inside, clear, site.style.furniture, stream):
        piece = _moved(placed, changes.moved, inside.box, rng)
        polygons += piece.polygons if piece is not None else []
    return polygons


def _moved(placed: Placed, chance: float, inside: Box, rng: Rng) -> Placed | None:
    """Return a piece where the next visitor finds it; None if it is gone."""
    if placed.piece.length_m * placed.piece.depth_m > _MOVABLE_M2 or rng.uniform() >= chance:
        return placed
    if rng.uniform() < 0.25:
        return None
    dx_m, dy_m, turn_rad = rng.normal(0.0, (0.35, 0.35, 0.3)).tolist()
    half_m = 0.5 * math.hypot(placed.piece.length_m, placed.piece.depth_m)
    x_m = min(max(placed.at.x_m + dx_m, inside.x0_m + half_m), max(inside.x1_m - half_m, inside.x0_m + half_m))
    y_m = min(max(placed.at.y_m + dy_m, inside.y0_m + half_m), max(inside.y1_m - half_m, inside.y0_m + half_m))
    return replace(placed, at=Sim2(x_m, y_m, placed.at.yaw_rad + turn_rad))


def reflected(site: Site, *, flip_x: bool, flip_y: bool) -> Site:
    """Return the site mirrored in the middle of its extent; with both flips it is turned by 180°."""
    rooms = tuple(replace(room, box=_flipped(room.box, site.extent, flip_x, flip_y)) for room in site.rooms)
    doors = tuple(_flipped_door(door, site.extent, flip_x, flip_y) for door in site.doors)
    return replace(site, rooms=rooms, doors=doors)


def _flipped(box: Box, extent: Box, flip_x: bool, flip_y: bool) -> Box:
    x_m, y_m = extent.x0_m + extent.x1_m, extent.y0_m + extent.y1_m
    return Box(
        x_m - box.x1_m if flip_x else box.x0_m,
        y_m - box.y1_m if flip_y else box.y0_m,
        x_m - box.x0_m if flip_x else box.x1_m,
        y_m - box.y0_m if flip_y else box.y1_m,
    )


def _flipped_door(door: Door, extent: Box, flip_x: bool, flip_y: bool) -> Door:
    across, along = (flip_x, flip_y) if door.vertical else (flip_y, flip_x)
    x_m, y_m = extent.x0_m + extent.x1_m, extent.y0_m + extent.y1_m
    total_across, total_along = (x_m, y_m) if door.vertical else (y_m, x_m)
    if across:
        low, high = door.rooms
        door = replace(door, rooms=(high, low), at_m=total_across - door.at_m, swings_up=not door.swings_up)
    if along:
        lo_m, hi_m = total_along - door.hi_m, total_along - door.lo_m
        door = replace(door, lo_m=lo_m, hi_m=hi_m, hinge_low=not door.hinge_low)
    return door
