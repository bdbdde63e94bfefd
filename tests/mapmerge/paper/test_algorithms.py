"""Algorithm 1, interest points, and Algorithm 2, lines redrawn between them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from mapmerge.paper.interest import interest_points
from mapmerge.paper.straighten import LineRule, line_cells, line_share, moved_target, straightened

BINARY = arrays(np.uint8, array_shapes(min_dims=2, max_dims=2, max_side=20), elements=st.sampled_from([0, 255]))
RULE = LineRule(reach_px=12, min_share=0.7)


def rectangle(rows=40, cols=60, margin=6):
    picture = np.zeros((rows, cols), np.uint8)
    picture[margin:-margin, margin] = picture[margin:-margin, -margin - 1] = 255
    picture[margin, margin:-margin] = picture[-margin - 1, margin:-margin] = 255
    return picture


def points(*each):
    return np.array(each, np.intp).reshape(-1, 2)


class TestInterestPoints:
    @pytest.mark.parametrize("side_px", [3, 5, 7])
    def test_corners_of_a_rectangle_are_marked_and_never_what_is_beside_the_wall(self, side_px):
        picture = rectangle()
        marks = interest_points(picture, side_px)
        assert (picture[marks[:, 1], marks[:, 0]] == 255).all()
        for corner in ((6, 6), (53, 6), (6, 33), (53, 33)):
            assert np.abs(marks - corner).max(axis=1).min() <= side_px // 2

    @given(BINARY, st.sampled_from([1, 3, 5]))
    def test_one_survives_within_each_square(self, picture, side_px):
        marks, reach = interest_points(picture, side_px), side_px // 2
        assert (picture[marks[:, 1], marks[:, 0]] == 255).all()
        apart = np.abs(marks[:, None] - marks[None, :]).max(axis=-1)
        assert (apart[~np.eye(len(marks), dtype=bool)] > reach).all()
        for row, col in zip(*np.nonzero(picture), strict=True):
            assert np.abs(marks - (col, row)).max(axis=1).min() <= reach

    def test_nothing_is_marked_where_nothing_is_occupied(self):
        assert interest_points(np.zeros((5, 5), np.uint8), 3).shape == (0, 2)


class TestLines:
    def test_a_line_meets_both_ends_and_is_connected(self):
        cols, rows = line_cells((2, 3), (9, 6))
        assert (cols[0], rows[0], cols[-1], rows[-1]) == (2, 3, 9, 6)
        assert max(np.abs(np.diff(cols)).max(), np.abs(np.diff(rows)).max()) == 1

    def test_its_share_is_what_is_occupied_of_it(self):
        picture = np.zeros((3, 10), np.uint8)
        picture[1, :7] = 255
        assert line_share(picture, (0, 1), (9, 1)) == pytest.approx(0.7)
        assert line_share(picture, (4, 1), (4, 1)) == 1.0

    @pytest.mark.parametrize(
        ("target", "direction", "moved"),
        [
            ((12, 20), None, ((10, 20), "x")),
            ((12, 20), "y", ((10, 20), "x")),
            ((20, 12), None, ((20, 10), "y")),
            ((20, 12), "x", ((20, 10), "y")),
            ((15, 15), "x", ((10, 15), "x")),
            ((15, 5), "y", ((15, 10), "y")),
            ((15, 15), None, None),
        ],
    )
    def test_a_target_is_moved_level_with_the_reference(self, target, direction, moved):
        assert moved_target((10, 10), target, direction) == moved


class TestStraightened:
    def test_a_ragged_wall_becomes_straight(self):
        picture = np.zeros((20, 60), np.uint8)
        picture[9:12, 5:55] = 255
        marks = points(*[(col, 9 + index % 3) for index, col in enumerate(range(5, 56, 5)) if col < 55])
        drawn = straightened(picture, marks, RULE)
        rows = np.flatnonzero(drawn.any(axis=1))
        assert len(rows) == 1
        assert np.flatnonzero(drawn.any(axis=0)).tolist() == list(range(5, 51))

    def test_a_gap_beyond_the_reach_stays(self):
        picture = np.zeros((9, 60), np.uint8)
        picture[4, :20] = picture[4, 40:] = 255
        drawn = straightened(picture, points((0, 4), (9, 4), (19, 4), (40, 4), (49, 4), (59, 4)), RULE)
        assert not drawn[:, 20:40].any()
        assert drawn[4, :20].all()
        assert drawn[4, 40:].all()

    def test_points_without_a_wall_between_them_are_not_joined(self):
        picture = np.zeros((20, 20), np.uint8)
        picture[4, 4] = picture[4, 12] = picture[12, 4] = 255
        assert not straightened(picture, points((4, 4), (12, 4), (4, 12)), RULE).any()

    def test_a_target_that_fails_does_not_hide_the_next_one(self):
        """The nearest point is across a gap; the wall leads to one further away."""
        picture = np.zeros((20, 20), np.uint8)
        picture[2, 2:12] = 255
        picture[6, 2] = 255
        drawn = straightened(picture, points((2, 2), (2, 6), (11, 2)), RULE)
        assert drawn[2, 2:12].all()

    def test_where_the_straight_line_leaves_the_wall_the_wall_is_kept(self):
        """A slanting wall, of which a straight copy would cover too little."""
        picture = np.zeros((20, 30), np.uint8)
        cols, rows = line_cells((4, 4), (14, 9))
        picture[rows, cols] = 255
        drawn = straightened(picture, points((4, 4), (14, 9)), LineRule(20, 0.7))
        assert np.array_equal(drawn, picture)

    def test_a_diagonal_follows_the_last_direction_through_an_added_point(self):
        """A filled corner that was not marked: straight on to it, then to the mark beyond it."""
        picture = np.zeros((30, 30), np.uint8)
        picture[4:10, 4:20] = 255
        drawn = straightened(picture, points((4, 4), (14, 4), (19, 9)), LineRule(12, 0.6))
        assert drawn[4, 4:20].all()
        assert drawn[4:10, 19].all()

    def test_a_diagonal_without_a_direction_is_left_alone(self):
        picture = np.zeros((20, 20), np.uint8)
        cells = np.arange(4, 12)
        picture[cells, cells] = 255
        assert not straightened(picture, points((4, 4), (11, 11)), LineRule(20, 0.7)).any()

    def test_without_points_there_is_nothing_to_draw(self):
        assert not straightened(rectangle(), points(), RULE).any()

    @settings(deadline=None, max_examples=200)
    @given(BINARY, st.sampled_from([1, 3, 5]), st.integers(1, 30), st.sampled_from([0.0, 0.5, 0.7, 1.0]))
    def test_it_ends_on_any_picture(self, picture, side_px, reach_px, min_share):
        drawn = straightened(picture, interest_points(picture, side_px), LineRule(reach_px, min_share))
        assert drawn.shape == picture.shape
        assert set(np.unique(drawn)) <= {0, 255}

    def test_a_straight_room_stays_where_it_is(self):
        picture = rectangle()
        drawn = straightened(picture, interest_points(picture, 5), RULE)
        assert np.count_nonzero(drawn & picture) > 0.9 * np.count_nonzero(picture)
        assert np.count_nonzero(drawn & ~picture) < 0.02 * np.count_nonzero(picture)
