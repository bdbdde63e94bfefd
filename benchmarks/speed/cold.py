"""Two large maps matched from nothing, against simpler work on them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import cv2
import numpy as np

from benchmarks.large import large_pair
from benchmarks.methods import DEFAULT, Placed, load_method
from benchmarks.recipes import raw_image
from benchmarks.speed.options import Options
from benchmarks.speed.printed import Table, ratio, seconds
from benchmarks.speed.timing import Contestant, timed
from mapmerge.grid import Grid

OURS, SIFT = DEFAULT, "one SIFT"
_OTHERS = ("one FFT", "ORB recipe")
TABLE = Table(24, ("cells", "match", *(f"to {name}" for name in (SIFT, *_OTHERS)), "outcome"))


def lines(options: Options) -> Iterator[str]:
    """Yield the lines of the section."""
    yield TABLE.header
    for side in options.sides:
        yield line(*large_pair(side), options.rounds)


def line(target: Grid, source: Grid, rounds: int) -> str:
    """Return one line of the table: the median time of a match, and its ratios."""
    taking_turns = contestants(target, source)
    outcome = taking_turns[OURS]()
    taken_s = timed(taking_turns, rounds)
    ratios = [ratio(taken_s[OURS] / taken_s[name]) for name in (SIFT, *_OTHERS)]
    sizes = " and ".join("×".join(map(str, grid.cells.shape[::-1])) for grid in (target, source))
    said = outcome.reason if isinstance(outcome, Placed) else ""
    return TABLE.row(sizes, seconds(taken_s[OURS]), *ratios, said)


def contestants(target: Grid, source: Grid) -> Mapping[str, Contestant]:
    """Return what takes turns: each gets what was recorded, and makes all else itself."""
    larger = max((target, source), key=lambda grid: grid.cells.size)
    ours, orb = load_method(DEFAULT), load_method("orb")
    return {
        OURS: lambda: ours(target, source),
        SIFT: lambda: sift_once(larger),
        "one FFT": lambda: transform_once(larger),
        "ORB recipe": lambda: orb(target, source),
    }


def sift_once(grid: Grid) -> None:
    """Compute the features of one raw map, and no more."""
    cv2.SIFT.create().detectAndCompute(raw_image(grid), None)


def transform_once(grid: Grid) -> None:
    """Transform one map, padded to twice its sides, as any correlation of two such maps must."""
    rows, cols = (cv2.getOptimalDFTSize(2 * side) for side in grid.cells.shape)
    padded = np.zeros((rows, cols), np.float32)
    padded[: grid.cells.shape[0], : grid.cells.shape[1]] = grid.cells
    cv2.dft(padded)
