"""How long it takes to match two maps from nothing, against simpler work on them: ``python -m benchmarks.speed``.

Two maps of about so many cells a side (`benchmarks.large`), medians of processor time of some rounds in which the
contestants take turns in one process, with one thread of OpenCV. Ratios say more than seconds, which differ from
machine to machine.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from statistics import median
from time import process_time

import cv2
import numpy as np

from benchmarks.large import large_pair
from benchmarks.methods import DEFAULT, Placed, load_method
from benchmarks.recipes import raw_image
from mapmerge.grid import Grid

SIDES = (400, 800, 1500, 3000)
OURS, SIFT = DEFAULT, "one SIFT"
_OTHERS = ("one FFT", "ORB recipe")

Contestant = Callable[[], object]


def sift_once(grid: Grid) -> None:
    """Compute the features of one raw map, and no more."""
    cv2.SIFT.create().detectAndCompute(raw_image(grid), None)


def transform_once(grid: Grid) -> None:
    """Transform one map, padded to twice its sides, as any correlation of two such maps must."""
    rows, cols = (cv2.getOptimalDFTSize(2 * side) for side in grid.cells.shape)
    padded = np.zeros((rows, cols), np.float32)
    padded[: grid.cells.shape[0], : grid.cells.shape[1]] = grid.cells
    cv2.dft(padded)


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


def timed(taking_turns: Mapping[str, Contestant], rounds: int) -> dict[str, float]:
    """Return the median processor time of each, in seconds; a first round does not count."""
    seconds: dict[str, list[float]] = {name: [] for name in taking_turns}
    for number in range(rounds + 1):
        for name, run in taking_turns.items():
            begin = process_time()
            run()
            if number:
                seconds[name].append(process_time() - begin)
    return {name: median(values) for name, values in seconds.items()}


def header() -> str:
    """Return the first line of the table."""
    ratios = "".join(f"{'to ' + name:>14}" for name in (SIFT, *_OTHERS))
    return f"{'cells':<24}{'match':>9}{ratios}  outcome"


def line(target: Grid, source: Grid, rounds: int) -> str:
    """Return one line of the table: the median time of a match, and its ratios."""
    taking_turns = contestants(target, source)
    outcome = taking_turns[OURS]()
    seconds = timed(taking_turns, rounds)
    ratios = "".join(f"{seconds[OURS] / seconds[name]:>14.2f}" for name in (SIFT, *_OTHERS))
    sizes = " and ".join("×".join(map(str, grid.cells.shape[::-1])) for grid in (target, source))
    said = outcome.reason if isinstance(outcome, Placed) else ""
    return f"{sizes:<24}{seconds[OURS] * 1e3:>6.0f} ms{ratios}  {said}"


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else None)
    parser.add_argument("--sides", type=int, nargs="+", default=SIDES, help="cells a side")
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args(arguments)
    if options.rounds < 1:
        parser.error(f"--rounds {options.rounds}: expected 1 or more")
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        print(header())
        for side in options.sides:
            print(line(*large_pair(side), options.rounds), flush=True)
    finally:
        cv2.setNumThreads(threads)


if __name__ == "__main__":
    main()
