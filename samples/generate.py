"""Makes the recordings of this folder.

``python samples/generate.py [--out DIR] [--seed N] [--only NAME] [--true-maps]``
"""

from __future__ import annotations

import argparse
import heapq
import json
import shutil
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

if not __package__:  # run as a script: only this folder is on the path
    sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from replay.export import map_server
from samples.drive import Stop, follow, route, stops, survey, tour, window
from samples.floorplan import FloorStyle, office_floor
from samples.mission import Robot, Run, explore, truth, truth_record
from samples.record import Event, Names, Timing, WriteRecording, events, write_bag1, write_bag2, write_mcap
from samples.true_map import true_map

EPOCH_NS = 1_750_000_000_000_000_000
RESTART_PAUSE_S = 8.0
_SECOND_NS = 1_000_000_000


@dataclass(frozen=True, slots=True)
class Plan:
    """What one robot does.

    Parameters
    ----------
    name
        Of the robot.
    strip
        Which stops of the floor it visits, see `samples.drive.window`.
    heading_rad
        Where it looks at the start, which turns its map.
    starts_s
        When it starts, after the recording's first moment.
    maps
        How many maps it publishes; after a restart, as many again.
    restart_heading_rad
        If given, its SLAM restarts halfway while the robot is turned to this heading.
    """

    name: str
    strip: tuple[float, float]
    heading_rad: float
    starts_s: float = 0.0
    maps: int = 7
    restart_heading_rad: float | None = None


@dataclass(frozen=True, slots=True)
class Recipe:
    """A mission on one floor; the first robot's map is the reference.

    Parameters
    ----------
    floor_seed, style
        The floor.
    direction_rad
        Direction across the floor along which the robots' strips lie.
    plans
        The robots.
    map_lag_s
        Least and largest time from a map's stamp to its being recorded.
    """

    floor_seed: int
    direction_rad: float
    plans: tuple[Plan, ...]
    style: FloorStyle = field(default_factory=FloorStyle)
    robot: Robot = field(default_factory=Robot)
    map_lag_s: tuple[float, float] = (0.02, 0.08)


@dataclass(frozen=True, slots=True, eq=False)
class Leg:
    """A run and when it began."""

    run: Run
    start_ns: int


RECIPES = {
    "two_robots": Recipe(
        floor_seed=5,
        direction_rad=0.2,
        plans=(Plan("r1", (0.0, 0.62), 0.37, maps=8), Plan("r2", (1.0, 0.38), 2.55, starts_s=3.7, maps=8)),
    ),
    "three_robots": Recipe(
        floor_seed=6,
        direction_rad=0.1,
        plans=(
            Plan("r1", (0.28, 0.72), 2.43, maps=7),
            Plan("r2", (0.0, 0.48), -0.33, starts_s=2.3, maps=7),
            Plan("r3", (1.0, 0.6), 1.18, starts_s=5.9, maps=7),
        ),
    ),
    "bag_per_robot": Recipe(
        floor_seed=21,
        direction_rad=-0.3,
        style=FloorStyle(width_m=22.0, height_m=14.5),
        plans=(
            Plan("alpha", (0.0, 0.55), -1.27, maps=6),
            Plan("bravo", (1.0, 0.3), 0.83, starts_s=4.1, maps=3, restart_heading_rad=2.61),
        ),
        map_lag_s=(0.3, 1.2),
    ),
}


def simulate(recipe: Recipe, seed: int) -> list[list[Leg]]:
    """Return for every robot its runs, one after the other: two if its SLAM restarts."""
    world = office_floor(recipe.floor_seed + 1000 * seed, recipe.style)
    terrain = survey(world)
    everywhere = stops(world, terrain)
    legs: list[list[Leg]] = []
    for number, plan in enumerate(recipe.plans):
        rng = np.random.default_rng([seed, recipe.floor_seed, number])
        start_ns = EPOCH_NS + round(plan.starts_s * _SECOND_NS)
        legs.append([])
        for part, heading_rad in _parts(plan, tour(world, window(everywhere, *plan.strip, recipe.direction_rad))):
            poses = follow(route(terrain, part), heading_rad, recipe.robot.pace)
            run = explore(world, poses, recipe.robot, plan.maps, rng)
            legs[-1].append(Leg(run, start_ns))
            start_ns += round((run.duration_s + RESTART_PAUSE_S) * _SECOND_NS)
    return legs


def _parts(plan: Plan, order: list[Stop]) -> list[tuple[list[Stop], float]]:
    """Return the stops and first headings of the drive, cut in two by a restart."""
    if plan.restart_heading_rad is None:
        return [(order, plan.heading_rad)]
    half = len(order) // 2
    return [(order[: half + 1], plan.heading_rad), (order[half:], plan.restart_heading_rad)]


def recorded(recipe: Recipe, robot: int, legs: Sequence[Leg], names: Names, seed: int) -> Iterator[Event]:
    """Yield what one robot publishes, in log order."""
    rng = np.random.default_rng([seed, recipe.floor_seed, robot, 1])
    for leg in legs:
        yield from events(leg.run, names, Timing(leg.start_ns, recipe.map_lag_s), rng)


def truth_of(recipe: Recipe, legs: Sequence[Sequence[Leg]]) -> dict[str, object]:
    """Return the truth of a mission as it is written beside its recording."""
    reference = legs[0][-1].run
    robots: dict[str, object] = {}
    for plan, parts in zip(recipe.plans[1:], legs[1:], strict=True):
        record = truth_record(truth(reference, parts[-1].run))
        if len(parts) > 1:
            before = truth_record(truth(reference, parts[0].run))
            restart_ns = parts[-1].start_ns - round(0.5 * RESTART_PAUSE_S * _SECOND_NS)
            record["before_restart"] = {**before, "restart_stamp_ns": restart_ns}
        robots[plan.name] = record
    return {"reference": recipe.plans[0].name, "robots": robots}


def write_together(path: Path, recipe: Recipe, seed: int, write: WriteRecording) -> None:
    """Write one recording of all robots, and the truth beside it."""
    legs = simulate(recipe, seed)
    streams = [
        recorded(
            recipe,
            robot,
            parts,
            Names(f"/{plan.name}/map", f"{plan.name}/map", f"{plan.name}/base_link"),
            seed,
        )
        for robot, (plan, parts) in enumerate(zip(recipe.plans, legs, strict=True))
    ]
    _remove(path)
    write(path, heapq.merge(*streams, key=lambda event: event.log_ns))
    _write_truth(path.with_suffix(".truth.json"), truth_of(recipe, legs))


def write_apart(folder: Path, recipe: Recipe, seed: int, write: WriteRecording) -> None:
    """Write one recording per robot into a folder, and the truth beside the folder."""
    legs = simulate(recipe, seed)
    _remove(folder)
    folder.mkdir(parents=True)
    for robot, (plan, parts) in enumerate(zip(recipe.plans, legs, strict=True)):
        write(folder / plan.name, recorded(recipe, robot, parts, Names("/map", "map", "base_link"), seed))
    _write_truth(folder.with_name(f"{folder.name}.truth.json"), truth_of(recipe, legs))


def _write_truth(path: Path, content: dict[str, object]) -> None:
    path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path)
    path.unlink(missing_ok=True)


def generate(name: str, out: Path, seed: int) -> None:
    """Write one of the recordings of `RECIPES` into the folder ``out``."""
    out.mkdir(parents=True, exist_ok=True)
    recipe = RECIPES[name]
    if name == "two_robots":
        write_together(out / f"{name}.mcap", recipe, seed, write_mcap)
    elif name == "three_robots":
        write_together(out / f"{name}.bag", recipe, seed, write_bag1)
    else:
        write_apart(out / name, recipe, seed, write_bag2)


def write_true_map(name: str, out: Path, seed: int) -> None:
    """Write the floor of a recording as a saved map, in the reference's map frame."""
    recipe = RECIPES[name]
    world = office_floor(recipe.floor_seed + 1000 * seed, recipe.style)
    grid = true_map(world, simulate(recipe, seed)[0][-1].run.world_from_map)
    for path, content in map_server.files(grid, out / f"{name}.true_map", "trinary").items():
        path.write_bytes(content)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command."""
    parser = argparse.ArgumentParser(description="Make the sample recordings.")
    parser.add_argument("--out", type=Path, default=Path(__file__).resolve().parent, help="folder to write into")
    parser.add_argument("--seed", type=int, default=0, help="0 gives the recordings of the repository")
    parser.add_argument("--true-maps", action="store_true", help="write the floors as saved maps, and no recordings")
    parser.add_argument("--only", choices=sorted(RECIPES), help="make just this one")
    options = parser.parse_args(arguments)
    try:
        options.out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        parser.error(f"{options.out}: {error.strerror}")
    for name in [options.only] if options.only else RECIPES:
        (write_true_map if options.true_maps else generate)(name, options.out, options.seed)
        print(f"{name}: written to {options.out}")


if __name__ == "__main__":
    main()
