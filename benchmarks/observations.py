"""What the default method sees of pairs with known truth: what its confidence is fitted on, and checked on.

Simulated buildings have seeds below `benchmarks.cases.FIRST_SEED`; every fourth of them is held out. Recorded maps are
cut, so that they overlap less; those of one building are held out.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from itertools import combinations
from pathlib import Path

import numpy as np

from benchmarks.bends import BENT_SHARE, bent
from benchmarks.recorded_cuts import building, cut_pairs, cut_strangers, unrelated
from mapmerge.config import MergeConfig
from mapmerge.grid import Grid
from mapmerge.match import load_matcher
from mapmerge.match.cues import Fit
from mapmerge.sim2 import Sim2, wrap_angle
from samples.kinds import KINDS
from samples.pairs import Mission, Pair, Related, mission, pairs, strangers

BLOCK = 4
PAIRS_A_MISSION = 14
CROSSED_A_BLOCK = 20
TWINS_A_MISSION = 3
TWINS: tuple[Related, ...] = ("next floor", "next wing")
RIGHT_M, RIGHT_RAD = 0.5, math.radians(3.0)
BENT_RIGHT_M, BENT_RIGHT_RAD = 1.0, math.radians(5.0)
_LEAST_OVERLAP = 0.08
_CUTS_A_JOB = 100
_BENT_BY_DRIFT_M = 0.15
RECORDED, CROSSED = "recorded", "crossed"
SEEDS_OF_MISSIONS = 1000


@dataclass(frozen=True, slots=True)
class Candidate:
    """One of the placements of a pair that were weighed.

    Parameters
    ----------
    error_m, error_rad
        How far it is off amid the overlap; 0 of strangers.
    fit
        How well the maps fit there.
    """

    error_m: float
    error_rad: float
    fit: Fit


@dataclass(frozen=True, slots=True)
class Observation:
    """The placements of one pair that were weighed, and which of them is right.

    Parameters
    ----------
    name
        Of the pair.
    group
        Kind of simulated building, or "recorded".
    building
        What the pair has in common with others: pairs of one building are not independent.
    held_out
        Whether its building is held out of the fit.
    related
        Whether there is a right placement.
    ambiguous
        By construction.
    overlap
        True share of the smaller map that both know.
    bent
        Whether the maps were bent, or drift bent them by as much.
    candidates
        What was weighed, in the order in which the method of that day put it; none if it found no placement at all.
    """

    name: str
    group: str
    building: str
    held_out: bool
    related: bool
    ambiguous: bool
    overlap: float
    bent: bool
    candidates: tuple[Candidate, ...]

    @property
    def right_one(self) -> int | None:
        """Which candidate is right: the nearest to the truth, if it is the true one but for what bends leave open."""
        if not self.related or not self.candidates:
            return None
        limit_m, limit_rad = (BENT_RIGHT_M, BENT_RIGHT_RAD) if self.bent else (RIGHT_M, RIGHT_RAD)
        shares = [max(item.error_m / limit_m, item.error_rad / limit_rad) for item in self.candidates]
        nearest = min(range(len(shares)), key=shares.__getitem__)
        return nearest if shares[nearest] <= 1.0 else None

    @staticmethod
    def parse(line: str) -> Observation:
        """Read one line of a file of observations."""
        values = json.loads(line)
        candidates = (Candidate(**{**item, "fit": Fit(**item["fit"])}) for item in values["candidates"])
        return Observation(**{**values, "candidates": tuple(candidates)})


@dataclass(frozen=True, slots=True)
class Job:
    """Some pairs that one process makes and matches."""

    group: str
    first: int


def jobs(missions: int, cuts: int) -> list[Job]:
    """Return all work: so many missions of each kind of building, and so many cut pairs of recorded maps."""
    simulated = [Job(kind, first) for first in range(0, missions, BLOCK) for kind in KINDS]
    return [*simulated, *(Job(RECORDED, first) for first in range(0, cuts, _CUTS_A_JOB))]


def observed(job: Job) -> list[Observation]:
    """Match the pairs of a job."""
    made = _recorded(job.first) if job.group == RECORDED else _simulated(job.group, job.first)
    rng = np.random.default_rng([job.first, 80])
    found = []
    for pair, held_out in made:
        is_bent = bool(rng.uniform() < BENT_SHARE)
        found.append(_observation(bent(pair, rng) if is_bent else pair, job, held_out=held_out, is_bent=is_bent))
    return found


def collect(work: Sequence[Job], path: Path, processes: int) -> None:
    """Write the observations of all jobs to a file, one a line."""
    with ProcessPoolExecutor(processes) as pool, path.open("w", encoding="utf-8") as file:
        for found in pool.map(observed, work):
            file.writelines(json.dumps(asdict(item)) + "\n" for item in found)
            file.flush()


def read(path: Path) -> list[Observation]:
    """Read a file of observations."""
    return [Observation.parse(line) for line in path.read_text(encoding="utf-8").splitlines()]


def _simulated(kind: str, first: int) -> Iterator[tuple[Pair, bool]]:
    rng = np.random.default_rng([first, 77])
    missions: list[Mission] = []
    for seed in range(first, first + BLOCK):
        held_out = seed % BLOCK == BLOCK - 1
        found = mission(kind, seed)
        related = list(pairs(found, _LEAST_OVERLAP))
        twins = [strangers(kind, twin, next_to) for twin in _twin_seeds(seed) for next_to in TWINS]
        missions.append(found)
        chosen = rng.permutation(len(related))[:PAIRS_A_MISSION].tolist()
        yield from ((related[index], held_out) for index in chosen)
        yield from ((pair, held_out) for pair in twins)
    for one, two in _crossed(missions, rng):
        yield unrelated(CROSSED, kind, one, two), False


def _twin_seeds(seed: int) -> Iterator[int]:
    """Yield seeds of other buildings, which no mission has."""
    return (seed + (number + 1) * SEEDS_OF_MISSIONS for number in range(TWINS_A_MISSION))


def _crossed(missions: Sequence[Mission], rng: np.random.Generator) -> Iterator[tuple[Grid, Grid]]:
    """Yield maps of two missions, neither of which is held out."""
    choices = list(
        combinations([item for item in missions if int(item.name.rpartition("-")[2]) % BLOCK < BLOCK - 1], 2)
    )
    for _ in range(CROSSED_A_BLOCK if choices else 0):
        one, two = choices[int(rng.integers(len(choices)))]
        robots = (item.robots[int(rng.integers(len(item.robots)))] for item in (one, two))
        grids = [robot.maps[int(rng.integers(len(robot.maps)))].grid for robot in robots]
        yield grids[0], grids[1]


def _recorded(first: int) -> Iterator[tuple[Pair, bool]]:
    yield from cut_pairs(first, _CUTS_A_JOB)
    yield from cut_strangers(first, _CUTS_A_JOB)


def _observation(pair: Pair, job: Job, *, held_out: bool, is_bent: bool) -> Observation:
    config = MergeConfig()
    matcher = load_matcher(config.method)
    grids = pair.target, pair.source
    resolution_m = max(config.search.working_cell_m, *(grid.resolution_m for grid in grids))
    target, source = (matcher.prepare(grid, resolution_m, config) for grid in grids)
    match = matcher.match(target, source, config)
    weighed = [(match.target_from_source, match.cues.fit)] if match.cues and match.target_from_source else []
    weighed += [(rival.target_from_source, rival.fit) for rival in match.rivals if rival.fit is not None]
    candidates = tuple(
        Candidate(*(errors(pose, pair.truth, pair.centre_m) if pair.truth else (0.0, 0.0)), fit)
        for pose, fit in weighed
    )
    return Observation(
        name=pair.name,
        group=job.group,
        building=_building(pair.name, job),
        held_out=held_out,
        related=pair.truth is not None,
        ambiguous=pair.ambiguous,
        overlap=pair.overlap,
        bent=is_bent or pair.bend_m >= _BENT_BY_DRIFT_M,
        candidates=candidates,
    )


def _building(name: str, job: Job) -> str:
    """Return what a pair has in common with others: the mission, with its twins; of several, the block; a building."""
    if name.startswith(CROSSED):
        return f"{job.group} from {job.first}"
    if job.group == RECORDED:
        return building(name)
    kind, seed = name.split("-")[:2]
    return f"{kind}-{int(seed.split()[0]) % SEEDS_OF_MISSIONS}"


def errors(found: Sim2, truth: Sim2, at_m: tuple[float, float]) -> tuple[float, float]:
    """Return how far a placement is off, in metres at a point of the source, and in radians."""
    (x_m, y_m), (true_x_m, true_y_m) = found.apply_point(*at_m), truth.apply_point(*at_m)
    turn_rad = abs(wrap_angle(found.yaw_rad - truth.yaw_rad))
    return math.hypot(x_m - true_x_m, y_m - true_y_m), turn_rad


def groups(found: Iterable[Observation]) -> dict[str, list[Observation]]:
    """Return the observations by group, in order of its name."""
    items = list(found)
    return {name: [item for item in items if item.group == name] for name in sorted({item.group for item in items})}
