"""Places on a lattice as sorted keys."""

import numpy as np

from mapmerge.keys import box_of_keys, exchanged, keys_of, places_of, span_of_rows
from mapmerge.plane import NOTHING, Box

ROWS = np.array([-3, -3, 0, 0, 7], np.int32)
COLS = np.array([-9, 4, -1, 100_000, -100_000], np.int32)


def test_keys_are_in_the_order_of_the_places_and_tell_them():
    keys = keys_of(ROWS, COLS)
    assert keys.tolist() == sorted(keys.tolist())
    rows, cols = places_of(keys)
    assert (rows.tolist(), cols.tolist()) == (ROWS.tolist(), COLS.tolist())


def test_the_rows_of_a_box():
    keys = keys_of(ROWS, COLS)
    assert span_of_rows(keys, Box(-3, 0, 0, 1)) == slice(0, 2)
    assert span_of_rows(keys, Box(0, 0, 7, 1)) == slice(2, 4)


def test_the_box_of_keys():
    assert box_of_keys(keys_of(ROWS, COLS)) == Box(-3, -100_000, 8, 100_001)
    assert box_of_keys(np.empty(0, np.int64)) == NOTHING


def test_what_is_exchanged_stays_sorted():
    rng = np.random.default_rng(0)
    for _ in range(300):
        before, after = (np.unique(rng.integers(0, 40, rng.integers(0, 20))) for _ in range(2))
        gone, new = np.setdiff1d(before, after), np.setdiff1d(after, before)
        found = exchanged(before, np.searchsorted(before, gone), np.searchsorted(before, new), new)
        assert found.tolist() == after.tolist()
