"""Part (c): published maps, all maps of a set merged together, and pair by pair."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from time import process_time

from benchmarks.methods import load_method
from benchmarks.published import MapSet, Names
from benchmarks.verdicts import Tolerance, Verdict, verdict
from mapmerge.config import MergeConfig
from mapmerge.grid import Grid
from mapmerge.merger import Merger
from mapmerge.sim2 import Sim2
from replay.placement_error import PlacementError, error_of
from samples.mission import known_at


@dataclass(frozen=True, slots=True)
class PairOutcome:
    """What one method made of one published pair."""

    method: str
    set_name: str
    target: str
    source: str
    verdict: Verdict
    reason: str
    error: PlacementError | None
    confidence: float | None
    seconds: float


@dataclass(frozen=True, slots=True)
class SetOutcome:
    """What the merger made of a set.

    Parameters
    ----------
    method, set_name
        Which.
    size
        How many maps the set has.
    together
        How many of them are in the largest component.
    least
        How many must be.
    worst
        The largest error of two maps in it whose truth is known; None if there are none.
    is_right
        Whether enough maps are together, all of them rightly.
    is_extra
        Whether it is reported only.
    """

    method: str
    set_name: str
    size: int
    together: int
    least: int
    worst: PlacementError | None
    is_right: bool
    is_extra: bool


def all_truths(maps: MapSet) -> dict[Names, Sim2]:
    """Return the truth of all pairs for which it is known, in the order of the maps, or follows from two others."""
    known = dict(maps.truth)
    known |= {(source, target): truth.inverse() for (target, source), truth in maps.truth.items()}
    found: dict[Names, Sim2] = {}
    for target, source in combinations(maps.grids, 2):
        ways = [
            known[target, via] @ known[via, source]
            for via in maps.grids
            if {(target, via), (via, source)} <= known.keys()
        ]
        direct = known.get((target, source))
        if direct is not None:
            found[target, source] = direct
        elif ways:
            found[target, source] = ways[0]
    return found


def pair_outcomes(maps: MapSet, method: str) -> list[PairOutcome]:
    """Match the pairs of a set one by one, those of which the truth is published."""
    place = load_method(method)
    outcomes: list[PairOutcome] = []
    for (target, source), truth in maps.truth.items():
        begin = process_time()
        placed = place(maps.grids[target], maps.grids[source])
        seconds = process_time() - begin
        found = placed.target_from_source
        error = None if found is None else _error(maps, (target, source), found, truth)
        allowed = Tolerance(maps.max_error_m, maps.max_error_deg)
        became = verdict(error, allowed, accepted=placed.accepted, belongs=True)
        reason, confidence = placed.reason, placed.confidence
        outcomes.append(PairOutcome(method, maps.name, target, source, became, reason, error, confidence, seconds))
    return outcomes


def set_outcome(maps: MapSet, method: str) -> SetOutcome:
    """Merge all maps of a set together."""
    result = Merger(list(maps.grids), MergeConfig(method=method)).step(maps.grids)
    placements = {robot: outcome.placement for robot, outcome in result.robots.items() if outcome.placement}
    components: dict[str, list[str]] = {}
    for robot, placement in placements.items():
        components.setdefault(placement.component, []).append(robot)
    largest = max(components.values(), key=len, default=[])
    truths = all_truths(maps)
    errors: list[PlacementError] = []
    for (one, two), truth in truths.items():
        if one in largest and two in largest:
            found = placements[one].component_from_map.inverse() @ placements[two].component_from_map
            errors.append(_error(maps, (one, two), found, truth))
    allowed = Tolerance(maps.max_error_m, maps.max_error_deg)
    worst = max(errors, key=lambda error: (not allowed.admits(error), error.distance_m), default=None)
    is_right = len(largest) >= maps.least and all(allowed.admits(error) for error in errors)
    return SetOutcome(method, maps.name, len(maps.grids), len(largest), maps.least, worst, is_right, maps.is_extra)


def _error(maps: MapSet, pair: Names, found: Sim2, truth: Sim2) -> PlacementError:
    return error_of(found, truth, overlap_centre_m(maps.grids[pair[0]], maps.grids[pair[1]], truth))


def overlap_centre_m(target: Grid, source: Grid, truth: Sim2) -> tuple[float, float]:
    """Return the middle of what both maps know, in the source's map frame; of what the source knows if nothing."""
    points = source.centres_m(source.known)
    both = known_at(target, truth.apply(points))
    x_m, y_m = (points[both] if both.any() else points).mean(axis=0).tolist()
    return x_m, y_m
