"""The merged map in the Rerun recording is green where maps share ground and red where they contradict each other.

The tint is part of the map's picture. As a see-through picture of its own above the map it would vanish at times: the
viewer draws each of several pictures a little nearer than it lies, and see-through ones where they lie.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mapmerge.config import CellConfig
from mapmerge.grid import Grid
from mapmerge.overlap import AGREE, ALONE, CONTRADICT, SHARED, Overlap, overlap
from mapmerge.plane import NOTHING, Box
from mapmerge.result import MergeResult
from mapmerge.sim2 import Points
from mapmerge.warp import Layer
from replay.sinks.rerun_entities import GROUND
from replay.sinks.rerun_grids import Pixels, shades_of

MAX_SIDE_CELLS = 1024
"""Larger maps are compared in larger cells: it is a tint."""

_GREEN = (40, 190, 95)
RED = (255, 40, 40)
MOST_MARKS = 20_000
"""So many contradictions at most are marked above the walls."""

_AGREE_SHARE, _SHARED_SHARE = 0.21, 0.1


class Tint:
    """Where the placed maps agree and contradict each other, kept up to date.

    Parameters
    ----------
    cells
        When a cell counts as occupied.
    tolerance_m
        How far a wall may lie from the same wall in another map.
    """

    def __init__(self, cells: CellConfig, tolerance_m: float) -> None:
        self._cells = cells
        self._tolerance_m = tolerance_m
        self._layers: list[Layer] = []
        self._found: Overlap | None = None

    def update(self, result: MergeResult) -> Box:
        """Bring it up to date; return in which cells of the merged map it is not what it was before."""
        layers = [
            Layer(result.grids[robot], outcome.merged_from_map)
            for robot, outcome in result.robots.items()
            if outcome.merged_from_map is not None and robot in result.grids
        ]
        if result.merged is None:
            return NOTHING
        before, self._layers = self._layers, layers
        if len(before) == len(layers) and all(map(Layer.is_same, before, layers)):
            return NOTHING
        last, self._found = self._found, None
        if len(layers) > 1:
            self._found = overlap(
                layers, result.merged, self._cells, tolerance_m=self._tolerance_m, max_side_cells=MAX_SIDE_CELLS
            )
        return _differs(last, self._found, result.merged)

    @property
    def contradictions_m(self) -> Points:
        """Where maps contradict each other: middles of cells in the merged frame, shape (N, 2); of very many, some."""
        if self._found is None:
            return np.empty((0, 2))
        rows_cols = np.argwhere(self._found.kinds == CONTRADICT)
        rows_cols = rows_cols[:: -(-len(rows_cols) // MOST_MARKS) or 1]
        middles_m = np.asarray((rows_cols[:, ::-1] + 0.5) * self._found.resolution_m, np.float64)
        return self._found.merged_from_grid.apply(middles_m)

    def paint(self, grid: Grid) -> Pixels:
        """Return a part of the merged map as a picture: in shades or, if some of it is tinted, in colours.

        Parameters
        ----------
        grid
            The part, in cells of any size along the axes of the merged map.

        Returns
        -------
        pixels
            Shape (rows, columns), or (rows, columns, 3) in red, green and blue; row 0 has the lowest y.
        """
        shades = shades_of(grid)
        kinds = None if self._found is None else _sampled(self._found, grid)
        if kinds is None:
            return shades
        # four bytes as one number are looked up several times as fast
        coloured = _COLOURS.take((kinds.astype(np.uint16) << 8) | shades)
        return coloured.view(np.uint8).reshape(*shades.shape, 4)[..., :3]


def _colours() -> NDArray[np.uint32]:
    """Return the colour of each kind of cell and shade, shape (kinds × 256,), each as four bytes in one number."""
    shades = np.repeat(np.arange(256, dtype=np.float64)[:, None], 3, axis=1)
    colours = np.stack([shades] * 4)
    for kind, share in ((AGREE, _AGREE_SHARE), (SHARED, _SHARED_SHARE)):
        colours[kind] = shades * (1.0 - share) + np.multiply(_GREEN, share)
    # maps that agree may still leave a cell at their borders unknown; where they contradict each other, all is shown
    colours[:, GROUND[0]] = GROUND
    colours[CONTRADICT] = RED
    bytes_of = np.full((*colours.shape[:2], 4), 255, np.uint8)
    bytes_of[..., :3] = colours.round()
    return bytes_of.view(np.uint32).ravel()


_COLOURS = _colours()


def _sampled(found: Overlap, grid: Grid) -> Pixels | None:
    """Return of which kind each cell of a grid is; None if all of them are alone."""
    corner = found.merged_from_grid.inverse() @ grid.map_from_grid
    rows, columns = (
        np.floor((start_m + (np.arange(number) + 0.5) * grid.resolution_m) / found.resolution_m).astype(np.intp)
        for start_m, number in ((corner.y_m, grid.rows), (corner.x_m, grid.cols))
    )
    inside = [(at >= 0) & (at < most) for at, most in zip((rows, columns), found.kinds.shape, strict=True)]
    part = found.kinds.take(rows[inside[0]], axis=0).take(columns[inside[1]], axis=1)
    if not part.any():
        return None
    kinds = np.full(grid.cells.shape, ALONE, np.uint8)
    # what is inside follows each other, along both axes
    (top, *_), (left, *_) = (np.flatnonzero(each) for each in inside)
    kinds[top : top + part.shape[0], left : left + part.shape[1]] = part
    return kinds


def _differs(before: Overlap | None, after: Overlap | None, lattice: Grid) -> Box:
    """Return in which cells of a map, along whose axes both lie, two overlaps are not the same."""
    found = [each for each in (before, after) if each is not None]
    boxes = [_cells_of(each, lattice) for each in found]
    both = NOTHING if not boxes else boxes[0].union(boxes[-1])
    if before is None or after is None or before.resolution_m != after.resolution_m:
        return both
    step = round(after.resolution_m / lattice.resolution_m)
    if (boxes[0].top - boxes[1].top) % step or (boxes[0].left - boxes[1].left) % step:
        return both
    images = []
    for each, box in zip(found, boxes, strict=True):
        image = np.full((math.ceil(both.shape[0] / step), math.ceil(both.shape[1] / step)), ALONE, np.uint8)
        top, left = (box.top - both.top) // step, (box.left - both.left) // step
        image[top : top + each.kinds.shape[0], left : left + each.kinds.shape[1]] = each.kinds
        images.append(image)
    rows, columns = np.nonzero(images[0] != images[1])
    if rows.size == 0:
        return NOTHING
    top, left, bottom, right = (int(edge) for edge in (rows.min(), columns.min(), rows.max() + 1, columns.max() + 1))
    return Box(top * step, left * step, bottom * step, right * step).shifted(both.top, both.left)


def _cells_of(found: Overlap, lattice: Grid) -> Box:
    """Return which cells of a map an overlap covers, also beyond its borders."""
    corner = lattice.map_from_grid.inverse() @ found.merged_from_grid
    top, left = round(corner.y_m / lattice.resolution_m), round(corner.x_m / lattice.resolution_m)
    step = round(found.resolution_m / lattice.resolution_m)
    rows, columns = found.kinds.shape
    return Box(top, left, top + rows * step, left + columns * step)
