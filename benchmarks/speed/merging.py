"""The merger as the benchmarks use it: all that there is to change here when its interface does."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from mapmerge.grid import Grid
from mapmerge.merger import Merger
from mapmerge.result import MergeResult

Step = Callable[[Mapping[str, Grid]], MergeResult]


def merger(robots: Sequence[str]) -> Step:
    """Return a function that takes new maps in and returns what is known then; the first robot is the reference."""
    return Merger(robots).step
