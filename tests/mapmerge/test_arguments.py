"""Arguments of another kind: refused in one line, as an error of this library, where they are given."""

import math
import re

import numpy as np
import pytest

import mapmerge
from mapmerge import ConfigError, Grid, GridError, MapMergeError, MergeConfig, Merger, Prior, Sim2
from tests.floors import flat

CELLS = np.zeros((3, 4), np.int8)
GRID = Grid(CELLS, 0.05)


@pytest.mark.parametrize(
    ("call", "error", "said"),
    [
        (lambda: Grid("map.pgm", 0.05), GridError, "cells are 'map.pgm'; expected an array of int8 [rows, columns]"),
        (lambda: Grid(CELLS.tolist(), 0.05), GridError, "cells are [[0, 0, 0, 0],"),
        (lambda: Grid(CELLS, "0.05"), GridError, "resolution is '0.05'; expected a number of metres"),
        (lambda: Grid(CELLS, None), GridError, "resolution is None; expected a number of metres"),
        (lambda: Grid(CELLS, 10**400), GridError, "resolution is 1000"),
        (lambda: Grid(CELLS, 0.05, (1, 2, 3)), GridError, "the origin is (1, 2, 3); expected Sim2(x_m, y_m, yaw_rad)"),
        (lambda: Sim2("1"), MapMergeError, "x_m is '1'; expected a number"),
        (lambda: Sim2(yaw_rad=None), MapMergeError, "yaw_rad is None; expected a number"),
        (lambda: Sim2(yaw_rad=math.inf), MapMergeError, "yaw_rad is inf; expected a finite number"),
        (lambda: Sim2(yaw_rad=10**400), MapMergeError, "yaw_rad is 1000"),
        (lambda: Sim2(scale=True), MapMergeError, "scale is True; expected a number"),
        (lambda: Sim2(scale=-1.0), MapMergeError, "scale is -1.0; expected a positive number"),
        (lambda: Prior((1, 2, 3), 1, 1, 1), ConfigError, "target_from_source is (1, 2, 3); expected Sim2(x_m, "),
        (lambda: Prior(Sim2(), 1, "1", 1), ConfigError, "sigma_y_m is '1'; expected a number that is not negative"),
        (lambda: Prior(Sim2(), 1, 1, -0.1), ConfigError, "sigma_yaw_rad is -0.1; expected a number that is not neg"),
        (lambda: Prior(Sim2(), math.nan, 1, 1), ConfigError, "sigma_x_m is nan; expected a number"),
        (lambda: Prior(Sim2(), 1, 1, 1, None), ConfigError, "origin is None; expected a text"),
        (lambda: Merger("r1"), ConfigError, "robots are 'r1'; expected a list of names, such as ['r1', 'r2']"),
        (lambda: Merger(5), ConfigError, "robots are 5; expected a list of names"),
        (lambda: Merger([1, 2]), ConfigError, "robots are [1, 2]; expected a list of names"),
        (lambda: Merger(["r1"], "paper"), ConfigError, "config is 'paper'; expected a MergeConfig"),
        (lambda: Merger(["r1"]).step({"r1": CELLS}), GridError, "the map of r1 is array([[0, 0"),
        (lambda: Merger(["r1"]).step(GRID), ConfigError, "maps are <Grid of"),
        (lambda: Merger(["r1"]).step({1: GRID}), ConfigError, "there are maps of 1; expected only maps of r1"),
        (lambda: Merger(["r1"]).step({}, [Sim2()]), ConfigError, "priors are [Sim2("),
        (lambda: Merger(["r1"]).step({}, {"r1": Sim2()}), ConfigError, "the prior of r1 is Sim2("),
        (lambda: mapmerge.merge("ab"), ConfigError, "grids are 'ab'; expected several maps"),
        (lambda: mapmerge.merge(GRID), ConfigError, "grids are <Grid of"),
        (lambda: mapmerge.merge(None), ConfigError, "grids are None; expected several maps"),
        (
            lambda: mapmerge.merge([[[1], [1, 2]]], resolution_m=0.05),
            GridError,
            "map0 is [[1], [1, 2]]; expected a Grid",
        ),
        (lambda: mapmerge.merge([CELLS], resolution_m="a"), GridError, "resolution is 'a'; expected a number"),
        (lambda: mapmerge.merge([GRID], {"method": "paper"}), ConfigError, "config is {'method': 'paper'}; expected a"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_refused_in_one_line(call, error, said):
    with pytest.raises(error, match=f"^{re.escape(said)}") as refused:
        call()
    assert "\n" not in str(refused.value)
    assert len(str(refused.value)) < 200


def test_what_was_refused_leaves_a_merger_as_it_was():
    merger = Merger(["r1", "r2"], MergeConfig())
    merger.step({"r1": flat()})
    before = merger.result
    with pytest.raises(GridError, match=r"expected a Grid, such as Grid\(cells, resolution_m\)"):
        merger.step({"r2": flat(), "r1": flat().cells})
    assert merger.result is before


def test_numbers_of_numpy_are_numbers():
    grid = Grid(CELLS, np.float32(0.5), Sim2(np.float64(1.0), np.int64(2), np.float32(0.0)))
    assert grid.centres_m(grid.known)[0].tolist() == [1.25, 2.25]
    assert Prior(Sim2(), np.float64(1.0), 1, math.inf).allows(Sim2(2.0))
