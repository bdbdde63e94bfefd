"""Random pairs of maps with known truth, one by one or in bulk; the same kind and seed give the same pairs.

A pair is *ambiguous by construction* if a symmetry of its site's plan (the next bay of a corridor, a turn by 180°)
explains the two maps about as well as the truth does, see `samples.likeness.explains_as_well`, or if any placement
explains them in every respect as well, as of a plain room turned round, see `samples.rivals.has_rival`; two maps of
near-twins (the next floor, the next wing) if they agree as well as maps of one place have to. This looks at the
simulated maps, the truth and the plan alone, never at what a matcher says.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, product
from typing import Literal

import numpy as np

from mapmerge.grid import Grid
from mapmerge.sim2 import Sim2
from samples.explorers import Explored, MapOf, Strip, explored
from samples.kinds import KINDS, altered
from samples.likeness import agreement, explains_as_well, look, shared_m2
from samples.mess import drawn_mess, drawn_resolutions
from samples.rivals import has_rival
from samples.shared import Shared, shared, target_from_source
from samples.sites import Site, reflected
from samples.world import Rng

Related = Literal["same place", "other building", "next floor", "next wing"]
STRANGERS: tuple[Related, ...] = ("other building", "next floor", "next wing")

LEAST_OVERLAP, MOST_OVERLAP = 0.1, 0.9
_SNAPSHOTS = 6
_LEAST_AREA_M2 = 20.0
_LEAST_SHARED_M2 = 8.0
_TWINS_ALIKE = 0.85
_TRIES = 8
_NEXT_SITE = 50_000_000


@dataclass(frozen=True, slots=True, eq=False)
class Pair:
    """Two maps and the truth between them.

    Parameters
    ----------
    name
        Kind, seed and, in bulk, robots and maps.
    kind
        A key of `samples.kinds.KINDS`.
    target, source
        The maps.
    truth
        target_from_source between the map frames; None if the maps are of different places.
    centre_m
        Middle of what both maps know in the source's map frame: where positions are compared.
    overlap
        Area that both maps know, as a share of the smaller one's.
    bend_m
        How far apart both maps show one place at the truth, root mean square.
    ambiguous
        By construction, see the module's docstring.
    related
        What the second map is to the first.
    """

    name: str
    kind: str
    target: Grid
    source: Grid
    truth: Sim2 | None
    centre_m: tuple[float, float]
    overlap: float
    bend_m: float
    ambiguous: bool
    related: Related


@dataclass(frozen=True, slots=True, eq=False)
class Mission:
    """Some robots' maps of one site.

    Parameters
    ----------
    name, kind
        Kind and seed; the kind.
    site
        Where.
    robots
        What came of each.
    """

    name: str
    kind: str
    site: Site
    robots: tuple[Explored, ...]


def pair(kind: str, seed: int, overlap: float | None = None) -> Pair:
    """Return two maps of one site.

    Parameters
    ----------
    kind
        A key of `samples.kinds.KINDS`.
    seed
        Of everything.
    overlap
        Wanted; drawn uniformly from 0.1 to 0.9 if not given. Of the maps that the robots published on their way, the
        two that come closest are taken.
    """
    rng = np.random.default_rng([seed, 30, list(KINDS).index(kind)])
    drawn = float(rng.uniform(LEAST_OVERLAP, MOST_OVERLAP))
    wanted = drawn if overlap is None else overlap
    for _ in range(_TRIES):
        strips = _opposite(wanted, float(rng.uniform(0.0, math.tau)))
        found = _explored(kind, seed, KINDS[kind](seed), strips, _SNAPSHOTS, rng)
        robots = found.robots
        choices = [
            (abs(truth.overlap - wanted), target, source, truth)
            for target, source in product(_large_enough(robots[0]), _large_enough(robots[1]))
            if (truth := shared(robots[0], target, robots[1], source)) and truth.overlap_m2 >= _LEAST_SHARED_M2
        ]
        if choices:
            _, target, source, truth = min(choices, key=lambda choice: choice[0])
            return _pair(f"{kind}-{seed}", found, (0, 1), (target, source), truth)
    raise ValueError(f"two robots have nothing in common on any of {_TRIES} tours of the {kind} with seed {seed}")


def mission(kind: str, seed: int, robots: int = 4, maps: int = 3) -> Mission:
    """Return some robots' growing maps of one site: many pairs at the price of few runs."""
    rng = np.random.default_rng([seed, 31, list(KINDS).index(kind)])
    return _explored(kind, seed, KINDS[kind](seed), _anywhere(robots, rng), maps, rng)


def pairs(found: Mission, least_overlap: float = 0.05) -> Iterator[Pair]:
    """Yield the pairs of all robots and all their maps that know some place in common."""
    for one, two in combinations(range(len(found.robots)), 2):
        robots = found.robots[one], found.robots[two]
        for target, source in product(_large_enough(robots[0]), _large_enough(robots[1])):
            truth = shared(robots[0], target, robots[1], source)
            if truth and truth.overlap >= least_overlap and truth.overlap_m2 >= _LEAST_SHARED_M2:
                name = f"{found.name}-{one}@{target.time_s:.0f}s-{two}@{source.time_s:.0f}s"
                yield _pair(name, found, (one, two), (target, source), truth)


def strangers(kind: str, seed: int, related: Related) -> Pair:
    """Return two maps that do not belong together.

    Parameters
    ----------
    kind, seed
        As of `pair`.
    related
        What the second site is to the first: another of the same kind; the next floor, whose outline, corridors and
        doors are the same, but whose furniture and many of whose rooms are not; the next wing, which is such a floor
        and, as often as not, mirrored. The robots go to the same part of both.
    """
    rng = np.random.default_rng([seed, 32, list(KINDS).index(kind)])
    first = KINDS[kind](seed)
    other = _related(kind, first, seed, related, rng)
    strips = _same_part(rng)
    resolutions_m = drawn_resolutions(2, rng)
    target, source = (
        explored(site, number, strips[number], drawn_mess(rng), resolutions_m[number], 1, rng)
        for number, site in enumerate((first, other))
    )
    grids = target.maps[-1].grid, source.maps[-1].grid
    is_twin = related != "other building" and _are_twins(grids, target_from_source(target, source))
    name = f"{kind}-{seed}-{related.replace(' ', '-')}"
    return Pair(name, kind, *grids, None, (0.0, 0.0), 0.0, 0.0, is_twin, related)


def _explored(kind: str, seed: int, site: Site, strips: Sequence[Strip], maps: int, rng: Rng) -> Mission:
    resolutions_m = drawn_resolutions(len(strips), rng)
    robots = (
        explored(site, number, strip, drawn_mess(rng), resolutions_m[number], maps, rng)
        for number, strip in enumerate(strips)
    )
    return Mission(f"{kind}-{seed}", kind, site, tuple(robots))


def _opposite(overlap: float, direction_rad: float) -> list[Strip]:
    """Return strips from opposite sides: robots see beyond their strips, so that these need not overlap as much."""
    reach = min(1.0, 0.5 + 0.65 * max(0.0, overlap - 0.15))
    return [Strip(0.0, reach, direction_rad), Strip(1.0, 1.0 - reach, direction_rad)]


def _same_part(rng: Rng) -> list[Strip]:
    """Return strips of two robots that go to about the same part of a site, from opposite sides."""
    breadth, direction_rad = float(rng.uniform(0.5, 1.0)), float(rng.uniform(0.0, math.tau))
    lo = float(rng.uniform(0.0, 1.0 - breadth))
    return [Strip(lo, lo + breadth, direction_rad), Strip(lo + breadth, lo, direction_rad)]


def _anywhere(robots: int, rng: Rng) -> list[Strip]:
    """Return strips of any breadth, in any direction."""
    strips: list[Strip] = []
    for _ in range(robots):
        breadth = float(rng.uniform(0.15, 0.7))
        lo = float(rng.uniform(0.0, 1.0 - breadth))
        ends = (lo, lo + breadth) if rng.uniform() < 0.5 else (lo + breadth, lo)
        strips.append(Strip(*ends, float(rng.uniform(0.0, math.tau))))
    return strips


def _large_enough(robot: Explored) -> list[MapOf]:
    """Return the maps that show a room at least; the last in any case."""
    return [item for item in robot.maps if item.grid.known_area_m2 >= _LEAST_AREA_M2] or [robot.maps[-1]]


def _pair(name: str, found: Mission, robots: tuple[int, int], maps: tuple[MapOf, MapOf], truth: Shared) -> Pair:
    target, source = (found.robots[index] for index in robots)
    grids = maps[0].grid, maps[1].grid
    ambiguous = _is_ambiguous(found.site, target, source, grids, truth)
    return Pair(
        name,
        found.kind,
        *grids,
        truth.target_from_source,
        truth.centre_m,
        truth.overlap,
        truth.bend_m,
        ambiguous,
        "same place",
    )


def _is_ambiguous(site: Site, target: Explored, source: Explored, grids: tuple[Grid, Grid], truth: Shared) -> bool:
    looks = look(grids[0]), look(grids[1])
    moved = (target_from_source(target, source, symmetry) for symmetry in site.symmetries)
    if any(explains_as_well(*looks, truth.target_from_source, placement) for placement in moved):
        return True
    return has_rival(*looks, truth.target_from_source)


def _are_twins(grids: tuple[Grid, Grid], placement: Sim2) -> bool:
    looks = look(grids[0]), look(grids[1])
    return agreement(*looks, placement) >= _TWINS_ALIKE and shared_m2(*looks, placement) >= _LEAST_SHARED_M2


def _related(kind: str, first: Site, seed: int, related: Related, rng: Rng) -> Site:
    if related == "other building":
        return KINDS[kind](seed + _NEXT_SITE)
    other = altered(first, seed + _NEXT_SITE)
    if related == "next wing" and rng.uniform() < 0.5:
        return reflected(other, flip_x=True, flip_y=False)
    return other
