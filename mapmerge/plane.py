"""Arrays over a lattice of cells that grow with what is known, and boxes of such cells."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray


class Box(NamedTuple):
    """A rectangle of cells: rows ``top`` to ``bottom`` and columns ``left`` to ``right``, the last ones excluded."""

    top: int
    left: int
    bottom: int
    right: int

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns; (0, 0) if there are none."""
        rows, cols = max(0, self.bottom - self.top), max(0, self.right - self.left)
        return (rows, cols) if rows and cols else (0, 0)

    @property
    def is_empty(self) -> bool:
        """Whether it has no cell."""
        return self.bottom <= self.top or self.right <= self.left

    def padded(self, cells: int) -> Box:
        """Return the box with so many cells more on each side; an empty one stays empty."""
        if self.is_empty:
            return self
        return Box(self.top - cells, self.left - cells, self.bottom + cells, self.right + cells)

    def shifted(self, rows: int, cols: int) -> Box:
        """Return the box moved by so many rows and columns."""
        return Box(self.top + rows, self.left + cols, self.bottom + rows, self.right + cols)

    def within(self, other: Box) -> Box:
        """Return what both boxes have in common."""
        top, left = max(self.top, other.top), max(self.left, other.left)
        bottom, right = min(self.bottom, other.bottom), min(self.right, other.right)
        return Box(top, left, bottom, right) if top < bottom and left < right else NOTHING

    def union(self, other: Box) -> Box:
        """Return the smallest box that holds both."""
        if self.is_empty or other.is_empty:
            return other if self.is_empty else self
        return Box(
            min(self.top, other.top),
            min(self.left, other.left),
            max(self.bottom, other.bottom),
            max(self.right, other.right),
        )

    def bands(self, rows: int) -> Iterator[Box]:
        """Yield the box in parts of at most so many rows, so that memory is that of a part."""
        for top in range(self.top, self.bottom, rows):
            yield Box(top, self.left, min(self.bottom, top + rows), self.right)

    def slices(self, of: Box) -> tuple[slice, slice]:
        """Return which rows and columns these are of an array that covers another box."""
        return (
            slice(self.top - of.top, self.bottom - of.top),
            slice(self.left - of.left, self.right - of.left),
        )


NOTHING = Box(0, 0, 0, 0)


class Plane:
    """An array over a box of a lattice.

    Parameters
    ----------
    dtype
        Of its values.
    blank
        Its value where nothing was written yet.

    Attributes
    ----------
    box
        What it covers.
    cells
        Its values, shape ``box.shape``, contiguous; written in place.
    """

    def __init__(self, dtype: Any, blank: int = 0) -> None:  # noqa: ANN401 - whatever numpy takes
        self.box = NOTHING
        self._blank = blank
        self.cells: NDArray[Any] = np.zeros((0, 0), dtype)

    def cover(self, box: Box) -> None:
        """Cover exactly this box; values inside of it are kept, those outside of it are forgotten."""
        if box == self.box:
            return
        cells = _blanks(box, self.cells.dtype, self._blank)
        kept = box.within(self.box)
        cells[kept.slices(box)] = self.cells[kept.slices(self.box)]
        self.box, self.cells = box, cells

    def part(self, box: Box) -> NDArray[Any]:
        """Return the values of a box that is within its own, to be read or written in place."""
        return self.cells[box.slices(self.box)]

    def read(self, box: Box) -> NDArray[Any]:
        """Return the values of any box, blank where it is not covered: a view if all of it is, else a copy."""
        return read(self.cells, box.shifted(-self.box.top, -self.box.left), self._blank)


def read(cells: NDArray[Any], box: Box, blank: int) -> NDArray[Any]:
    """Return the values of any box of an array, blank beyond it: a view if all of it is inside, else a copy."""
    whole = Box(0, 0, *cells.shape)
    inside = box.within(whole)
    if inside == box:
        return cells[box.slices(whole)]
    values = _blanks(box, cells.dtype, blank)
    values[inside.slices(box)] = cells[inside.slices(whole)]
    return values


def _blanks(box: Box, dtype: Any, blank: int) -> NDArray[Any]:  # noqa: ANN401 - whatever numpy takes
    return np.full(box.shape, blank, dtype) if blank else np.zeros(box.shape, dtype)
