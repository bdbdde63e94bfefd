"""A recording of huge maps: two robots that know many floors of offices side by side, drawn rather than driven.

The floors are laid out as tiles, all different. Each robot knows all columns of tiles but one, from its own side on:
one column more with every update, or several. What it knows of a tile is what a plan would show: rooms free, walls and
furniture occupied, with noise of its own.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import cv2
import numpy as np

from benchmarks.long_mission import LAG_NS, MARGIN_CELLS, RESOLUTION_M, SECOND_NS, START_NS
from mapmerge.grid import UNKNOWN, Cells, Grid
from mapmerge.sim2 import Points, Sim2
from samples.floorplan import FloorStyle, office_floor
from samples.mission import Truth, truth_record
from samples.record import MapEvent, write_mcap
from samples.world import World

_TILES = 5
_TURNS_RAD = (0.0, 0.5 * math.pi + 0.05)
_TILE_SHARE = 0.98
_NOISE_M = 0.01
_FREE, _OCCUPIED = 0, 100


@dataclass(frozen=True)
class HugeMission:
    """Two robots' maps of about so many cells a side.

    Parameters
    ----------
    side_cells
        About how many cells a side the last maps have.
    updates
        How many maps each robot publishes.
    seed
        Of the floors and the noise.
    """

    side_cells: int = 10_000
    updates: int = 3
    seed: int = 1

    @property
    def name(self) -> str:
        """What a recording of it is called."""
        return f"huge_2x{self.updates}_{self.side_cells}_{self.seed}"

    @cached_property
    def tile_m(self) -> float:
        """Side of a tile."""
        return _TILE_SHARE * self.side_cells * RESOLUTION_M / _TILES

    def record(self, path: Path) -> dict[str, object]:
        """Write the recording and return the truth as it stands beside recordings; see `benchmarks.made_once`."""
        floors = _floors(self)
        streams = [_events(self, number, floors) for number in range(2)]
        write_mcap(path, heapq.merge(*streams, key=lambda event: event.log_ns))
        frames = [_world_from_map(self, number) for number in range(2)]
        middle_m = frames[1].inverse().apply_point((_TILES + 1) * self.tile_m / 2, _TILES * self.tile_m / 2)
        found = Truth(frames[0].inverse() @ frames[1], (_TILES - 1) / _TILES, middle_m)
        return {"reference": "r1", "robots": {"r2": truth_record(found)}}


@dataclass(frozen=True, slots=True, eq=False)
class _Tile:
    """One floor in its place: what is free, as corners of boxes, and what is not, as ends of edges; in the world."""

    boxes_m: Points
    ends_m: Points


def _floors(mission: HugeMission) -> list[list[_Tile]]:
    """Return the tiles, column by column; there is one column more than each robot knows."""
    style = FloorStyle(width_m=mission.tile_m, height_m=mission.tile_m)
    return [
        [
            _placed(office_floor(mission.seed * 1000 + col * _TILES + row, style), col, row, mission.tile_m)
            for row in range(_TILES)
        ]
        for col in range(_TILES + 1)
    ]


def _placed(world: World, col: int, row: int, tile_m: float) -> _Tile:
    boxes = [room.box for room in world.rooms]
    corners = [
        [(box.x0_m, box.y0_m), (box.x1_m, box.y0_m), (box.x1_m, box.y1_m), (box.x0_m, box.y1_m)] for box in boxes
    ]
    corner_m = np.array([col * tile_m, row * tile_m])
    return _Tile(np.array(corners) + corner_m, world.edges_m.reshape(-1, 2, 2) + corner_m)


def _world_from_map(mission: HugeMission, number: int) -> Sim2:
    """Return where a robot's map frame lies: at the lower corner of its own side."""
    return Sim2(number * (_TILES + 1) * mission.tile_m, 0.0, _TURNS_RAD[number])


def _events(mission: HugeMission, number: int, floors: Sequence[Sequence[_Tile]]) -> Iterator[MapEvent]:
    """Yield the maps of one robot as they are recorded."""
    columns = list(reversed(floors)) if number else list(floors)
    for update in range(mission.updates):
        known = columns[: math.ceil(_TILES * (update + 1) / mission.updates)]
        stamp_ns = START_NS + update * SECOND_NS + number * SECOND_NS // 2
        grid = _drawn([tile for column in known for tile in column], mission, number)
        yield MapEvent(stamp_ns + LAG_NS, stamp_ns, f"/r{number + 1}/map", f"r{number + 1}/map", grid)


def _drawn(tiles: Sequence[_Tile], mission: HugeMission, number: int) -> Grid:
    """Return the map of a robot that knows these tiles."""
    map_from_world = _world_from_map(mission, number).inverse()
    boxes = [_in_cells(tile.boxes_m, map_from_world) for tile in tiles]
    lowest = np.floor(np.min([part.min(axis=(0, 1)) for part in boxes], axis=0)).astype(int) - MARGIN_CELLS
    highest = np.ceil(np.max([part.max(axis=(0, 1)) for part in boxes], axis=0)).astype(int) + MARGIN_CELLS
    cols, rows = (highest - lowest).tolist()
    cells: Cells = np.full((rows, cols), UNKNOWN, np.int8)
    for rooms in boxes:
        for room in np.rint(rooms - lowest).astype(np.int32):
            cv2.fillConvexPoly(cells, room, _FREE)
    for index, tile in enumerate(tiles):
        rng = np.random.default_rng([mission.seed, number, index, 67])
        ends = _in_cells(tile.ends_m + rng.normal(0.0, _NOISE_M, tile.ends_m.shape), map_from_world)
        cv2.polylines(cells, list(np.floor(ends - lowest).astype(np.int32)), isClosed=False, color=_OCCUPIED)
    origin = Sim2(float(lowest[0]) * RESOLUTION_M, float(lowest[1]) * RESOLUTION_M)
    return Grid(cells, RESOLUTION_M, origin)


def _in_cells(points_m: Points, map_from_world: Sim2) -> Points:
    """Return points of the world, shape (…, 2), in the map frame, in cells."""
    points: Points = map_from_world.apply(points_m.reshape(-1, 2)).reshape(points_m.shape) / RESOLUTION_M
    return points
