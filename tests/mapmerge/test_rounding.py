"""Numbers in words: none contradicts the limit that it is held against."""

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from mapmerge.rounding import percent_below, rounded_down


@pytest.mark.parametrize(
    ("value", "digits", "expected"),
    [(1.36, 1, 1.3), (0.999999, 3, 0.999), (0.29, 2, 0.29), (-0.01, 1, -0.1), (7, 0, 7)],
)
def test_rounded_down(value, digits, expected):
    assert rounded_down(value, digits) == expected


@pytest.mark.parametrize(
    ("share", "limit", "expected"),
    [
        (0.693, 0.7, ("69%", "70%")),
        (0.693, 0.695, ("69.3%", "69.5%")),
        (0.892, 0.895, ("89.2%", "89.5%")),
        (0.9199, 0.92, ("91.99%", "92%")),
        (0.99989, 0.9999, ("99.98%", "99.99%")),
        (0.003, 0.92, ("0.3%", "92%")),
        (0.0, 0.92, ("0%", "92%")),
    ],
)
def test_a_share_below_a_limit(share, limit, expected):
    assert percent_below(share, limit) == expected


@given(st.floats(0.0, 1.0), st.integers(1, 10_000))
def test_a_share_below_a_limit_reads_like_that(share, ten_thousandths):
    limit = ten_thousandths / 10_000
    assume(share < limit - 1e-9)
    below, least = (float(text.rstrip("%")) for text in percent_below(share, limit))
    assert below < least
    assert least == pytest.approx(limit * 100.0)
