"""Algorithm 1: interest points of a map's walls."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mapmerge.paper.pixels import Image

Cells = NDArray[np.intp]
"""Positions in a picture, shape (N, 2), as column (x) and row (y)."""


def interest_points(binary: Image, side_px: int) -> Cells:
    """Return interest points such that one survives within each square S (Algorithm 1).

    The picture is scanned from its origin; a cell that is still occupied is marked, and all that is occupied within S
    around it is deleted. As printed, a cell is marked as soon as S around it *meets* something occupied, which puts
    the marks beside the walls, half of S before them; here only occupied cells are marked.
    """
    left = binary > 0
    rows, cols = np.nonzero(left)
    reach = side_px // 2
    marks: list[tuple[int, int]] = []
    for row, col in zip(rows.tolist(), cols.tolist(), strict=True):
        if left[row, col]:
            marks.append((col, row))
            left[max(0, row - reach) : row + reach + 1, max(0, col - reach) : col + reach + 1] = False
    return np.array(marks, np.intp).reshape(-1, 2)
