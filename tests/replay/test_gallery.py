from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import pytest

from mapmerge.grid import Grid
from mapmerge.merger import Merger
from mapmerge.render import Picture
from replay.gallery import Gallery
from replay.options import ImageChoice
from tests.runs import bare_room, flat_map

STEPS = ["orientation_spectra", "correlation_surface", "overlay"]
RUN: tuple[Mapping[str, Grid], ...] = (
    {"r1": flat_map("r1")},
    {"r2": flat_map("r2", 1.0)},
    {"r1": flat_map("r1")},
    {"r2": flat_map("r2")},
    {"r3": flat_map("r3")},
    {"r3": flat_map("r3")},
)


def shown(choice: ImageChoice, run: tuple[Mapping[str, Grid], ...] = RUN) -> list[dict[str, list[str]]]:
    """Return the steps shown for each robot after each step of a run."""
    merger = Merger(["r1", "r2", "r3"])
    gallery, found = Gallery(choice, merger.explain), []
    for grids in run:
        result = merger.step(grids)
        pictures: dict[str, list[str]] = {}
        for item in gallery.due(result):
            assert item.picture.rgb.dtype == "uint8"
            assert max(item.picture.rgb.shape) <= 1024
            pictures.setdefault(item.robot, []).append(item.picture.step)
        found.append(pictures)
    return found


def test_none() -> None:
    assert shown("none") == [{}] * len(RUN)


def test_changed() -> None:
    assert shown("changed") == [{}, {"r2": STEPS}, {}, {"r2": STEPS}, {"r3": STEPS}, {}]


def test_all() -> None:
    r2 = {"r2": STEPS}
    assert shown("all") == [{}, r2, r2, r2, {**r2, "r3": STEPS}, {**r2, "r3": STEPS}]


@pytest.mark.parametrize("choice", ["changed", "all"])
def test_only_steps_that_ran(choice: ImageChoice) -> None:
    """A map with too little structure was not matched."""
    blank = Grid(bare_room().cells[:5, :5], 0.1)
    found = shown(choice, ({"r1": flat_map("r1")}, {"r2": blank}))
    assert found[1].get("r2", []) == []


def test_each_is_rendered_once(monkeypatch: pytest.MonkeyPatch) -> None:
    rendered = []

    def blank(step_name: str) -> Picture:
        return Picture(step_name, "nothing", np.zeros((2, 2, 3), np.uint8))

    monkeypatch.setattr("replay.gallery.render", lambda evidence, _: rendered.append(evidence) or blank(evidence.step))
    shown("changed")
    assert len(rendered) == 3 * len(STEPS)


@pytest.mark.parametrize("robots", [("r1", "r2"), ("r2", "r1")])
@pytest.mark.parametrize("larger", ["r1", "r2"])
def test_the_surface_says_which_map_is_turned_as_its_placement_does(robots: tuple[str, str], larger: str) -> None:
    """In whichever order the maps were matched."""
    merger = Merger(robots)
    gallery = Gallery("changed", merger.explain)
    result = merger.step({robot: flat_map(robot, 9.0 if robot == larger else 7.0) for robot in robots})
    (title,) = (item.picture.title for item in gallery.due(result) if item.picture.step == "correlation_surface")
    pose = result.robots[robots[1]].merged_from_map
    assert pose is not None
    turned = f"{robots[1]} turned by {math.degrees(pose.yaw_rad):.1f}° on {robots[0]}"
    assert title == f"Correlation of walls and free space, {turned}"
