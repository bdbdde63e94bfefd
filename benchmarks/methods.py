"""Methods behind one small interface: two maps in, a placement out. All rows of `MATCHERS`, and recipes to compare."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module

import cv2

from mapmerge.config import MergeConfig
from mapmerge.grid import Grid
from mapmerge.match import MATCHERS, load_matcher
from mapmerge.sim2 import Sim2

DEFAULT = MergeConfig().method

RECIPES: Mapping[str, str] = {
    "orb": "benchmarks.recipes:orb",
    "sift": "benchmarks.recipes:sift",
    "hough": "benchmarks.hough:hough_spectra",
    "m-explore": "benchmarks.m_explore:orb",
    **({"m-explore-akaze": "benchmarks.m_explore:akaze"} if hasattr(cv2, "AKAZE") else {}),
}


@dataclass(frozen=True, slots=True)
class Placed:
    """What a method says of a pair.

    Parameters
    ----------
    target_from_source
        Its best placement between the map frames, taken or not; None if it has none.
    accepted
        Whether it takes it.
    reason
        What decided, in a word.
    confidence
        Probability that the placement is right; None if the method states none.
    """

    target_from_source: Sim2 | None
    accepted: bool
    reason: str
    confidence: float | None = None


Method = Callable[[Grid, Grid], Placed]


def names() -> tuple[str, ...]:
    """Return the names of all methods: the matchers, the default first, then the recipes."""
    return (DEFAULT, *sorted(set(MATCHERS) - {DEFAULT}), *RECIPES)


def load_method(name: str) -> Method:
    """Return the method of this name."""
    if name in RECIPES:
        module, _, attribute = RECIPES[name].partition(":")
        recipe: Method = getattr(import_module(module), attribute)
        return recipe
    return _matcher(name)


def _matcher(name: str) -> Method:
    matcher, config = load_matcher(name), MergeConfig(method=name)

    def place(target: Grid, source: Grid) -> Placed:
        resolution_m = max(config.search.working_cell_m, target.resolution_m, source.resolution_m)
        prepared = [matcher.prepare(grid, resolution_m, config) for grid in (target, source)]
        match = matcher.match(prepared[0], prepared[1], config)
        return Placed(match.target_from_source, match.accepted, match.reason.code.value, match.confidence)

    return place
