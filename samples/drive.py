"""Where robots drive: stops in the rooms, tours that visit them, ways around the furniture, poses along the way."""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmerge.sim2 import Points, Sim2, wrap_angle
from samples.world import World

Raster = NDArray[np.float64]
Cell = tuple[int, int]

_STEPS = [(dr, dc, math.hypot(dr, dc)) for dr in (-1, 0, 1) for dc in (-1, 0, 1) if (dr, dc) != (0, 0)]


@dataclass(frozen=True, slots=True, eq=False)
class Terrain:
    """How far every spot of a floor is from the next obstacle, on a raster.

    Parameters
    ----------
    clearance_m
        Shape (rows, columns): distance to the nearest edge; 0 where the robot cannot get.
    cell_m
        Side of a raster cell; cell (0, 0) begins at the floor's lower left corner.
    """

    clearance_m: Raster
    cell_m: float

    def cell(self, point_m: tuple[float, float]) -> Cell:
        """Return the raster cell (row, column) of a point."""
        rows, cols = self.clearance_m.shape
        row, col = int(point_m[1] / self.cell_m), int(point_m[0] / self.cell_m)
        return min(max(row, 0), rows - 1), min(max(col, 0), cols - 1)

    def centre_m(self, cell: Cell) -> tuple[float, float]:
        """Return the middle of a raster cell."""
        return (cell[1] + 0.5) * self.cell_m, (cell[0] + 0.5) * self.cell_m


def survey(world: World, robot_radius_m: float = 0.22, cell_m: float = 0.1) -> Terrain:
    """Return where a robot can be: the largest connected area with enough clearance."""
    fine = 5
    size = (math.ceil(world.extent.y1_m / cell_m), math.ceil(world.extent.x1_m / cell_m))
    raster = np.full((size[0] * fine, size[1] * fine), 255, np.uint8)
    ends = np.rint(world.edges_m.reshape(-1, 2, 2) * (fine / cell_m)).astype(np.int32)
    cv2.polylines(raster, list(ends), isClosed=False, color=0)
    distance = cv2.distanceTransform(raster, cv2.DIST_L2, 5)[fine // 2 :: fine, fine // 2 :: fine]
    clearance = distance.astype(np.float64) * (cell_m / fine)
    free = (clearance > robot_radius_m).astype(np.uint8)
    labels = cv2.connectedComponents(free, connectivity=4)[1].astype(np.int32)
    inside = _inside(world, labels, Terrain(clearance, cell_m))
    return Terrain(np.where(labels == inside, clearance, 0.0), cell_m)


def _inside(world: World, labels: NDArray[np.int32], terrain: Terrain) -> int:
    """Return the label of the area that covers most of the rooms; what lies outside the walls is no room."""
    votes = np.zeros(int(labels.max()) + 1, np.intp)
    for room in range(len(world.rooms)):
        rows, cols = _room_slices(world, room, terrain)
        votes += np.bincount(labels[rows, cols].ravel(), minlength=votes.size)
    votes[0] = 0
    return int(votes.argmax())


def _room_slices(world: World, room: int, terrain: Terrain) -> tuple[slice, slice]:
    box = world.rooms[room].box
    row, col = terrain.cell((box.x0_m, box.y0_m))
    last_row, last_col = terrain.cell((box.x1_m, box.y1_m))
    return slice(row, last_row + 1), slice(col, last_col + 1)


# Stops


@dataclass(frozen=True, slots=True)
class Stop:
    """A place that a robot goes to."""

    room: int
    x_m: float
    y_m: float


def stops(world: World, terrain: Terrain, area_m2: float = 14.0) -> list[Stop]:
    """Return places that show each room to a robot: one, and one more for every ``area_m2``, far apart."""
    found: list[Stop] = []
    for index, room in enumerate(world.rooms):
        rows, cols = _room_slices(world, index, terrain)
        clearance = terrain.clearance_m[rows, cols]
        if clearance.max() <= 0.0:
            continue
        count = min(1 + int(room.box.area_m2 / area_m2), 4)
        for row, col in _far_apart(clearance, count, terrain.cell_m):
            found.append(Stop(index, *terrain.centre_m((row + rows.start, col + cols.start))))
    return found


def _far_apart(clearance_m: Raster, count: int, cell_m: float) -> list[Cell]:
    """Return up to ``count`` cells with much clearance, each far from those before it."""
    row, col = np.unravel_index(int(clearance_m.argmax()), clearance_m.shape)
    chosen = [(int(row), int(col))]
    rows, cols = np.indices(clearance_m.shape)
    fit = clearance_m > 0.6 * clearance_m.max()
    for _ in range(count - 1):
        away = np.min([np.hypot(rows - row, cols - col) for row, col in chosen], axis=0) * fit
        row, col = np.unravel_index(int(away.argmax()), away.shape)
        if away[row, col] * cell_m < 2.0:
            break
        chosen.append((int(row), int(col)))
    return chosen


# Tours


def tour(world: World, chosen: Sequence[Stop]) -> list[Stop]:
    """Return the stops in an order to visit them in: from the first, always on to the nearest that is left."""
    away = _walking_distances(world, chosen)
    order, left = [0], set(range(1, len(chosen)))
    while left:
        here = order[-1]
        order.append(min(left, key=lambda other: (away[here, other], other)))
        left.remove(order[-1])
    return [chosen[index] for index in order]


def window(all_stops: Sequence[Stop], lo: float, hi: float, direction_rad: float) -> list[Stop]:
    """Return the stops in a strip of the floor.

    Parameters
    ----------
    all_stops
        To choose from.
    lo, hi
        Shares of the stops, from 0 to 1, in the order along ``direction_rad``.
    direction_rad
        Direction along which the stops are ordered. With ``lo`` > ``hi`` they are returned in reverse.
    """
    cos, sin = math.cos(direction_rad), math.sin(direction_rad)
    ordered = sorted(all_stops, key=lambda stop: (cos * stop.x_m + sin * stop.y_m, stop.x_m))
    first, last = (round(share * len(ordered)) for share in sorted((lo, hi)))
    part = ordered[first:last]
    return part[::-1] if lo > hi else part


def _walking_distances(world: World, places: Sequence[Stop]) -> Raster:
    """Return the lengths of the ways between stops through the doors, straight within a room."""
    doors = [door for door in world.doors if not door.is_closed]
    points = np.array([(place.x_m, place.y_m) for place in places] + [door.centre_m for door in doors])
    rooms = [{place.room} for place in places] + [set(door.rooms) for door in doors]
    inside = np.array([[room in member for room in range(len(world.rooms))] for member in rooms], dtype=np.float64)
    straight = np.hypot(*(points[:, None] - points[None]).transpose(2, 0, 1))
    away = np.where(inside @ inside.T > 0.0, straight, np.inf)
    for via in range(len(points)):
        away = np.minimum(away, away[:, via, None] + away[None, via])
    shortest: Raster = away[: len(places), : len(places)]
    return shortest


# Ways


def route(terrain: Terrain, via: Sequence[Stop]) -> Points:
    """Return a smooth way, shape (N, 2), that passes the stops and keeps away from obstacles."""
    narrow = 1.0 + 1.5 * np.maximum(0.0, 0.9 - terrain.clearance_m)
    prices = np.where(terrain.clearance_m > 0.0, narrow, math.inf).tolist()
    cells: list[Cell] = [terrain.cell((via[0].x_m, via[0].y_m))]
    for stop in via[1:]:
        cells += _shortest(prices, cells[-1], terrain.cell((stop.x_m, stop.y_m)))[1:]
    return _smooth(np.array([terrain.centre_m(cell) for cell in cells]), reach=3)


def _shortest(prices: Sequence[Sequence[float]], start: Cell, goal: Cell) -> list[Cell]:
    """Return the cells of the cheapest way by A*; a step costs its length times the price of the cell it enters."""
    rows, cols = len(prices), len(prices[0])
    cost, came_from = {start: 0.0}, {start: start}
    queue: list[tuple[float, Cell]] = [(0.0, start)]
    while queue:
        _, here = heapq.heappop(queue)
        if here == goal:
            return _traced(came_from, goal)
        for d_row, d_col, length in _STEPS:
            there = (here[0] + d_row, here[1] + d_col)
            if not (0 <= there[0] < rows and 0 <= there[1] < cols):
                continue
            total = cost[here] + length * prices[there[0]][there[1]]
            if total < cost.get(there, math.inf):
                cost[there], came_from[there] = total, here
                heapq.heappush(queue, (total + math.hypot(goal[0] - there[0], goal[1] - there[1]), there))
    raise ValueError(f"there is no way from raster cell {start} to {goal}")


def _traced(came_from: dict[Cell, Cell], goal: Cell) -> list[Cell]:
    way = [goal]
    while came_from[way[-1]] != way[-1]:
        way.append(came_from[way[-1]])
    return way[::-1]


def _smooth(points_m: Points, reach: int) -> Points:
    """Return the running mean over ``reach`` points on either side, the ends repeated outwards."""
    padded = np.pad(points_m, ((reach, reach), (0, 0)), mode="edge")
    width = 2 * reach + 1
    smooth: Points = np.mean([padded[shift : shift + len(points_m)] for shift in range(width)], axis=0)
    return smooth


# Poses


@dataclass(frozen=True, slots=True)
class Pace:
    """How fast a robot drives.

    Parameters
    ----------
    speed_m_s, turn_rad_s
        Highest; it does not drive on while it has to turn by much.
    period_s
        Time between two poses, and between two scans.
    """

    speed_m_s: float = 0.5
    turn_rad_s: float = 0.9
    period_s: float = 0.25


def follow(way_m: Points, heading_rad: float, pace: Pace) -> list[Sim2]:
    """Return the poses of a robot that follows a way, one per period.

    Parameters
    ----------
    way_m
        Shape (N, 2); the robot stands at its first point.
    heading_rad
        Where it looks at first.
    pace
        How fast it goes.
    """
    lengths = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(way_m, axis=0).T))])
    poses = [Sim2(float(way_m[0, 0]), float(way_m[0, 1]), heading_rad)]
    travelled = 0.0
    while travelled < lengths[-1]:
        here = poses[-1]
        ahead = _at(way_m, lengths, travelled + 0.3)
        turn = wrap_angle(math.atan2(ahead[1] - here.y_m, ahead[0] - here.x_m) - here.yaw_rad)
        most = pace.turn_rad_s * pace.period_s
        share = max(0.0, math.cos(turn)) if abs(turn) < 1.2 else 0.0
        travelled += share * pace.speed_m_s * pace.period_s
        x_m, y_m = _at(way_m, lengths, travelled)
        poses.append(Sim2(x_m, y_m, here.yaw_rad + min(max(turn, -most), most)))
        if lengths[-1] - travelled < 0.05:
            break
    return poses


def _at(way_m: Points, lengths: NDArray[np.float64], travelled_m: float) -> tuple[float, float]:
    x_m = np.interp(travelled_m, lengths, way_m[:, 0])
    return float(x_m), float(np.interp(travelled_m, lengths, way_m[:, 1]))
