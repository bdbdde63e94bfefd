"""Values over time: bounded memory, lines and dots, axes."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import pytest

from replay.html.axes import axis
from replay.html.plots import _dots, _steps
from replay.html.series import MOST_NUMBERS, Series


def said(index: int, placed: bool = True) -> dict[str, Any]:
    pose = {"x_m": float(index), "y_m": 0.0, "yaw_rad": 0.0, "scale": 1.0} if placed else None
    figures = {"acceptance": 0.9, "confidence": None, "overlap_m2": 5.0}
    return {"status": "merged" if placed else "unmerged", "merged_from_map": pose, **figures}


def folded(ticks: int, robots: int = 1) -> Series:
    names = [f"r{index}" for index in range(robots)]
    series = Series(names)
    for index in range(ticks):
        values = said(index)
        series.take(index * 10, dict.fromkeys(names, values))
    return series


def test_all_of_a_short_run_are_kept() -> None:
    series = folded(50)
    assert series.stamps_ns == [index * 10 for index in range(50)]
    assert [item.x_m for item in series.of(0)] == list(range(50))


@pytest.mark.parametrize("robots", [1, 20])
@pytest.mark.parametrize("ticks", [10_000, 10_007])
def test_of_a_long_run_evenly_chosen_ones_are_kept_and_the_last(ticks: int, robots: int) -> None:
    series = folded(ticks, robots)
    stamps = series.stamps_ns
    assert series.ticks == ticks
    assert (stamps[0], stamps[-1]) == (0, (ticks - 1) * 10)
    steps = {after - before for before, after in pairwise(stamps[:-1])}
    assert len(steps) == 1
    assert len(stamps) >= 100
    assert len(stamps) * robots * 6 <= 2 * MOST_NUMBERS + 6 * robots


def test_a_run_without_ticks_has_no_values() -> None:
    assert Series(["r1"]).stamps_ns == []
    assert Series(["r1"]).of(0) == []


def test_lines_have_gaps_where_nothing_is_placed() -> None:
    assert _steps([(0, 5, True), (10, 5, True), (20, 9, True), (30, 9, False), (40, 9, True)]) == "M0 5H20V9H30M40 9H40"
    assert _steps([(0, None, True), (10, 5, False)]) == ""


def test_one_value_is_seen() -> None:
    assert _steps([(7, 5, True)]) == "M7 5H11"


def test_refused_values_are_dots() -> None:
    assert _dots([(0, 5, True), (10, 5, False), (10, 5, False), (20, None, False)]) == "M10 5h0"


@pytest.mark.parametrize(
    ("low", "high"), [(0.0, 1.0), (0.9, 1.0), (-17.3, 4.2), (5.0, 5.0), (0.0, 123456.0), (-3.0, -3.0)]
)
def test_an_axis_holds_its_values_between_round_marks(low: float, high: float) -> None:
    found = axis(low, high)
    assert found.low <= low <= high <= found.high
    assert 2 <= len(found.ticks) <= 8
    labels = [found.label(tick) for tick in found.ticks]
    assert len(set(labels)) == len(labels)
    assert 0.0 <= found.share(low) <= found.share(high) <= 1.0


def test_an_axis_need_not_end_at_marks() -> None:
    found = axis(0.0, 163.3, 5, widen=False)
    assert (found.low, found.high) == (0.0, 163.3)
    assert found.ticks == (0.0, 50.0, 100.0, 150.0)


def test_small_differences_are_not_blown_up() -> None:
    assert axis(20.09, 20.13, least_step=0.25).ticks == (20.0, 20.25)
