"""The merger as the benchmarks use it: all that there is to change here when its interface does."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from mapmerge.config import MergeConfig
from mapmerge.grid import Grid
from mapmerge.merger import MergeResult, MergeState, step

Step = Callable[[Mapping[str, Grid]], MergeResult]


def merger(robots: Sequence[str]) -> Step:
    """Return a function that takes new maps in and returns what is known then; the first robot is the reference."""
    config = MergeConfig()
    state = MergeState.initial(robots)

    def take(grids: Mapping[str, Grid]) -> MergeResult:
        nonlocal state
        state, result = step(state, grids, config)
        return result

    return take
