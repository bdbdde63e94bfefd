"""The authors' own maps: what the benchmark measures must stay so."""

import math

import pytest

from benchmarks.paper_cases import MAX_ERROR_DEG, MAX_ERROR_M, Case, errors, load_map, run
from mapmerge.config import MergeConfig
from mapmerge.merger import Merger
from mapmerge.reasons import ReasonCode
from mapmerge.sim2 import Sim2
from tests.data_paths import shared_data

PAPER = MergeConfig(method="paper")

# by the exhaustive alignment of the benchmark, between the map frames
SCENARIO_1 = {
    "map2": Sim2(26.06, -1.94, math.radians(115.23)),
    "map3": Sim2(20.94, 28.39, math.radians(172.64)),
    "map4_sigma01": Sim2(20.93, 26.63, math.radians(172.07)),
}
SCENARIO_2 = {"y1": Sim2(-0.22, -1.02, math.radians(0.63)), "y2": Sim2(-0.01, 13.71, math.radians(-0.19))}


def middle_m(grid):
    known_m = grid.centres_m(grid.known)
    return tuple(known_m.mean(axis=0).tolist())


def case(target_name, source_name, truth):
    folder = shared_data("paper")
    target, source = (load_map(folder, f"scenario1_{name}") for name in (target_name, source_name))
    return Case(source_name, target_name, source_name, target, source, truth, None, middle_m(source))


@pytest.mark.parametrize("name", SCENARIO_1)
def test_the_paper_method_places_the_maps_of_scenario_1(name):
    outcome = run(case("map1", name, SCENARIO_1[name]), PAPER)
    assert outcome.right
    assert outcome.match.accepted


@pytest.mark.parametrize(("name", "right"), [("map2", True), ("map3", False), ("map4_sigma01", False)])
def test_the_existing_method_succeeds_and_fails_as_in_the_paper(name, right):
    outcome = run(case("map1", name, SCENARIO_1[name]), MergeConfig(method="existing"))
    assert outcome.match.accepted == outcome.right == right


def test_three_maps_are_placed_though_two_of_them_look_alike():
    """y1 on y2 directly is a false merge that ω alone accepts; the placement by way of y3 is trusted more."""
    folder = shared_data("paper")
    grids = {name: load_map(folder, f"scenario2_{name}") for name in ("y1", "y2", "y3")}
    result = Merger(["y3", "y1", "y2"], PAPER).step(grids)
    for name, truth in SCENARIO_2.items():
        found = result.robots[name].merged_from_map
        error_m, error_deg = errors(found, truth, middle_m(grids[name]))
        assert error_m < MAX_ERROR_M
        assert error_deg < MAX_ERROR_DEG
    assert result.pairs["y1", "y2"].reason.code is ReasonCode.INCONSISTENT
