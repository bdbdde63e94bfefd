"""The ways of robots on the report page: where they lie, and how much of the page they take."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from mapmerge.raster import Pixels
from mapmerge.sim2 import IDENTITY, Sim2
from replay.html.roster import Member
from replay.html.ways import MOST_POINTS_OF_ONE, PARTS, Way, Ways, ways
from replay.options import RunOptions
from replay.runs import RunPath
from tests.bags import Recorded, write_mcap
from tests.pages import Page, page_of, page_of_run
from tests.runs import (
    bare_room,
    begun_anew,
    flat_map,
    growing,
    in_log_order,
    link,
    linked,
    reference_from,
    seen,
)

PIXELS = Pixels(-10.0, -20.0, 0.05, rows=1000, cols=800)
"""From (-10, -20) to (30, 30)."""


def drives(robot: str, first_s: float = 0.0, count: int = 40) -> list[Recorded]:
    """Return transforms of a robot that drives along y = 1 m in its map frame, 0.2 m every half a second."""
    return [
        linked(first_s + 0.5 * index, link(f"{robot}/map", f"{robot}/base_link", Sim2(0.2 * index, 1.0)))
        for index in range(count)
    ]


def told(path: Path, *parts: list[Recorded]) -> Page:
    """Return the page of a run."""
    options = RunOptions((RunPath(None, write_mcap(path, in_log_order(*parts))),), trajectories="all")
    return Page(page_of_run(options))


def points(path: str) -> list[np.ndarray]:
    """Return the lines of a path of SVG, in units of the drawing."""
    found = []
    for part in path.split("M")[1:]:
        begin, _, steps = part.removesuffix("h0").partition("l")
        numbers = [float(each) for text in (begin, steps) for each in re.findall(r"-?\d+", text)]
        found.append(np.cumsum(np.array(numbers).reshape(-1, 2), axis=0))
    return found


def drawn_m(found: Page, index: int) -> np.ndarray:
    """Return a robot's line on the page, in the merged frame."""
    stage = next(each for each in found.all("div", kind="stage") if each.get("data-width"))
    width_m, left_m, top_m = (float(stage.get(f"data-{name}", "")) for name in ("width", "left", "top"))
    unit_m = width_m / float(found.all("svg", kind="ways")[0].get("viewBox", "").split()[2])
    path = next(each for each in found.all("path") if each.get("id") == f"way-{index}")
    (line,) = points(path.get("d", ""))
    return np.array((left_m, top_m)) + line * (unit_m, -unit_m)


def test_they_lie_where_the_maps_lie_in_the_end(tmp_path: Path) -> None:
    """Also what was driven before a map was placed."""
    maps = in_log_order(growing("r1", frame="r1/map"), growing("r2", 2.0, frame="r2/map"))
    found = told(tmp_path / "run.mcap", drives("r1"), drives("r2", 0.5), maps)
    for index, robot in enumerate(("r1", "r2")):
        line = drawn_m(found, index)
        ends = reference_from(robot).apply(np.array([(0.0, 1.0), (7.8, 1.0)]))
        assert line[[0, -1]] == pytest.approx(ends, abs=0.25)
        along = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
        across = (line - ends[0]) @ np.array((-along[1], along[0]))
        assert np.abs(across).max() < 0.25
    drawing = found.all("svg", kind="ways")[0]
    assert (drawing.get("role"), drawing.get("aria-label")) == ("img", "Where r1, r2 drove")
    assert "The thin lines are where the robots drove; a dot is where one was last." in found.words("map")


def test_of_a_map_that_is_not_placed_there_is_none(tmp_path: Path) -> None:
    maps = in_log_order(growing("r1", frame="r1/map"), [seen("r2", 5.0, bare_room(), frame="r2/map")])
    found = told(tmp_path / "run.mcap", drives("r1"), drives("r2"), maps)
    assert found.all("svg", kind="ways")[0].get("aria-label") == "Where r1 drove"
    assert "drove" not in found.words("pairs")


def test_of_a_map_that_jumped_what_followed_is_drawn(tmp_path: Path) -> None:
    """What was before is of a frame that there is no more."""
    again = begun_anew(flat_map("r1"))
    maps = [seen("r1", 1.0, frame="r1/map"), seen("r1", 10.0, again, frame="r1/map")]
    maps.append(seen("r1", 20.0, again, frame="r1/map"))
    found = told(tmp_path / "run.mcap", drives("r1", 0.0), maps)
    assert "jumped" in found.words("decisions")
    line = drawn_m(found, 0)
    assert line[[0, -1], 0] == pytest.approx([0.2 * 21, 0.2 * 39], abs=0.1)


def test_without_any_nothing_is_said_of_them() -> None:
    for name in ("merged", "no_map_at_all", "no_reference"):
        found = Page(page_of(name))
        assert not found.all("svg", kind="ways")
        assert "drove" not in found.words()


def test_without_a_merged_map_there_are_none(tmp_path: Path) -> None:
    lost = [seen("r1", 0.0, resolution=0.0, frame="r1/map"), *growing("r2", frame="r2/map")]
    found = told(tmp_path / "run.mcap", lost, drives("r2"))
    assert not found.all("svg", kind="ways")


# The lines


def shown(line: np.ndarray, pose: Sim2 = IDENTITY, robots: int = 1) -> Ways | None:
    members = [Member(f"r{index}", index) for index in range(robots)]
    story = SimpleNamespace(ways={member.robot: line for member in members}, are_ways_whole=True)
    return ways(story, [(member, pose) for member in members], PIXELS)  # type: ignore[arg-type]


def way(line: np.ndarray, robots: int = 1) -> Way:
    found = shown(line, robots=robots)
    assert found is not None
    return found.ways[-1]


def test_a_straight_line_is_two_points_and_a_dot() -> None:
    found = way(np.column_stack((np.linspace(0.0, 20.0, 500), np.zeros(500))))
    assert found.line == f"M{200 * PARTS} {600 * PARTS}l{400 * PARTS} 0"
    assert found.last == f"M{600 * PARTS} {600 * PARTS}h0"


def test_a_line_is_thinned_to_what_is_seen() -> None:
    turn = np.linspace(0.0, 60.0, 40_000)
    spiral = np.column_stack((10.0 + 0.15 * turn * np.cos(turn), 5.0 + 0.15 * turn * np.sin(turn)))
    (line,) = points(way(spiral).line)
    assert len(line) < 1500
    true = (spiral - (-10.0, 30.0)) * (1.0, -1.0) / 0.05 * PARTS
    middles = (line[1:] + line[:-1]) / 2
    assert max(np.hypot(*(true - middle).T).min() for middle in middles) <= PARTS


def test_no_line_takes_much_of_the_page() -> None:
    random = np.random.default_rng(3)
    rough = 10.0 + np.cumsum(random.normal(0.0, 0.1, (50_000, 2)), axis=0) % 15.0
    everywhere = random.uniform(-9.0, 29.0, (50_000, 2))
    pairs = np.repeat(everywhere, 2, axis=0)
    for line in (rough, everywhere, pairs):
        found = way(line)
        assert sum(map(len, points(found.line))) <= MOST_POINTS_OF_ONE
        assert len(way(line, robots=60).line) < len(found.line) / 2 or not found.line


def test_lines_are_parted_where_a_robot_jumped_or_left_the_picture() -> None:
    there = np.column_stack((np.linspace(0.0, 5.0, 50), np.zeros(50)))
    assert len(points(way(np.concatenate((there, there + np.array((0.0, 9.0))))).line)) == 2
    out = np.array([(6.0, 0.0), (1e9, 0.0), (1e308, -1e308), (7.0, 0.0), (7.5, 0.0)])
    found = way(np.concatenate((there, out)))
    assert [len(each) for each in points(found.line)] == [2, 2]
    assert found.last
    away = way(np.concatenate((there, out[:3])))
    assert away.last == ""


@pytest.mark.filterwarnings("error")
def test_what_is_nowhere_near_is_not_drawn() -> None:
    assert shown(np.array([(1e308, 1e308), (-1e308, 1e308)]), Sim2(0.0, 0.0, 0.7, 3.0)) is None
    assert shown(np.array([(1.0, 1.0)])) is not None
