"""The last maps of each real recording, pair by pair, by all methods: ``python -m benchmarks.last_maps``.

The pipeline takes matchers only; here recipes, as that of m-explore, are given the same maps.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.data import VARIABLE, data_folder
from benchmarks.methods import load_method, names
from benchmarks.recordings import BENT, RECORDINGS, last_grids
from benchmarks.verdicts import MAX_ERROR_CELLS, MAX_ERROR_CELLS_BENT, Tolerance, Verdict, verdict
from mapmerge.grid import Grid
from mapmerge.sim2 import IDENTITY, Sim2
from replay.evaluation.truth import load_truth
from replay.placement_error import error_of

_SHORT = {
    Verdict.PLACED: "placed",
    Verdict.INEXACT: "inexact",
    Verdict.WRONG: "WRONG",
    Verdict.MISSED: "refused, though they belong together",
    Verdict.FALSE_MERGE: "FALSE MERGE",
    Verdict.REFUSED: "refused, rightly",
}


@dataclass(frozen=True, slots=True, eq=False)
class LastPair:
    """Two last maps of a recording.

    Parameters
    ----------
    target_from_source
        The truth; None if the maps are of two places.
    centre_m
        Where errors are measured, in the source's map frame.
    """

    recording: str
    robots: tuple[str, str]
    target: Grid
    source: Grid
    target_from_source: Sim2 | None
    centre_m: tuple[float, float]
    allowed: Tolerance


def pairs(path: Path) -> Iterator[LastPair]:
    """Yield the pairs of the reference's last map and each other robot's."""
    name = path.name.partition(".")[0]
    truths = load_truth(path.parent / f"{name}.truth.json").robots
    grids = last_grids(path)
    reference = next(iter(grids))
    for robot, truth in truths.items():
        if robot == reference:
            continue
        cells = MAX_ERROR_CELLS_BENT if name in BENT else MAX_ERROR_CELLS
        allowed = Tolerance(cells * max(grids[reference].resolution_m, grids[robot].resolution_m))
        pose = truth.reference_from_map
        yield LastPair(path.name, (reference, robot), grids[reference], grids[robot], pose, truth.at_m, allowed)


def row(pair: LastPair, method: str) -> tuple[str, ...]:
    """Return what became of a pair, for the table."""
    placed = load_method(method)(pair.target, pair.source)
    error = None
    if placed.target_from_source is not None:
        error = error_of(placed.target_from_source, pair.target_from_source or IDENTITY, pair.centre_m)
    belongs = pair.target_from_source is not None
    found = verdict(error, pair.allowed, accepted=placed.accepted, belongs=belongs)
    off = f"{error.distance_m:.3f} m {error.angle_deg:.2f}°" if placed.accepted and belongs and error else placed.reason
    return pair.recording, " ".join(pair.robots), method, _SHORT[found], off


def _show(rows: Sequence[tuple[str, ...]]) -> None:
    """Print rows in columns."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for each in rows:
        print("  ".join(f"{cell:{width}}" for cell, width in zip(each, widths, strict=True)).rstrip())


def main() -> int:
    """Print the table."""
    argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0]).parse_args()
    folder = data_folder()
    if folder is None:
        print(f"there are no recordings; set {VARIABLE} to the folder that holds real/", file=sys.stderr)
        return 2
    found = [pair for name in RECORDINGS for pair in pairs(folder / "real" / name)]
    rows = [row(pair, method) for pair in found for method in names()]
    _show([("recording", "maps", "method", "outcome", "error or reason"), *rows])
    counted = [
        (method, *(str(sum(r[2] == method and r[3] == _SHORT[kind] for r in rows)) for kind in Verdict))
        for method in names()
    ]
    print()
    _show([("method", *(kind.value for kind in Verdict)), *counted])
    return 0


if __name__ == "__main__":
    sys.exit(main())
