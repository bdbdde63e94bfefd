"""Settings: whatever one is given, it is refused in one line, or maps are merged with it without an exception."""

import math
import warnings
from dataclasses import replace
from typing import get_args, get_origin

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mapmerge.config import MergeConfig
from mapmerge.errors import ConfigError
from mapmerge.grid import Grid
from mapmerge.match import MATCHERS
from mapmerge.merger import Merger
from mapmerge.render import render
from mapmerge.settings import MOST, Settings, Within, types_of
from tests.floors import flat

FEW = max(4, settings().max_examples // 10)
ODD = [-1, -0.5, math.nan, math.inf, -math.inf, 1e300, 10**400, 10**5000, [], (), "x", "", b"x", None, {}, True, {1}]
USUAL = [0, 1, 2, 0.5, 1e-9, 1e-300, 1e9, MOST]
ONE = flat()
OTHER = Grid(np.rot90(ONE.cells[:, ONE.cols // 4 :]).copy(), ONE.resolution_m)


def leaves(kind, above=()):
    for name, found in types_of(kind).items():
        if isinstance(found, type) and issubclass(found, Settings):
            yield from leaves(found, (*above, name))
        else:
            yield (*above, name), found


LEAVES = dict(leaves(MergeConfig))


def changed(config, path, value):
    name, *rest = path
    return replace(config, **{name: changed(getattr(config, name), rest, value) if rest else value})


def limits(found):
    """Return the ends of the ranges that a type declares, and what lies just beyond."""
    for part in get_args(found):
        if isinstance(part, Within):
            yield from (part.low, math.nextafter(part.low, math.inf), part.high, math.nextafter(part.high, math.inf))
            yield from (int(part.high), int(part.high) + 1)
        else:
            yield from limits(part)


def values(found):
    numbers = st.sampled_from([*USUAL, *limits(found)])
    plain = st.one_of(numbers, st.sampled_from(ODD))
    if get_origin(found) is not tuple:
        return plain
    return st.one_of(st.sampled_from(ODD), numbers.map(lambda each: (each, each)), st.lists(plain, max_size=3))


def taken(base, path, value):
    """Return settings with a value in place; None if it is refused, in one line."""
    try:
        return changed(base, path, value)
    except ConfigError as error:
        said = str(error)
    assert "\n" not in said
    assert len(said) < 250
    return None


def merge_all(config):
    merger = Merger(["a", "b"], config)
    merger.step({"a": ONE, "b": Grid(OTHER.cells[: OTHER.rows // 2], OTHER.resolution_m)})
    result = merger.step({"b": OTHER}, is_last=True)
    for pair in result.pairs:
        for evidence in merger.explain(pair):
            render(evidence)


@pytest.mark.parametrize("path", LEAVES, ids=".".join)
def test_any_value_is_refused_or_maps_are_merged_with_it(path):
    method = path[0] if path[0] in MATCHERS else "correlation"
    base = MergeConfig(method=method, scale="free" if "scale" in path[-1] else "metadata")
    tried = set()

    @settings(max_examples=FEW)
    @given(values(LEAVES[path]))
    def check(value):
        config = taken(base, path, value)
        if config is not None and config.method in MATCHERS and config not in tried:
            tried.add(config)
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                merge_all(config)

    check()
