"""Boxes of cells, arrays over them, and what changed between two maps: compared with what is counted cell by cell."""

from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from mapmerge import lattice
from mapmerge.grid import Grid
from mapmerge.lattice import box_of, changed_box, offset_cells, same_within
from mapmerge.plane import NOTHING, Box, Plane
from mapmerge.sim2 import IDENTITY, Sim2
from mapmerge.walls import Squares

SIDE = 12
RESOLUTION_M = 0.05
FRAMES = (IDENTITY, Sim2(3.0, -70.0, 0.7), Sim2(-1e4, 5e3, -2.9))

floors = hnp.arrays(np.int8, (SIDE, SIDE), elements=st.sampled_from([-1, -1, 0, 50, 100]))
windows = st.tuples(*[st.integers(0, SIDE)] * 4).map(
    lambda at: Box(min(at[0], at[1]), min(at[2], at[3]), max(at[0], at[1]), max(at[2], at[3]))
)
boxes = st.builds(Box, *[st.integers(-6, 6)] * 4)


def seen(floor, window, frame=IDENTITY, resolution_m=RESOLUTION_M):
    """Return the map of a window of a floor, whose lattice begins at a frame."""
    corner = Sim2(window.left * resolution_m, window.top * resolution_m)
    return Grid(floor[window.top : window.bottom, window.left : window.right].copy(), resolution_m, frame @ corner)


def known(floor, window):
    """Return what a map knows: the values by row and column of the floor."""
    return {
        (row, col): int(floor[row, col])
        for row in range(window.top, window.bottom)
        for col in range(window.left, window.right)
        if floor[row, col] >= 0
    }


def around(cells):
    """Return the smallest box with some cells."""
    if not cells:
        return None
    rows, cols = zip(*cells, strict=True)
    return Box(min(rows), min(cols), max(rows) + 1, max(cols) + 1)


def cells_of(box):
    return {(row, col) for row in range(box.top, box.bottom) for col in range(box.left, box.right)}


@given(floors, windows, windows, windows, st.integers(0, 3), st.sampled_from(FRAMES))
def test_what_changed_is_the_smallest_box_that_holds_it(floor, before, after, part, value, frame):
    """Between windows of a floor, shifted, grown and shrunk, one of which has changed in a part."""
    other = floor.copy()
    other[part.top : part.bottom, part.left : part.right] = (-1, 0, 50, 100)[value]
    old, new = known(floor, before), known(other, after)
    expected = around({at for at in old | new if old.get(at) != new.get(at)})
    with patch.object(lattice, "_BAND_ROWS", 3):
        found = changed_box(seen(floor, before, frame), seen(other, after, frame))
    if expected is None:
        assert found.is_empty
    else:
        assert found.shifted(after.top, after.left) == expected


@given(floors, windows, windows, windows, boxes, st.sampled_from(FRAMES))
def test_what_is_the_same_within_a_box_is_what_is_known_there(floor, before, after, part, box, frame):
    other = floor.copy()
    other[part.top : part.bottom, part.left : part.right] = 50
    one, two = seen(floor, before, frame), seen(other, after, frame)
    inside = cells_of(box.shifted(after.top, after.left))
    old, new = ({at: says[at] for at in says.keys() & inside} for says in (known(floor, before), known(other, after)))
    assert same_within(one, two, offset_cells(one, two), box) == (old == new)


@given(floors, windows, windows, st.sampled_from(FRAMES))
def test_a_map_that_is_cropped_or_padded_did_not_change(floor, window, other, frame):
    grid = seen(floor, window, frame)
    margins = (other.top, other.left), (other.bottom, other.right)
    corner = Sim2(-other.bottom * RESOLUTION_M, -other.top * RESOLUTION_M)
    padded = Grid(np.pad(grid.cells, margins, constant_values=-1), RESOLUTION_M, grid.map_from_grid @ corner)
    for same in (grid.cropped_to_known(), padded):
        assert changed_box(grid, same).is_empty
        assert changed_box(same, grid).is_empty


@given(floors, windows, windows, st.sampled_from(FRAMES))
def test_offsets_lead_from_cell_to_cell(floor, before, after, frame):
    offset = offset_cells(seen(floor, before, frame), seen(floor, after, frame))
    assert offset == (after.top - before.top, after.left - before.left)


@pytest.mark.parametrize("frame", FRAMES)
@pytest.mark.parametrize(
    ("off", "resolution_m"),
    [
        (Sim2(0.3 * RESOLUTION_M), RESOLUTION_M),
        (Sim2(y_m=0.5 * RESOLUTION_M), RESOLUTION_M),
        (Sim2(0.01 * RESOLUTION_M, 0.0), RESOLUTION_M),
        (Sim2(yaw_rad=1e-4), RESOLUTION_M),
        (Sim2(yaw_rad=np.pi / 2), RESOLUTION_M),
        (IDENTITY, 0.1),
        (IDENTITY, RESOLUTION_M * (1.0 + 1e-6)),
    ],
)
def test_cells_of_other_lattices_cannot_be_compared(frame, off, resolution_m):
    floor, window = np.zeros((SIDE, SIDE), np.int8), Box(0, 0, SIDE, SIDE)
    before, after = seen(floor, window, frame), seen(floor, window, frame @ off, resolution_m)
    assert changed_box(before, before) == NOTHING
    for one, other in ((before, after), (after, before)):
        assert offset_cells(one, other) is None
        assert changed_box(one, other) is None


@given(hnp.arrays(np.bool_, st.tuples(st.integers(0, 6), st.integers(0, 6))))
def test_the_box_of_a_mask(mask):
    assert box_of(mask) == (around(set(zip(*(axis.tolist() for axis in np.nonzero(mask)), strict=True))) or NOTHING)


@given(boxes, boxes, st.integers(0, 3), st.integers(1, 4))
def test_boxes_are_sets_of_cells(one, other, margin, rows):
    assert one.is_empty == (not cells_of(one))
    assert np.prod(one.shape) == len(cells_of(one))
    assert cells_of(one.within(other)) == cells_of(one) & cells_of(other)
    union = one.union(other)
    assert (None if union.is_empty else union) == around(cells_of(one) | cells_of(other))
    expected = {
        (row + down, col + right)
        for row, col in cells_of(one)
        for down in range(-margin, margin + 1)
        for right in range(-margin, margin + 1)
    }
    assert cells_of(one.padded(margin)) == expected
    bands = list(one.bands(rows))
    assert sum(len(cells_of(band)) for band in bands) == len(cells_of(one))
    assert set().union(*map(cells_of, bands)) == cells_of(one)
    assert all(band.bottom - band.top <= rows for band in bands)


@given(st.lists(st.tuples(boxes, boxes, st.integers(1, 9)), max_size=6), boxes)
def test_a_plane_keeps_what_it_covers(steps, seen_at_last):
    """It covers one box after the other, and is written in a part; whatever it covered no more is forgotten."""
    plane, expected = Plane(np.uint8), {}
    for box, part, value in steps:
        plane.cover(box)
        expected = {at: kept for at, kept in expected.items() if at in cells_of(box)}
        inside = part.within(box)
        plane.part(inside)[:] = value
        expected |= dict.fromkeys(cells_of(inside), value)
    values = plane.read(seen_at_last)
    assert values.shape == seen_at_last.shape
    for row, col in cells_of(seen_at_last):
        assert values[row - seen_at_last.top, col - seen_at_last.left] == expected.get((row, col), 0)


@given(st.sampled_from([1.0, 1.3, 1.625, 2.0, 2.6, 3.25, 6.0]), boxes)
def test_squares_hold_the_cells_whose_middles_lie_in_them(cells, box):
    squares = Squares(cells)
    of = {cell: int(np.floor((cell + 0.5) / cells + 1e-9)) for cell in range(-60, 60)}
    assert squares.of(np.array(list(of))).tolist() == list(of.values())
    expected = {(of[row], of[col]) for row, col in cells_of(box)}
    assert cells_of(squares.box(box)) == expected
    if not box.is_empty:
        first, last = squares.rows_of_cells(box)
        assert [cell for cell, row in of.items() if box.top <= row < box.bottom] == list(range(first, last))
