"""The paper's figure 13 as a sweep: lidar noise from none to 0.1 m on simulated floors, all three methods."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from benchmarks.paper_cases import MAX_ERROR_DEG, MAX_ERROR_M, Case, Outcome, run
from mapmerge.config import MergeConfig
from mapmerge.grid import Grid
from mapmerge.prepare import prepare
from mapmerge.sim2 import Sim2
from mapmerge.verify import verify
from samples.drive import Pace, follow, route, stops, survey, tour, window
from samples.floorplan import FloorStyle, office_floor
from samples.lidar import Lidar
from samples.mission import Robot, explore, known_at
from samples.world import World

NOISE_M = (0.0, 0.005, 0.01, 0.02, 0.03, 0.05, 0.07, 0.10)
SEEDS = 6
_HOME = FloorStyle(width_m=17.0, height_m=11.5)
_PACE = Pace(speed_m_s=1.0, turn_rad_s=1.8)


@dataclass(frozen=True, slots=True)
class NoiseRow:
    """What one method made of all floors at one noise.

    Parameters
    ----------
    right
        Floors whose transform is right, accepted or not.
    accepted_right, accepted_wrong
        Floors that were accepted, by whether the transform is right.
    omega
        Mean acceptance index of the right ones; NaN if there is none.
    """

    right: int
    accepted_right: int
    accepted_wrong: int
    omega: float


def home_pair(seed: int, noise_m: float) -> Case:
    """Return the maps of two robots that explore one floor from opposite sides, with the truth."""
    world = office_floor(seed, _HOME)
    target, target_from = _explored(world, (0.0, 0.7), 0.4, noise_m, seed)
    source, source_from = _explored(world, (1.0, 0.3), 1.9, noise_m, seed + 1000)
    truth = target_from.inverse() @ source_from
    centres_m = source.centres_m(source.known)
    x_m, y_m = centres_m[known_at(target, truth.apply(centres_m))].mean(axis=0).tolist()
    return Case(f"floor {seed}", "", "", target, source, truth, None, (x_m, y_m))


def _explored(
    world: World, strip: tuple[float, float], heading_rad: float, noise_m: float, seed: int
) -> tuple[Grid, Sim2]:
    terrain = survey(world)
    places = tour(world, window(stops(world, terrain), *strip, direction_rad=0.2))
    robot = Robot(lidar=Lidar(beams_per_turn=360, max_range_m=8.0, noise_m=noise_m), pace=_PACE)
    poses = follow(route(terrain, places), heading_rad, _PACE)
    result = explore(world, poses, robot, 1, np.random.default_rng([seed, round(noise_m * 1e4)]))
    return result.snapshots[-1].grid, result.world_from_map


def omega_at_truth(case: Case) -> float:
    """Return the acceptance index at the true placement: what no method can be expected to exceed."""
    if case.truth is None:
        return math.nan
    config = MergeConfig()
    target, source = (prepare(grid, config.search.working_cell_m, config) for grid in (case.target, case.source))
    pose = target.grid.map_from_grid.inverse() @ case.truth @ source.grid.map_from_grid
    return verify(target, source, pose, config.verify).acceptance


def row(outcomes: list[Outcome]) -> NoiseRow:
    """Sum up what one method made of all floors."""
    omegas = [outcome.omega for outcome in outcomes if outcome.right]
    return NoiseRow(
        right=len(omegas),
        accepted_right=sum(outcome.match.accepted and outcome.right for outcome in outcomes),
        accepted_wrong=sum(outcome.match.accepted and not outcome.right for outcome in outcomes),
        omega=sum(omegas) / len(omegas) if omegas else math.nan,
    )


def sweep() -> None:
    """Print success and acceptance index over noise."""
    methods = ("existing", "paper", "correlation")
    print(
        f"Lidar noise, {SEEDS} simulated floors each (figure 13): right transforms (within {MAX_ERROR_M:g} m and "
        f"{MAX_ERROR_DEG:g}°), of these accepted, wrong ones accepted, mean ω of the right ones"
    )
    print(f"{'σ':>7}{'ω at truth':>13}" + "".join(f"{name:>28}" for name in methods))
    for noise_m in NOISE_M:
        cases = [home_pair(seed, noise_m) for seed in range(SEEDS)]
        truth = sum(map(omega_at_truth, cases)) / len(cases)
        cells = []
        for name in methods:
            one = row([run(case, MergeConfig(method=name)) for case in cases])
            omega = "    –" if math.isnan(one.omega) else f"{one.omega:.3f}"
            cells.append(f"{one.right:>3} right {one.accepted_right} acc. {one.accepted_wrong} wrong {omega}")
        print(f"{noise_m:>5.3f} m{truth:>12.3f} " + "".join(f"{cell:>28}" for cell in cells), flush=True)
