"""Maps that others published: what they are, and the truth between them as far as it is known."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from benchmarks.exhaustive import exhaustive
from benchmarks.paper_cases import load_map
from mapmerge.grid import Grid
from mapmerge.sim2 import Sim2
from replay.events import Merged
from replay.options import RunOptions
from replay.pipeline import merge
from replay.runs import RunPath

Names = tuple[str, str]

PAPER_SETS: Mapping[str, tuple[str, ...]] = {
    "paper set 1": ("scenario1_map1", "scenario1_map2"),
    "paper set 2": ("scenario1_map1", "scenario1_map3"),
    "paper set 3, σ 0.01": ("scenario1_map1", "scenario1_map4_sigma01"),
}
BENT_SET = ("paper set 3, σ 0.05", ("scenario1_map1", "scenario1_map4_sigma05"))
WINGS = ("scenario2_y3_1", "scenario2_y1_1", "scenario2_y2_1")
FLATS = ("HIH", "KPT4A")
PIXEL_M = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class MapSet:
    """Maps of one place, to be merged together.

    Parameters
    ----------
    name
        Of the set.
    grids
        Name of each map and the map, the reference first.
    truth
        target_from_source between map frames, for the pairs (target, source) for which it is known.
    least
        How many of the maps must be in one component.
    max_error_m, max_error_deg
        How far off a placement may be.
    is_extra
        Whether it is reported, but no criterion.
    """

    name: str
    grids: Mapping[str, Grid]
    truth: Mapping[Names, Sim2]
    least: int
    max_error_m: float
    max_error_deg: float
    is_extra: bool = False


def saved_map(path: Path) -> Grid:
    """Read the map that a ``map.yaml`` describes."""
    for event in merge(RunOptions(runs=(RunPath(None, path),), images="none")):
        if isinstance(event, Merged):
            return next(iter(event.result.grids.values()))
    raise AssertionError("a saved map is one message")


def map_sets(folder: Path) -> list[MapSet]:
    """Read all published maps."""
    flats = [_flat(folder / "halmstad", flat) for flat in FLATS]
    return [*_paper(folder / "paper"), _sunil(folder / "sunil"), *flats]


def _paper(folder: Path) -> list[MapSet]:
    """Return the sets of the paper's authors, who published no transforms: truth is an exhaustive search's."""
    sets = [
        _searched(name, {item: load_map(folder, item) for item in items}, [(items[0], items[1])])
        for name, items in PAPER_SETS.items()
    ]
    # This map is bent by metres: its walls meet at odd angles. There is no rigid placement to hold a method to.
    bent = _searched(BENT_SET[0], {item: load_map(folder, item) for item in BENT_SET[1]}, [BENT_SET[1]])
    sets.append(replace(bent, max_error_m=1.0, max_error_deg=5.0, is_extra=True))
    wings = {name: load_map(folder, name) for name in WINGS}
    return [*sets, _searched("paper wings", wings, [(WINGS[0], WINGS[1]), (WINGS[0], WINGS[2])])]


def _searched(name: str, grids: Mapping[str, Grid], pairs: Sequence[Names]) -> MapSet:
    truth = {(target, source): exhaustive(grids[target], grids[source]) for target, source in pairs}
    return MapSet(name, grids, truth, len(grids), max_error_m=0.2, max_error_deg=1.0)


def _sunil(folder: Path) -> MapSet:
    """Return the pair of Sunil et al. 2023, whose truth is in pixels with rows downwards."""
    grids = {name: saved_map(folder / f"{name}.yaml") for name in ("demo_1", "demo_2")}
    first, second = grids.values()
    turn_rad = math.radians(2.25)
    low_x, low_y = Sim2(yaw_rad=-turn_rad).apply_point(0.0, second.rows * PIXEL_M)
    grid_from_grid = Sim2(-133.65 * PIXEL_M + low_x, (first.rows - 163.36) * PIXEL_M - low_y, turn_rad)
    truth = first.map_from_grid @ grid_from_grid @ second.map_from_grid.inverse()
    return MapSet("sunil", grids, {("demo_1", "demo_2"): truth}, 2, max_error_m=0.25, max_error_deg=2.0)


def _flat(folder: Path, flat: str) -> MapSet:
    """Return the four maps of a flat at Halmstad, which are bent: within 25 pixels and 3° is right."""
    names = [f"{flat}_{number:02d}" for number in range(1, 5)]
    grids = {name: saved_map(folder / flat / f"{name}.yaml") for name in names}
    truth: dict[Names, Sim2] = {}
    with (folder / "truth_px_y_up.csv").open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            if row["src"] in grids and row["dst"] in grids:
                x_m, y_m = (float(row[key]) * PIXEL_M for key in ("rigid_tx", "rigid_ty"))
                grid_from_grid = Sim2(x_m, y_m, math.radians(float(row["rigid_rot_deg"])))
                pair = (row["dst"], row["src"])
                frames = grids[pair[0]].map_from_grid, grids[pair[1]].map_from_grid
                truth[pair] = frames[0] @ grid_from_grid @ frames[1].inverse()
    return MapSet(f"halmstad {flat}", grids, truth, 3, max_error_m=25.0 * PIXEL_M, max_error_deg=3.0)
