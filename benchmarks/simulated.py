"""Part (b): methods on simulated pairs with known truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from time import process_time

import cv2

from benchmarks.cases import Case
from benchmarks.methods import load_method
from benchmarks.recipes import raw_image
from benchmarks.verdicts import Verdict, tolerance, verdict
from replay.placement_error import error_of
from samples.pairs import Pair


@dataclass(frozen=True, slots=True)
class Result:
    """What one method made of one pair.

    Parameters
    ----------
    method, name, kind, related
        Which.
    overlap, ambiguous, bend_m, cell_m
        Of the pair, see `samples.pairs.Pair`; the cell is the coarser map's.
    verdict, reason
        What became of it, and what the method says decided.
    is_there, is_right
        Whether the best placement, taken or not, is the right place, and whether it is within the tolerance; None
        without a placement.
    error_m, error_deg
        Of the best placement; None without one, or without a truth.
    confidence
        As the method states it for the best placement.
    seconds, sift_seconds
        Processor time of the method, with all it prepares of both maps; of one `SIFT.detectAndCompute` on the larger
        raw map.
    """

    method: str
    name: str
    kind: str
    related: str
    overlap: float
    ambiguous: bool
    bend_m: float
    cell_m: float
    verdict: Verdict
    reason: str
    is_there: bool | None
    is_right: bool | None
    error_m: float | None
    error_deg: float | None
    confidence: float | None
    seconds: float
    sift_seconds: float


def results(case: Case, methods: Sequence[str]) -> list[Result]:
    """Return what each method makes of a case."""
    pair = case.made()
    sift_seconds = sift_time_s(pair)
    return [judged(pair, method, sift_seconds) for method in methods]


def sift_time_s(pair: Pair) -> float:
    """Return how long SIFT takes for the larger map: the yardstick of all times."""
    larger = max((pair.target, pair.source), key=lambda grid: grid.cells.size)
    image = raw_image(larger)
    begin = process_time()
    cv2.SIFT.create().detectAndCompute(image, None)
    return process_time() - begin


def judged(pair: Pair, method: str, sift_seconds: float) -> Result:
    """Return what a method makes of a pair."""
    place = load_method(method)
    begin = process_time()
    placed = place(pair.target, pair.source)
    seconds = process_time() - begin
    cell_m = max(pair.target.resolution_m, pair.source.resolution_m)
    allowed = tolerance(cell_m, pair.bend_m)
    found = placed.target_from_source
    error = None if found is None or pair.truth is None else error_of(found, pair.truth, pair.centre_m)
    return Result(
        method=method,
        name=pair.name,
        kind=pair.kind,
        related=pair.related,
        overlap=pair.overlap,
        ambiguous=pair.ambiguous,
        bend_m=pair.bend_m,
        cell_m=cell_m,
        verdict=verdict(error, allowed, accepted=placed.accepted, belongs=pair.truth is not None),
        reason=placed.reason,
        is_there=None if found is None else error is not None and not error.is_elsewhere,
        is_right=None if found is None else error is not None and allowed.admits(error),
        error_m=None if error is None else error.distance_m,
        error_deg=None if error is None else error.angle_deg,
        confidence=placed.confidence,
        seconds=seconds,
        sift_seconds=sift_seconds,
    )
