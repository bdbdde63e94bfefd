"""A long mission, recorded: robots that explore one large floor and publish their whole map again and again.

Each drives through about two thirds of the floor, from a side of its own, and publishes its map after equal parts of
its drive: a trinary grid that holds what it has seen and a margin, so that size and origin change by whole cells as it
grows, and cells change near the robot only. Ranges are noisy, poses are true. Stamps are a second apart, whatever the
drive takes; robots' stamps interleave.
"""

from __future__ import annotations

import argparse
import heapq
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks import flags
from benchmarks.made_once import recorded
from mapmerge.grid import UNKNOWN, Grid
from mapmerge.sim2 import Points, Sim2
from samples.drive import Pace, follow, route, stops, survey, tour, window
from samples.explorers import published
from samples.floorplan import FloorStyle, office_floor
from samples.lidar import Lidar, beam_ends
from samples.mapping import Mapper, SensorModel
from samples.mission import Run, Snapshot, truth, truth_record
from samples.record import MapEvent, write_mcap
from samples.world import World

RESOLUTION_M = 0.05
MARGIN_CELLS = 8
START_NS = 1_750_000_000_000_000_000
_STRIP = (0.0, 0.65)
_FIRST_DIRECTION_RAD = 0.3
_HEADINGS_RAD = (0.2, 1.35)
_AREA_OF_A_STOP_M2 = 60.0
_SPEED_M_S, _TURN_RAD_S, _PERIOD_S = 1.0, 1.8, 0.25
_SCAN_EVERY_M = 0.8
_LIDAR = Lidar(360, max_range_m=12.0, noise_m=0.01, dropout=0.01)
SECOND_NS = 1_000_000_000
LAG_NS = 20_000_000


LEAST_SIDE_CELLS = 50


@dataclass(frozen=True, slots=True)
class Mission:
    """What is explored, and how often it is published; the same mission gives the same recording.

    Parameters
    ----------
    robots
        How many.
    updates
        How many maps each of them publishes.
    side_cells
        About how many cells a side their last maps have.
    scans
        How many scans each takes, if more than one every 0.8 m and one for every update. With the largest number of
        updates here, missions that differ in updates alone show the same in the end.
    seed
        Of the floor and the noise.
    """

    robots: int = 2
    updates: int = 300
    side_cells: int = 2000
    scans: int = 0
    seed: int = 1

    @property
    def name(self) -> str:
        """What a recording of it is called."""
        return f"mission_{self.robots}x{self.updates}_{self.side_cells}_{max(self.scans, self.updates)}_{self.seed}"

    @property
    def robot_names(self) -> tuple[str, ...]:
        """The robots, the reference first."""
        return tuple(f"r{number + 1}" for number in range(self.robots))

    def record(self, path: Path) -> dict[str, object]:
        """Write the recording and return the truth as it stands beside recordings; see `benchmarks.made_once`."""
        drives = _drives(self)
        last: dict[str, Grid] = {}
        streams = [_events(self, number, drive) for number, drive in enumerate(drives)]
        write_mcap(path, _noting_the_last(heapq.merge(*streams, key=lambda event: event.log_ns), last))
        runs = [
            Run(drive.poses[0], (Snapshot(0.0, last[f"/{robot}/map"]),), (), 0.0, ())
            for robot, drive in zip(self.robot_names, drives, strict=True)
        ]
        others = zip(self.robot_names[1:], runs[1:], strict=True)
        return {
            "reference": self.robot_names[0],
            "robots": {robot: truth_record(truth(runs[0], run)) for robot, run in others},
        }


@dataclass(frozen=True, slots=True, eq=False)
class _Drive:
    """Where one robot takes its scans, the first at the origin of its map."""

    world: World
    poses: Sequence[Sim2]


def _drives(mission: Mission) -> list[_Drive]:
    side_m = mission.side_cells * RESOLUTION_M
    world = office_floor(mission.seed, FloorStyle(width_m=side_m, height_m=side_m))
    terrain = survey(world, cell_m=0.2)
    everywhere = stops(world, terrain, _AREA_OF_A_STOP_M2)
    drives: list[_Drive] = []
    for number in range(mission.robots):
        direction_rad = _FIRST_DIRECTION_RAD + number * 2.0 * np.pi / mission.robots
        chosen = tour(world, window(everywhere, *_STRIP, direction_rad))
        heading_rad = _HEADINGS_RAD[0] + number * _HEADINGS_RAD[1]
        drives.append(_Drive(world, _scanned_from(route(terrain, chosen), heading_rad, mission)))
    return drives


def _scanned_from(way_m: Points, heading_rad: float, mission: Mission) -> list[Sim2]:
    """Return the poses from which a robot that follows a way takes its scans, evenly in time."""
    length_m = float(np.hypot(*np.diff(way_m, axis=0).T).sum())
    scans = max(int(length_m / _SCAN_EVERY_M), mission.scans, mission.updates)
    period_s = min(_PERIOD_S, length_m / (scans * _SPEED_M_S))
    poses = follow(way_m, heading_rad, Pace(_SPEED_M_S, _TURN_RAD_S, period_s))
    return [poses[index] for index in np.linspace(0, len(poses) - 1, scans).astype(int).tolist()]


def _events(mission: Mission, number: int, drive: _Drive) -> Iterator[MapEvent]:
    """Yield the maps of one robot as they are recorded."""
    robot = mission.robot_names[number]
    first_ns = START_NS + number * SECOND_NS // mission.robots
    for update, grid in enumerate(_maps(mission, number, drive)):
        stamp_ns = first_ns + update * SECOND_NS
        yield MapEvent(stamp_ns + LAG_NS, stamp_ns, f"/{robot}/map", f"{robot}/map", grid)


def _maps(mission: Mission, number: int, drive: _Drive) -> Iterator[Grid]:
    """Yield the maps of one robot: what it knows after equal parts of its scans."""
    rng = np.random.default_rng([mission.seed, number, 61])
    map_from_world = drive.poses[0].inverse()
    mapper = Mapper(SensorModel(RESOLUTION_M))
    due = np.linspace(0, len(drive.poses), mission.updates + 1).astype(int)[1:].tolist()
    taken = 0
    for until in due:
        for pose in drive.poses[taken:until]:
            ranges_m = _LIDAR.scan(drive.world, pose, rng)
            back = np.isfinite(ranges_m)
            map_from_robot = map_from_world @ pose
            ends_m = beam_ends(ranges_m[back], _LIDAR.angles_rad[back], map_from_robot)
            mapper.add((map_from_robot.x_m, map_from_robot.y_m), ends_m)
        taken = until
        yield with_margin(published(mapper.grid(), is_trinary=True), MARGIN_CELLS)


def with_margin(grid: Grid, margin_cells: int) -> Grid:
    """Return a map with so many unknown cells around it."""
    cells = np.pad(grid.cells, margin_cells, constant_values=UNKNOWN)
    margin_m = margin_cells * grid.resolution_m
    return Grid(cells, grid.resolution_m, grid.map_from_grid @ Sim2(-margin_m, -margin_m))


def _noting_the_last(events: Iterable[MapEvent], last: dict[str, Grid]) -> Iterator[MapEvent]:
    for event in events:
        last[event.topic] = event.grid
        yield event


def main(arguments: Sequence[str] | None = None) -> None:
    """Make the recording of a mission and say where it is."""
    parser = argparse.ArgumentParser(description="Make the recording of a long mission, unless it is there.")
    parser.add_argument("--work", type=flags.folder, required=True, help="folder that it is kept in")
    parser.add_argument("--robots", type=flags.count, default=2)
    parser.add_argument("--updates", type=flags.count, default=300, help="maps that each robot publishes")
    parser.add_argument("--side", type=flags.count, default=2000, help="about so many cells a side have the last maps")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args(arguments)
    if options.side < LEAST_SIDE_CELLS:
        parser.error(f"--side {options.side}: a floor has {LEAST_SIDE_CELLS} cells a side at least")
    options.work.mkdir(parents=True, exist_ok=True)
    mission = Mission(options.robots, options.updates, options.side, seed=options.seed)
    print(recorded(mission, options.work))


if __name__ == "__main__":
    main()
