"""Walls that are kept up to date by region: what is where, under which number."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mapmerge.plane import Box
from mapmerge.walls import NO_WALL, LiveWalls

SIDE = 24
WHOLE = Box(0, 0, SIDE, SIDE)
REACH_SQUARES = 3.0

spans = st.tuples(st.integers(0, SIDE), st.integers(0, SIDE)).map(sorted)
parts = st.builds(lambda rows, cols: Box(rows[0], cols[0], rows[1], cols[1]), spans, spans)
steps = st.tuples(parts, st.integers(0, 1000), st.sampled_from([0.0, 0.05, 0.4]), st.booleans())
histories = st.lists(steps, min_size=1, max_size=6)


def cells_of(mask):
    row, col = np.nonzero(mask)
    return row.astype(np.int32), col.astype(np.int32)


def by_square(walls):
    """Return number, row and column of the wall in each square that has one."""
    found = {}
    for number in walls.numbers.tolist():
        row, col = float(walls.rows[number]), float(walls.cols[number])
        square = tuple(walls.squares.of(np.array([row, col])).tolist())
        assert square not in found
        found[square] = number, row, col
    return found


@given(histories, st.sampled_from([1.0, 1.3, 2.0, 2.6]))
def test_what_is_kept_up_to_date_is_what_is_collected_anew(history, square_cells):
    walls, occupied = LiveWalls(square_cells, REACH_SQUARES), np.zeros((SIDE, SIDE), np.bool_)
    before = {}
    for part, seed, share, is_asked in history:
        rng = np.random.default_rng(seed)
        was = occupied.copy()
        changed = occupied[part.slices(WHOLE)]
        changed[:] = rng.random(changed.shape) < share
        walls.update(WHOLE, cells_of(occupied & ~was), cells_of(was & ~occupied))
        now = by_square(walls)
        assert all(now[square][0] == number for square, (number, _, _) in before.items() if square in now)
        before = now

        members = {}
        for row, col in zip(*np.nonzero(occupied), strict=True):
            square = tuple(walls.squares.of(np.array([row, col])).tolist())
            members.setdefault(square, []).append((row, col))
        assert {square: (row, col) for square, (_, row, col) in now.items()} == {
            square: tuple(np.mean(cells, axis=0).tolist()) for square, cells in members.items()
        }
        assert list(now) == sorted(now)
        assert NO_WALL not in walls.numbers
        assert len(set(walls.numbers.tolist())) == len(walls.numbers)

        anew = LiveWalls(square_cells, REACH_SQUARES)
        anew.update(WHOLE, cells_of(occupied), cells_of(np.zeros_like(occupied)))
        square_of = {number: square for square, (number, _, _) in now.items()} | {NO_WALL: None}
        other_of = {number: square for square, (number, _, _) in by_square(anew).items()} | {NO_WALL: None}
        assert walls.nearest.box == anew.nearest.box
        assert [square_of[number] for number in walls.nearest.cells.ravel().tolist()] == [
            other_of[number] for number in anew.nearest.cells.ravel().tolist()
        ]
        if is_asked:
            for square, (number, _, _) in by_square(anew).items():
                np.testing.assert_array_equal(walls.directions[now[square][0]], anew.directions[number])
