"""Kinds of buildings: a table from a kind's name to what builds a random site of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from mapmerge.sim2 import Sim2
from samples.floorplan import CORRIDOR, FloorStyle, choose_doors, split_into_rooms
from samples.sites import OPEN_PLAN, Bend, Site, reflected
from samples.walls import TOUCHING_M
from samples.world import Box, Door, Rng, Room

Builder = Callable[[int], Site]

_LEAST_CUT_M2 = 9.0
_ROOMS_OF_A_HOME = ("living", "bedroom", "bedroom", "kitchen", "office", "store")


def home(seed: int) -> Site:
    """Return a flat: a few rooms around a hallway."""
    rng = np.random.default_rng([seed, 1])
    style = FloorStyle(
        width_m=float(rng.uniform(9.0, 14.0)),
        height_m=float(rng.uniform(7.5, 11.0)),
        corridor_area_m2=60.0,
        corridor_width_m=(1.1, 1.7),
        room_area_m2=(7.0, 26.0),
        door_width_m=(0.78, 0.95),
        narrowest_room_m=2.0,
        furniture=float(rng.uniform(0.6, 1.0)),
        window_share=float(rng.uniform(0.1, 0.4)),
    )
    rooms = [room if room.kind == CORRIDOR else _of_a_home(room, rng) for room in _split_floor(style, rng)]
    return _with_doors(seed, style, rooms, rng)


def office(seed: int) -> Site:
    """Return an office floor: corridors that branch, rooms that differ."""
    rng = np.random.default_rng([seed, 2])
    style = _office_style(rng, (20.0, 32.0), (13.0, 20.0))
    return _with_doors(seed, style, _split_floor(style, rng), rng)


def corridor(seed: int) -> Site:
    """Return a long corridor with a room in every bay; one in three is bare, and its bays cannot be told apart."""
    rng = np.random.default_rng([seed, 3])
    bays, bay_m = int(rng.integers(7, 14)), float(rng.uniform(3.0, 5.5))
    depth_m, width_m, door_m = float(rng.uniform(3.5, 5.0)), float(rng.uniform(1.8, 2.6)), float(rng.uniform(0.85, 1.0))
    is_bare = bool(rng.uniform() < 1.0 / 3.0)
    extent = Box(0.0, 0.0, bays * bay_m, 2.0 * depth_m + width_m)
    rooms = [Room("empty" if is_bare else CORRIDOR, Box(0.0, depth_m, extent.x1_m, depth_m + width_m))]
    doors: list[Door] = []
    for bay in range(bays):
        lo_m = (bay + 0.5) * bay_m - 0.5 * door_m
        for y0_m, at_m in ((0.0, depth_m), (depth_m + width_m, depth_m + width_m)):
            pair = (len(rooms), 0) if y0_m == 0.0 else (0, len(rooms))
            kind = "empty" if is_bare else str(rng.choice(["office", "office", "meeting", "lab", "empty", "store"]))
            rooms.append(Room(kind, Box(bay * bay_m, y0_m, (bay + 1) * bay_m, y0_m + depth_m)))
            leaf = None if is_bare else _leaf_deg(rng)
            doors.append(Door(pair, False, at_m, lo_m, lo_m + door_m, leaf))
    furniture, window_share = (0.0, 0.0) if is_bare else (0.8, 0.2)
    style = FloorStyle(extent.x1_m, extent.y1_m, furniture=furniture, window_share=window_share)
    shifts = [Sim2(sign * bay * bay_m, 0.0) for bay in range(1, bays) for sign in (-1, 1)]
    turned = Sim2(extent.x1_m, extent.y1_m, math.pi)
    symmetries = (turned, *shifts, *(shift @ turned for shift in shifts))
    return Site(seed, extent, tuple(rooms), tuple(doors), style, symmetries=symmetries)


def _leaf_deg(rng: Rng) -> float | None:
    chance = float(rng.uniform())
    if chance < 0.25:
        return 0.0
    return float(rng.uniform(60.0, 105.0)) if chance < 0.8 else None


def hall(seed: int) -> Site:
    """Return a large hall, full of racks, pallets, boxes and pillars, with a few rooms along one side."""
    rng = np.random.default_rng([seed, 4])
    width_m, height_m = float(rng.uniform(18.0, 30.0)), float(rng.uniform(12.0, 20.0))
    depth_m = float(rng.uniform(3.0, 5.0))
    style = FloorStyle(width_m=width_m, height_m=height_m, furniture=float(rng.uniform(0.5, 0.9)), window_share=0.1)
    cols, tile_rows = round(width_m / 6.0), max(1, round((height_m - depth_m) / 6.0))
    tile_x_m, tile_y_m = width_m / cols, (height_m - depth_m) / tile_rows
    rooms = [
        Room(OPEN_PLAN, Box(col * tile_x_m, row * tile_y_m, (col + 1) * tile_x_m, (row + 1) * tile_y_m))
        for row in range(tile_rows)
        for col in range(cols)
    ]
    doors = [_whole_side(low, high, rooms) for low, high in _neighbours(rooms)]
    side = Box(0.0, tile_rows * tile_y_m, width_m, height_m)
    rooms_beside = split_into_rooms(side, replace(style, corridor_area_m2=1e9), rng)
    first = len(rooms)
    rooms += rooms_beside
    doors += [door for door in choose_doors(rooms, style, rng) if max(door.rooms) >= first]
    return Site(seed, Box(0.0, 0.0, width_m, height_m), tuple(rooms), tuple(doors), style)


def _neighbours(rooms: Sequence[Room]) -> list[tuple[int, int]]:
    """Return the pairs of rooms of which the second lies right of or above the first, side to side."""
    return [
        (low, high)
        for low, one in enumerate(rooms)
        for high, two in enumerate(rooms)
        if (abs(one.box.x1_m - two.box.x0_m) < TOUCHING_M and abs(one.box.y0_m - two.box.y0_m) < TOUCHING_M)
        or (abs(one.box.y1_m - two.box.y0_m) < TOUCHING_M and abs(one.box.x0_m - two.box.x0_m) < TOUCHING_M)
    ]


def _whole_side(low: int, high: int, rooms: Sequence[Room]) -> Door:
    box, other = rooms[low].box, rooms[high].box
    if abs(box.x1_m - other.x0_m) < TOUCHING_M:
        return Door((low, high), True, box.x1_m, box.y0_m, box.y1_m)
    return Door((low, high), False, box.y1_m, box.x0_m, box.x1_m)


def symmetric(seed: int) -> Site:
    """Return a plan that a turn by 180° puts onto itself; furniture breaks the symmetry in two of three."""
    rng = np.random.default_rng([seed, 5])
    half_m, middle_m, height_m = rng.uniform((6.0, 2.2, 8.0), (10.0, 5.0, 14.0)).tolist()
    is_bare = bool(rng.uniform() < 1.0 / 3.0)
    style = FloorStyle(
        width_m=2.0 * half_m + middle_m,
        height_m=height_m,
        furniture=0.0 if is_bare else float(rng.uniform(0.6, 1.0)),
        window_share=0.0,
    )
    extent = Box(0.0, 0.0, style.width_m, height_m)
    left = split_into_rooms(Box(0.0, 0.0, half_m, height_m), style, rng)
    rooms = (Room(CORRIDOR, Box(half_m, 0.0, half_m + middle_m, height_m)), *left)
    half = Site(seed, extent, rooms, tuple(_plain(choose_doors(rooms, style, rng))), style)
    turned = reflected(half, flip_x=True, flip_y=True)
    others = {0: 0} | {index: index + len(left) for index in range(1, len(rooms))}
    doors = [replace(door, rooms=(others[door.rooms[0]], others[door.rooms[1]])) for door in turned.doors]
    both = replace(half, rooms=(*rooms, *turned.rooms[1:]), doors=(*half.doors, *doors))
    return replace(both, symmetries=(Sim2(extent.x1_m, extent.y1_m, math.pi),))


def _plain(doors: Sequence[Door]) -> list[Door]:
    return [replace(door, leaf_deg=None) if door.is_closed else door for door in doors]


def curved(seed: int) -> Site:
    """Return an office floor along an arc: round corridors and walls that stand in a fan."""
    rng = np.random.default_rng([seed, 6])
    style = _office_style(rng, (22.0, 34.0), (10.0, 13.0))
    site = _with_doors(seed, style, _split_floor(style, rng), rng)
    share = float(rng.uniform(0.5, 1.0))
    length_m = share * style.width_m
    most = 0.8 * length_m / (0.5 * style.height_m)
    turn_rad = float(rng.choice([-1.0, 1.0])) * float(rng.uniform(0.35, 0.7)) * most
    return replace(site, bend=Bend(0.5 * style.height_m, 0.5 * (style.width_m - length_m), length_m, turn_rad))


def slanted(seed: int) -> Site:
    """Return two wings of an office that meet at 30 to 60°, with slanted walls between them."""
    rng = np.random.default_rng([seed, 7])
    style = _office_style(rng, (22.0, 34.0), (10.0, 14.0))
    site = _with_doors(seed, style, _split_floor(style, rng), rng)
    turn_rad = float(rng.choice([-1.0, 1.0])) * math.radians(float(rng.choice([30.0, 45.0, 60.0])))
    length_m = float(rng.uniform(0.35, 0.6)) * style.width_m
    length_m = max(length_m, 2.0 * style.height_m * math.tan(0.5 * abs(turn_rad)))
    start_m = float(rng.uniform(0.3, 0.7)) * max(style.width_m - length_m, 0.0)
    return replace(site, bend=Bend(0.5 * style.height_m, start_m, length_m, turn_rad, folded=True))


KINDS: Mapping[str, Builder] = {
    "home": home,
    "office": office,
    "corridor": corridor,
    "hall": hall,
    "symmetric": symmetric,
    "round": curved,
    "slanted": slanted,
}


def altered(site: Site, seed: int, share: float = 0.6) -> Site:
    """Return the next floor: same outline, corridors and doors, a share of the rooms cut in two, other furniture."""
    rng = np.random.default_rng([seed, 8])
    rooms: list[Room] = []
    for room in site.rooms:
        is_kept = room.kind in (CORRIDOR, OPEN_PLAN) or room.box.area_m2 < _LEAST_CUT_M2 or rng.uniform() > share
        rooms += [room] if is_kept else _cut_in_two(room, float(rng.uniform(0.35, 0.65)))
    index_of = {room.box: index for index, room in enumerate(rooms)}
    kept = [
        replace(door, rooms=(index_of[site.rooms[low].box], index_of[site.rooms[high].box]))
        for door in site.doors
        for low, high in [door.rooms]
        if site.rooms[low].box in index_of and site.rooms[high].box in index_of
    ]
    there = {door.rooms for door in kept}
    new = [door for door in choose_doors(rooms, site.style, rng) if door.rooms not in there]
    style = replace(site.style, furniture=max(site.style.furniture, 0.7))
    return replace(site, seed=seed, rooms=tuple(rooms), doors=(*kept, *new), style=style)


def _cut_in_two(room: Room, at: float) -> list[Room]:
    """Return the rooms on both sides of a new wall across a room's longer side."""
    box = room.box
    if box.width_m >= box.height_m:
        middle_m = box.x0_m + at * box.width_m
        parts = (replace(box, x1_m=middle_m), replace(box, x0_m=middle_m))
    else:
        middle_m = box.y0_m + at * box.height_m
        parts = (replace(box, y1_m=middle_m), replace(box, y0_m=middle_m))
    return [replace(room, box=part) for part in parts]


def _office_style(rng: Rng, width_m: tuple[float, float], height_m: tuple[float, float]) -> FloorStyle:
    return FloorStyle(
        width_m=float(rng.uniform(*width_m)),
        height_m=float(rng.uniform(*height_m)),
        furniture=float(rng.uniform(0.5, 1.0)),
        window_share=float(rng.uniform(0.05, 0.4)),
    )


def _split_floor(style: FloorStyle, rng: Rng) -> list[Room]:
    return split_into_rooms(Box(0.0, 0.0, style.width_m, style.height_m), style, rng)


def _of_a_home(room: Room, rng: Rng) -> Room:
    kind = "bath" if room.box.area_m2 < 7.0 else str(rng.choice(_ROOMS_OF_A_HOME))
    return replace(room, kind=kind)


def _with_doors(seed: int, style: FloorStyle, rooms: Sequence[Room], rng: Rng) -> Site:
    extent = Box(0.0, 0.0, style.width_m, style.height_m)
    return Site(seed, extent, tuple(rooms), tuple(choose_doors(rooms, style, rng)), style)
