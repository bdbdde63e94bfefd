from __future__ import annotations

import numpy as np
import pytest

from mapmerge.config import MergeConfig
from mapmerge.extents import Extent, first_too_large
from mapmerge.fuse import fuse
from mapmerge.grid import Grid
from mapmerge.match import Match
from mapmerge.merger import Merger
from mapmerge.outcome import Status
from mapmerge.reasons import Reason, ReasonCode
from mapmerge.sim2 import IDENTITY, Sim2
from mapmerge.warp import Layer
from tests.floors import filled, flat


def line(cells: int, resolution_m: float = 0.05, *, upright: bool = False) -> Grid:
    """Return a map of one wall: many cells long, so that a merged map may be large though the maps are small."""
    wall = np.full((1, cells), 100, np.int8)
    return Grid(np.ascontiguousarray(wall.T) if upright else wall, resolution_m)


@pytest.mark.parametrize("pose", [IDENTITY, Sim2(3.0, -2.0, 0.7), Sim2(100.0, 5.0, -2.0, 1.5)])
def test_no_merged_map_is_larger_than_was_told(pose: Sim2) -> None:
    grids = {"a": filled(100, 40, 60), "b": filled(100, 50, 20, resolution_m=0.08)}
    told = Extent.of(grids["a"], IDENTITY).union(Extent.of(grids["b"], pose))
    merged = fuse([Layer(grids["a"], IDENTITY), Layer(grids["b"], pose)], grids["a"], MergeConfig().cells).grid
    cols, rows = told.sides_cells
    assert cols - 2 <= merged.cols <= cols + 2
    assert rows - 2 <= merged.rows <= rows + 2


def test_a_map_alone_is_never_too_large() -> None:
    assert first_too_large({"a": filled(0, 300, 300)}, [("a", IDENTITY)], 1000) is None


@pytest.mark.parametrize(
    ("other", "pose"),
    [
        (line(50_000, upright=True), IDENTITY),
        (line(50_000), Sim2(0.0, 0.0, 0.8)),
        (filled(0, 40, 40), Sim2(0.0, 2000.0)),
        (filled(0, 100, 100, resolution_m=10.0), IDENTITY),
        (filled(0, 5, 5, resolution_m=0.0001), IDENTITY),
    ],
    ids=["across", "turned", "far", "coarse", "fine"],
)
def test_maps_of_few_cells_that_would_make_a_large_one(other: Grid, pose: Sim2) -> None:
    found = first_too_large({"a": line(50_000), "b": other}, [("a", IDENTITY), ("b", pose)], 100_000_000)
    assert found is not None
    assert found[0] == "b"


class Convinced:
    """A method that accepts any placement that it is told."""

    def __init__(self, pose: Sim2) -> None:
        self.pose = pose

    def prepare(self, grid: Grid, resolution_m: float, config: MergeConfig) -> Grid:
        del resolution_m, config
        return grid

    update = None

    def renewed(self, prepared: Grid) -> Grid:
        return prepared

    def match(self, target: Grid, source: Grid, config: MergeConfig, prior: None = None) -> Match:
        del target, source, config, prior
        return Match(self.pose, None, accepted=True, reason=Reason(ReasonCode.ACCEPTED, "told so"), confidence=0.99)


def merged(grids: dict[str, Grid], pose: Sim2, monkeypatch: pytest.MonkeyPatch, **settings: int) -> Merger:
    monkeypatch.setattr("mapmerge.merger.load_matcher", lambda _name: Convinced(pose))
    merger = Merger(list(grids), MergeConfig(**settings))
    merger.step(grids, is_last=True)
    return merger


def test_a_placement_that_makes_it_too_large_is_refused_and_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    result = merged({"a": line(90_000), "b": line(90_000, upright=True)}, IDENTITY, monkeypatch).result
    outcome = result.robots["b"]
    assert outcome.status is Status.UNMERGED
    assert outcome.reason.code is ReasonCode.TOO_LARGE
    assert "90000 × 90000 cells; at most 1000000000" in outcome.reason.message
    assert result.merged is not None
    assert result.merged.cells.shape == (1, 90_000)


def test_the_limit_can_be_set(monkeypatch: pytest.MonkeyPatch) -> None:
    grids = {"a": flat(), "b": flat(), "c": flat()}
    both = merged(grids, Sim2(20.0), monkeypatch).result
    assert both.robots["c"].status is Status.MERGED
    assert both.merged is not None
    few = merged(grids, Sim2(20.0), monkeypatch, max_canvas_cells=2 * grids["a"].cells.size).result
    assert {outcome.reason.code for outcome in few.robots.values()} >= {ReasonCode.TOO_LARGE}
    assert few.merged is not None
    assert few.merged.cells.size <= 2 * grids["a"].cells.size


def test_a_side_has_only_so_many_cells(monkeypatch: pytest.MonkeyPatch) -> None:
    """More than any grid may have: it was an error before."""
    result = merged({"a": line(60_000), "b": line(60_000)}, Sim2(2_900.0), monkeypatch).result
    assert result.robots["b"].reason.code is ReasonCode.TOO_LARGE
