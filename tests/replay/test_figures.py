"""Figures never say more than is so."""

from __future__ import annotations

import pytest

from mapmerge.rounding import rounded_down
from replay.figures import area, degrees, fixed, init_pose, percent, share, size
from replay.init_pose import InitPose


@pytest.mark.parametrize(
    ("value", "digits", "expected"),
    [(0.9999, 3, "0.999"), (0.985, 3, "0.985"), (0.29, 2, "0.29"), (1.0, 3, "1.000"), (None, 3, "–")],
)
def test_a_share_is_rounded_down(value: float | None, digits: int, expected: str) -> None:
    assert share(value, digits) == expected


def test_an_area_reads_as_in_a_reason() -> None:
    assert area(1.39) == "1.3 m²"  # "the maps share 1.3 m² of ground, less than 6 m²"
    assert area(5.99) == "5.9 m²"
    assert area(12345.6) == "12,345.6 m²"


@pytest.mark.parametrize(
    ("value", "expected"), [(0.99962, "99.96%"), (1.0, "100%"), (0.92, "92%"), (0.0065, "0.65%"), (0.419, "41%")]
)
def test_a_probability_is_rounded_down(value: float, expected: str) -> None:
    assert percent(value) == expected


def test_nothing_is_rounded_below_what_it_is() -> None:
    assert rounded_down(0.3 * 3, 1) == 0.9
    assert rounded_down(-0.05, 1) == -0.1


def test_no_zero_has_a_sign() -> None:
    assert fixed(-0.0001, 2) == "0.00"
    assert degrees(-1e-9) == "0.0"


def test_a_placement_is_one_that_can_be_given() -> None:
    said = init_pose("r2", {"x_m": 3.941234, "y_m": -6.28, "yaw_rad": -2.1})
    given = InitPose.parse(said)
    assert (given.robot, given.x_m, given.y_m) == ("r2", 3.941, -6.28)
    assert given.yaw_rad == pytest.approx(-2.1, abs=1e-5)


@pytest.mark.parametrize(
    ("count", "expected"), [(0, "0 bytes"), (999, "999 bytes"), (1500, "1.5 kB"), (14e6, "14.0 MB")]
)
def test_sizes(count: float, expected: str) -> None:
    assert size(int(count)) == expected
