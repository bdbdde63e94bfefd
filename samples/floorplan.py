"""Random office floors: corridors, rooms that differ in size, doors, windows.

The floor is cut in two again and again. Large parts are cut by a corridor, across their longer side, so that corridors
branch and never line up; smaller parts are cut by walls into rooms. A spanning tree of doors that prefers
corridors makes every room reachable, and a few more doors close loops.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from samples.furniture import furnish
from samples.walls import TOUCHING_M, WallStyle, door_edges, room_walls
from samples.world import CLEAR_GLASS, Box, Door, Rng, Room, World, polygon_edges

CORRIDOR = "corridor"
_NARROWEST_DOORWAY_M = 1.3


@dataclass(frozen=True, slots=True)
class FloorStyle:
    """What kind of floor to make.

    Parameters
    ----------
    width_m, height_m
        Size of the floor.
    wall_m
        Thickness of the walls.
    corridor_area_m2
        A part larger than this gets a corridor through it.
    corridor_width_m, room_area_m2, door_width_m
        Least and largest.
    narrowest_room_m
        No room is cut narrower than this.
    furniture
        How much of it: 0 leaves the rooms empty, 1 is an office in use.
    window_share
        Share of the outer walls' length that is glass.
    """

    width_m: float = 30.0
    height_m: float = 20.0
    wall_m: float = 0.16
    corridor_area_m2: float = 190.0
    corridor_width_m: tuple[float, float] = (1.7, 2.6)
    room_area_m2: tuple[float, float] = (10.0, 42.0)
    door_width_m: tuple[float, float] = (0.85, 1.05)
    narrowest_room_m: float = 2.6
    furniture: float = 1.0
    window_share: float = 0.3

    @property
    def walls(self) -> WallStyle:
        """What the walls are made of."""
        return WallStyle(self.wall_m, self.window_share)


def office_floor(seed: int, style: FloorStyle | None = None) -> World:
    """Return a random floor; the same seed and style give the same floor."""
    style = style or FloorStyle()
    layout, doorways, indoors = (np.random.default_rng([seed, part]) for part in range(3))
    extent = Box(0.0, 0.0, style.width_m, style.height_m)
    rooms = _without_a_corner(split_into_rooms(extent, style, layout), extent, layout)
    doors = choose_doors(rooms, style, doorways)
    return build_world(extent, rooms, doors, style, indoors)


def look_alike_corridor(bays: int, bay_m: float = 4.0, style: FloorStyle | None = None) -> World:
    """Return a straight corridor with equal, empty rooms on both sides: places that nobody can tell apart."""
    style = replace(style or FloorStyle(), furniture=0.0, window_share=0.0)
    depth_m, width_m, door_m = 4.5, 2.0, 0.9
    extent = Box(0.0, 0.0, bays * bay_m, 2.0 * depth_m + width_m)
    rooms = [Room(CORRIDOR, Box(0.0, depth_m, extent.x1_m, depth_m + width_m))]
    doors: list[Door] = []
    for bay in range(bays):
        x0_m, middle_m = bay * bay_m, (bay + 0.5) * bay_m
        for y0_m, at_m in ((0.0, depth_m), (depth_m + width_m, depth_m + width_m)):
            pair = (len(rooms), 0) if y0_m == 0.0 else (0, len(rooms))
            rooms.append(Room("empty", Box(x0_m, y0_m, x0_m + bay_m, y0_m + depth_m)))
            doors.append(Door(pair, False, at_m, middle_m - door_m / 2, middle_m + door_m / 2))
    return build_world(extent, rooms, doors, style, np.random.default_rng(0))


def build_world(extent: Box, rooms: Sequence[Room], doors: Sequence[Door], style: FloorStyle, rng: Rng) -> World:
    """Return the world with these rooms and doors, furnished."""
    walls = [room_walls(index, rooms, doors, style.walls, rng) for index in range(len(rooms))]
    solid = [edges for edges, _ in walls] + [door_edges(door, style.wall_m) for door in doors]
    for index, room in enumerate(rooms):
        clear = [_clear_of(door) for door in doors if index in door.rooms]
        inside = Room(room.kind, room.box.grown(-0.5 * style.wall_m))
        for placed in furnish(inside, clear, style.furniture, rng):
            solid += [polygon_edges(polygon) for polygon in placed.polygons]
    glass = [edges for _, edges in walls]
    opaque, clear_edges = np.vstack(solid), np.vstack(glass)
    opacity = np.concatenate([np.ones(len(opaque)), np.full(len(clear_edges), CLEAR_GLASS)])
    return World(extent, tuple(rooms), tuple(doors), np.vstack([opaque, clear_edges]), opacity)


def _clear_of(door: Door) -> Box:
    is_wide = door.hi_m - door.lo_m > 1.5
    return door.keep_clear(0.35 if is_wide and door.leaf_deg is None else 1.05)


# Rooms


def split_into_rooms(box: Box, style: FloorStyle, rng: Rng) -> list[Room]:
    """Return the rooms and pieces of corridor that a part of a floor is cut into."""
    along_x = box.width_m >= box.height_m
    if box.area_m2 > style.corridor_area_m2:
        width_m = float(rng.uniform(*style.corridor_width_m))
        lower, rest = _cut(box, along_x, float(rng.uniform(0.36, 0.58)))
        corridor, upper = _cut(rest, along_x, width_m / (rest.width_m if along_x else rest.height_m))
        return [Room(CORRIDOR, corridor), *split_into_rooms(lower, style, rng), *split_into_rooms(upper, style, rng)]
    longer_m = max(box.width_m, box.height_m)
    if box.area_m2 <= rng.uniform(*style.room_area_m2) or longer_m < 2.0 * style.narrowest_room_m:
        return [Room(_kind(box, rng), box)]
    edge = style.narrowest_room_m / longer_m
    lower, upper = _cut(box, along_x, float(np.clip(rng.uniform(0.28, 0.72), edge, 1.0 - edge)))
    return [*split_into_rooms(lower, style, rng), *split_into_rooms(upper, style, rng)]


def _cut(box: Box, along_x: bool, share: float) -> tuple[Box, Box]:
    if along_x:
        x_m = box.x0_m + share * box.width_m
        return replace(box, x1_m=x_m), replace(box, x0_m=x_m)
    y_m = box.y0_m + share * box.height_m
    return replace(box, y1_m=y_m), replace(box, y0_m=y_m)


def _kind(box: Box, rng: Rng) -> str:
    if box.area_m2 < 10.0:
        kinds = ["store", "copier", "office", "office"]
    elif box.area_m2 < 20.0:
        kinds = ["office", "office", "office", "meeting", "lab", "workshop", "kitchen"]
    else:
        kinds = ["lab", "open_office", "meeting", "lounge", "workshop"]
    return kinds[int(rng.integers(len(kinds)))]


def _without_a_corner(rooms: list[Room], extent: Box, rng: Rng) -> list[Room]:
    """Leave out one or two rooms at corners of the floor, so that its outline is no rectangle."""

    def is_corner(room: Room) -> bool:
        at_x = room.box.x0_m == extent.x0_m or room.box.x1_m == extent.x1_m
        at_y = room.box.y0_m == extent.y0_m or room.box.y1_m == extent.y1_m
        return at_x and at_y and room.kind != CORRIDOR and room.box.area_m2 < 0.06 * extent.area_m2

    corners = [index for index, room in enumerate(rooms) if is_corner(room)]
    left_out = rng.permutation(corners)[: int(rng.integers(1, 3))].tolist() if corners else []
    return [room for index, room in enumerate(rooms) if index not in left_out]


# Doors


def choose_doors(rooms: Sequence[Room], style: FloorStyle, rng: Rng) -> list[Door]:
    """Return doors that make every room reachable, and a few more."""
    shared = [
        wall
        for low in range(len(rooms))
        for high in range(len(rooms))
        if (wall := _shared_wall(low, high, rooms)) is not None
    ]
    costs = [_corridors_lacking(wall, rooms) + float(rng.uniform(0.0, 0.9)) for wall in shared]
    group = list(range(len(rooms)))
    doors: list[Door] = []
    for place in np.argsort(costs).tolist():
        wall = shared[place]
        low, high = (group[room] for room in wall.rooms)
        corridors = _corridors_lacking(wall, rooms) == 0
        if low != high or corridors:
            group = [low if member == high else member for member in group]
            doors.append(_opening(wall, style, rng) if corridors else _door(wall, style, rng, spare=False))
        elif rng.uniform() < 0.16:
            doors.append(_door(wall, style, rng, spare=True))
    return doors


def _corridors_lacking(wall: Door, rooms: Sequence[Room]) -> int:
    return sum(rooms[index].kind != CORRIDOR for index in wall.rooms)


def _shared_wall(low: int, high: int, rooms: Sequence[Room]) -> Door | None:
    """Return the whole wall between two rooms as one opening, if ``high`` is right of or above ``low``."""
    first, second = rooms[low].box, rooms[high].box
    if abs(first.x1_m - second.x0_m) < TOUCHING_M:
        lo_m, hi_m = max(first.y0_m, second.y0_m), min(first.y1_m, second.y1_m)
        vertical, at_m = True, first.x1_m
    elif abs(first.y1_m - second.y0_m) < TOUCHING_M:
        lo_m, hi_m = max(first.x0_m, second.x0_m), min(first.x1_m, second.x1_m)
        vertical, at_m = False, first.y1_m
    else:
        return None
    if hi_m - lo_m < _NARROWEST_DOORWAY_M:
        return None
    return Door((low, high), vertical, at_m, lo_m, hi_m)


def _opening(wall: Door, style: FloorStyle, rng: Rng) -> Door:
    """Return the passage between two pieces of corridor: all its width, or a little less."""
    slack_m = 0.5 * style.wall_m
    low_m, high_m = rng.uniform(0.0, 0.25, 2).tolist() if rng.uniform() < 0.5 else (0.0, 0.0)
    return replace(wall, lo_m=wall.lo_m + slack_m + low_m, hi_m=wall.hi_m - slack_m - high_m)


def _door(wall: Door, style: FloorStyle, rng: Rng, *, spare: bool) -> Door:
    slack_m = 0.5 * style.wall_m + 0.1
    free_m = wall.hi_m - wall.lo_m - 2.0 * slack_m
    is_wide = free_m > 3.0 and rng.uniform() < 0.14
    width_m = float(rng.uniform(1.8, 2.8)) if is_wide else float(rng.uniform(*style.door_width_m))
    width_m = min(width_m, free_m)
    lo_m = wall.lo_m + slack_m + float(rng.uniform(0.0, free_m - width_m))
    return replace(
        wall,
        lo_m=lo_m,
        hi_m=lo_m + width_m,
        leaf_deg=None if is_wide else leaf_deg(rng, spare=spare),
        hinge_low=bool(rng.uniform() < 0.5),
        swings_up=bool(rng.uniform() < 0.5),
    )


def leaf_deg(rng: Rng, *, spare: bool) -> float | None:
    """Return how far a random door stands open; ``spare`` ones may be closed."""
    chance = float(rng.uniform())
    if spare and chance < 0.5:
        return 0.0
    if chance < 0.62:
        return float(rng.uniform(70.0, 105.0))
    if chance < 0.85:
        return float(rng.uniform(42.0, 58.0))
    return None
