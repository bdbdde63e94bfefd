"""Maps to test with: simulated runs with known truth, and maps drawn from rectangles."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from mapmerge.config import MergeConfig
from mapmerge.grid import Grid
from mapmerge.match import Match, Matcher
from mapmerge.match.correlation import CorrelationMatcher
from mapmerge.match.pair import DescribedMap, PairOfMaps
from mapmerge.prepare import prepare
from mapmerge.prepared import PreparedMap
from mapmerge.prior import Prior
from mapmerge.sim2 import IDENTITY, Sim2, wrap_angle
from samples.drive import Pace, follow, route, stops, survey, tour, window
from samples.floorplan import FloorStyle, look_alike_corridor, office_floor
from samples.lidar import Lidar
from samples.mapping import SensorModel
from samples.mission import Robot, Run, explore, known_at

UNKNOWN, FREE, WALL = -1, 0, 100
CONFIG = MergeConfig()
SMALL = FloorStyle(width_m=17.0, height_m=11.5)
BAYS, BAY_M = 7, 4.0


# Simulated runs


@dataclass(frozen=True, eq=False)
class Pair:
    """Two maps of one floor, and where the source's map frame truly lies in the target's."""

    target: Grid
    source: Grid
    target_from_source: Sim2

    @property
    def swapped(self) -> Pair:
        return Pair(self.source, self.target, self.target_from_source.inverse())

    @property
    def shared_m(self) -> tuple[float, float]:
        """Middle of what both maps know, in the source's map frame: where a position error is measured."""
        centres_m = self.source.centres_m(self.source.known)
        both = known_at(self.target, self.target_from_source.apply(centres_m))
        x_m, y_m = centres_m[both].mean(axis=0)
        return float(x_m), float(y_m)

    def errors(self, target_from_source: Sim2) -> tuple[float, float]:
        """Return a placement's error in metres, amid the overlap, and in degrees."""
        return errors(target_from_source, self.target_from_source, self.shared_m)


@functools.cache
def office_run(
    seed: int,
    lo: float,
    hi: float,
    heading_rad: float,
    noise: int,
    resolution_m: float = 0.05,
    maps: int = 3,
    people: int = 0,
) -> Run:
    """Return a robot's run through a strip of a small office floor; ``noise`` seeds the robot's own errors."""
    world = office_floor(seed, SMALL)
    places = window(stops(world, survey(world)), lo, hi, direction_rad=0.2)
    return _run(world, places, heading_rad, noise, resolution_m, maps, people=people)


@functools.cache
def corridor_run(first_bay: int, last_bay: int, heading_rad: float, noise: int) -> Run:
    """Return a run past some bays of a corridor whose rooms nobody can tell apart; its ends are not seen."""
    world = look_alike_corridor(BAYS, BAY_M)
    lo_m, hi_m = first_bay * BAY_M, (last_bay + 1) * BAY_M
    everywhere = stops(world, survey(world))
    places = [stop for stop in everywhere if lo_m < stop.x_m < hi_m and stop.room != 0]
    return _run(world, places, heading_rad, noise, 0.05, 2, max_range_m=3.5)


def _run(world, places, heading_rad, noise, resolution_m, maps, max_range_m=8.0, people=0):
    terrain = survey(world)
    pace = Pace(speed_m_s=1.0, turn_rad_s=1.8)
    poses = follow(route(terrain, tour(world, places)), heading_rad, pace)
    lidar = Lidar(beams_per_turn=360, max_range_m=max_range_m)
    robot = Robot(lidar=lidar, pace=pace, model=SensorModel(resolution_m=resolution_m), people=people)
    return explore(world, poses, robot, maps, np.random.default_rng([noise, 5]))


def last_map(run: Run) -> Grid:
    return run.snapshots[-1].grid


def pair_of(target: Run, source: Run) -> Pair:
    return Pair(last_map(target), last_map(source), target.world_from_map.inverse() @ source.world_from_map)


def office_pair(seed: int, *, resolutions_m=(0.05, 0.05), headings_rad=(0.4, 1.9)) -> Pair:
    """Return the maps of two robots that start at opposite sides of one floor."""
    return pair_of(
        office_run(seed, 0.0, 0.7, headings_rad[0], 1, resolutions_m[0]),
        office_run(seed, 1.0, 0.3, headings_rad[1], 2, resolutions_m[1]),
    )


def in_frame(grid: Grid, new_from_map: Sim2) -> Grid:
    """Return the same cells in another map frame: the origin shifts and turns."""
    return Grid(grid.cells, grid.resolution_m, new_from_map @ grid.map_from_grid)


# Drawn maps

Box = tuple[float, float, float, float]


def drawn(
    inside: Callable[[np.ndarray, np.ndarray], np.ndarray],
    walls: Sequence[Box],
    *,
    size_m: tuple[float, float],
    resolution_m: float = 0.05,
    floor_from_map: Sim2 = IDENTITY,
    ragged: int | None = None,
) -> Grid:
    """Return a map of what is drawn in the frame of a floor.

    Parameters
    ----------
    inside
        Tells for x and y where the floor is known; elsewhere the map is unknown.
    walls
        Rectangles x0, y0, x1, y1.
    size_m
        The map's sides; its grid begins at its frame's origin.
    floor_from_map
        Where the map's frame lies on the floor.
    ragged
        Seed of a noise that moves the cells' centres by up to half a cell; None for none.
    """
    rows, cols = round(size_m[1] / resolution_m), round(size_m[0] / resolution_m)
    row, col = np.indices((rows, cols)).reshape(2, -1)
    centres = np.stack([col + 0.5, row + 0.5], axis=1)
    if ragged is not None:
        centres += np.random.default_rng(ragged).uniform(-0.5, 0.5, centres.shape)
    x_m, y_m = floor_from_map.apply(centres * resolution_m).T
    cells = np.where(inside(x_m, y_m), FREE, UNKNOWN)
    for x0_m, y0_m, x1_m, y1_m in walls:
        cells[(x_m >= x0_m) & (x_m < x1_m) & (y_m >= y0_m) & (y_m < y1_m)] = WALL
    return Grid(cells.reshape(rows, cols).astype(np.int8), resolution_m)


def within(x0_m: float, y0_m: float, x1_m: float, y1_m: float) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    return lambda x_m, y_m: (x_m >= x0_m) & (x_m < x1_m) & (y_m >= y0_m) & (y_m < y1_m)


def outline(x0_m: float, y0_m: float, x1_m: float, y1_m: float, thick_m: float = 0.1) -> list[Box]:
    """Return the four walls around a rectangle, outside of it."""
    low_x, low_y, high_x, high_y = x0_m - thick_m, y0_m - thick_m, x1_m + thick_m, y1_m + thick_m
    return [
        (low_x, low_y, high_x, y0_m),
        (low_x, y1_m, high_x, high_y),
        (low_x, low_y, x0_m, high_y),
        (x1_m, low_y, high_x, high_y),
    ]


FLAT_M = (9.0, 6.0)
BESIDE_THE_FLAT = Sim2(-1.0, -1.0)
FLAT_WALLS = [
    *outline(0.0, 0.0, *FLAT_M),
    (3.5, 0.0, 3.6, 2.2),
    (3.5, 3.1, 3.6, 6.0),
    (3.6, 3.8, 7.4, 3.9),
    (6.2, 0.0, 6.3, 1.3),
    (0.0, 4.4, 1.2, 4.5),
    (7.8, 1.7, 8.5, 2.5),
    (4.3, 5.2, 5.0, 5.5),
]


def flat(
    floor_from_map: Sim2 = BESIDE_THE_FLAT,
    *,
    resolution_m: float = 0.05,
    ragged: int | None = None,
    size_m: float = 11.0,
) -> Grid:
    """Return a drawn flat of 9 × 6 m without any symmetry."""
    return drawn(
        within(0.0, 0.0, *FLAT_M),
        FLAT_WALLS,
        size_m=(size_m, size_m - 3.0),
        resolution_m=resolution_m,
        floor_from_map=floor_from_map,
        ragged=ragged,
    )


LINE_M = np.stack([np.linspace(0.0, 10.0, 101), np.full(101, 2.0)], axis=1)
FEW_POINTS = {
    "no points": np.empty((0, 2)),
    "one point": np.array([[1.0, 2.0]]),
    "one point, often": np.tile([[1.0, 2.0]], (40, 1)),
    "two points": np.array([[1.0, 2.0], [1.5, 2.0]]),
    "a line": LINE_M,
    "an oblique line": Sim2(yaw_rad=0.7).apply(LINE_M),
}


def walls_of_the_flat(seed: int, yaw_rad: float = 0.0, share: float = 1.0) -> np.ndarray:
    """Return noisy points on the flat's walls, turned about the origin; of a part of the flat if ``share`` < 1."""
    rng = np.random.default_rng(seed)
    points = []
    for x0_m, y0_m, x1_m, y1_m in FLAT_WALLS:
        count = int(20 * ((x1_m - x0_m) + (y1_m - y0_m)))
        points.append(rng.uniform((x0_m, y0_m), (x1_m, y1_m), (count, 2)))
    walls_m = np.vstack(points) + rng.normal(0.0, 0.02, (sum(map(len, points)), 2))
    return Sim2(yaw_rad=yaw_rad).apply(walls_m[walls_m[:, 0] <= share * FLAT_M[0]])


HALL_WALLS = [
    *outline(0.0, 0.0, 60.0, 40.0),
    (10.0, 0.0, 10.1, 9.0),
    (4.0, 6.0, 7.0, 6.1),
    (45.0, 30.0, 45.1, 40.0),
    (45.0, 30.0, 52.0, 30.1),
    (50.0, 34.0, 50.6, 36.0),
    (3.0, 31.0, 12.0, 31.1),
    (8.0, 33.0, 8.1, 40.0),
    (48.0, 0.0, 48.1, 8.0),
    (52.0, 5.0, 60.0, 5.1),
    (25.0, 17.0, 34.0, 17.1),
    (31.0, 17.0, 31.1, 25.0),
]


def hall_and_part(corner_m: tuple[float, float], yaw_rad: float) -> tuple[Grid, Grid, Sim2]:
    """Return a hall of 60 × 40 m, a part of 13 × 11 m of it in another frame, and where that lies in the hall."""
    x_m, y_m = corner_m
    hall_from_part = Sim2(x_m + 6.5, y_m + 5.5, yaw_rad) @ Sim2(-9.0, -9.0)
    hall = drawn(within(0.0, 0.0, 60.0, 40.0), HALL_WALLS, size_m=(61.0, 41.0), floor_from_map=Sim2(-0.5, -0.5))
    known = within(x_m, y_m, x_m + 13.0, y_m + 11.0)
    part = drawn(known, HALL_WALLS, size_m=(18.0, 18.0), floor_from_map=hall_from_part)
    known_m = hall_from_part.apply(part.centres_m(np.ones(part.cells.shape, np.bool_))).T
    cells = np.where(known(*known_m).reshape(part.cells.shape), part.cells, UNKNOWN).astype(np.int8)
    return hall, Grid(cells, part.resolution_m), Sim2(-0.5, -0.5).inverse() @ hall_from_part


def with_another_label(grid: Grid, factor: float) -> Grid:
    """Return the same cells, whose side is said to be so many times what it is; the origin is scaled as well."""
    pose = grid.map_from_grid
    return Grid(grid.cells, grid.resolution_m * factor, Sim2(pose.x_m * factor, pose.y_m * factor, pose.yaw_rad))


def described(grid: Grid, config: MergeConfig = CONFIG) -> DescribedMap:
    return CorrelationMatcher().prepare(grid, max(config.search.working_cell_m, grid.resolution_m), config)


def pair_of_maps(target: Grid, source: Grid, prior: Prior | None = None) -> PairOfMaps:
    return PairOfMaps(described(target), described(source), prior)


def walled_room(
    size_m: tuple[float, float],
    *,
    open_ends: bool,
    ragged: int | None = None,
    yaw_rad: float = 0.0,
    inside: Sequence[Box] = (),
) -> Grid:
    """Return a room; without its short walls if its ends are open. Its map frame is the room's, whatever the turn."""
    width_m, height_m = size_m
    walls = [*outline(0.0, 0.0, *size_m), *inside]
    side_m = math.hypot(*size_m) + 2.0
    corner = Sim2(width_m / 2, height_m / 2, yaw_rad) @ Sim2(-side_m / 2, -side_m / 2)
    known = (
        within(0.0, -0.2, width_m, height_m + 0.2) if open_ends else within(-0.2, -0.2, width_m + 0.2, height_m + 0.2)
    )
    grid = drawn(known, walls, size_m=(side_m, side_m), floor_from_map=corner, ragged=ragged)
    centres_m = corner.apply(grid.centres_m(np.ones(grid.cells.shape, np.bool_))).T
    cells = np.where(known(*centres_m).reshape(grid.cells.shape), grid.cells, UNKNOWN).astype(np.int8)
    return Grid(cells, grid.resolution_m, corner)


def filled(value: int, rows: int, cols: int, resolution_m: float = 0.05) -> Grid:
    return Grid(np.full((rows, cols), value, np.int8), resolution_m)


# Measures


def errors(found: Sim2, true: Sim2, at_m: tuple[float, float]) -> tuple[float, float]:
    """Return how far two placements are apart at a point of the source, in metres and degrees."""
    x_m, y_m = found.apply_point(*at_m)
    true_x_m, true_y_m = true.apply_point(*at_m)
    turn_rad = wrap_angle(found.yaw_rad - true.yaw_rad)
    return math.hypot(x_m - true_x_m, y_m - true_y_m), abs(math.degrees(turn_rad))


def match_grids(
    matcher: Matcher, target: Grid, source: Grid, config: MergeConfig = CONFIG, prior: Prior | None = None
) -> Match:
    """Match two maps at the resolution that the merger would take."""
    resolution_m = max(config.search.working_cell_m, target.resolution_m, source.resolution_m)
    prepared = [matcher.prepare(grid, resolution_m, config) for grid in (target, source)]
    return matcher.match(*prepared, config, prior)


def prepared_map(grid: Grid, config: MergeConfig = CONFIG) -> PreparedMap:
    return prepare(grid, max(config.search.working_cell_m, grid.resolution_m), config)
