"""Maps placed on the cells of a canvas."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmerge.config import CellConfig
from mapmerge.grid import UNKNOWN_BYTE, Grid
from mapmerge.plane import NOTHING, Box, read
from mapmerge.resample import at_resolution
from mapmerge.sim2 import Sim2

Bytes = NDArray[np.uint8]

_SAME_TURN = 1e-7
_WHOLE = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Layer:
    """One placed map: the grid and where its map frame lies in the merged frame."""

    grid: Grid
    merged_from_map: Sim2

    def is_same(self, other: Layer) -> bool:
        """Tell whether this is the very same grid at the same place."""
        return self.grid is other.grid and self.merged_from_map == other.merged_from_map


@dataclass(frozen=True, slots=True, eq=False)
class Warp:
    """A layer on the canvas.

    Parameters
    ----------
    layer
        Where it is from.
    grid
        Its known part, pooled if it is finer than the canvas.
    canvas_from_cell, cell_from_canvas
        The affine maps from its own cells to those of the canvas, and back, shape (2, 3).
    box
        The cells of the canvas that it may reach.
    whole_shift
        Rows and columns from cells of the canvas to its own, if these are the same ones.
    """

    layer: Layer
    grid: Grid
    canvas_from_cell: NDArray[np.float64]
    cell_from_canvas: NDArray[np.float64]
    box: Box
    whole_shift: tuple[int, int] | None

    @property
    def cells(self) -> Bytes:
        """Its cells, as bytes."""
        return self.grid.cells.view(np.uint8)

    @property
    def is_pooled(self) -> bool:
        """Whether its cells are not those of the map: how they are pooled depends on what is known."""
        return self.grid.resolution_m != self.layer.grid.resolution_m

    def of_map(self, cells: Box) -> Box:
        """Return which of its cells are these cells of the layer's map, unless it is pooled."""
        if cells.is_empty:
            return NOTHING
        resolution_m = self.grid.resolution_m
        corner = self.grid.map_from_grid.inverse() @ self.layer.grid.map_from_grid
        return cells.shifted(round(corner.y_m / resolution_m), round(corner.x_m / resolution_m))

    def over(self, cells: Box) -> Box:
        """Return the cells of the canvas that may lie over some of its cells."""
        return NOTHING if cells.is_empty else _box_around(cells.padded(1), self.canvas_from_cell)

    def under(self, box: Box) -> Box:
        """Return the cells, counted as its own, that may lie under some cells of the canvas."""
        if self.whole_shift is not None:
            return box.shifted(*self.whole_shift)
        return _box_around(box, self.cell_from_canvas).padded(2)

    def tile(self, box: Box) -> Bytes | None:
        """Return its cells on a tile of the canvas, `UNKNOWN_BYTE` elsewhere, or None if it knows nothing there.

        A cell of the canvas has the value of the layer's cell in which its middle lies, to a thousandth of a cell.
        """
        if self.box.within(box).is_empty:
            return None
        whole = Box(0, 0, *self.grid.cells.shape)
        under = self.under(box)
        seen = under.within(whole)
        if seen.is_empty or self.grid.cells[seen.slices(whole)].max() < 0:
            return None
        return self._turned(box, seen) if self.whole_shift is None else read(self.cells, under, UNKNOWN_BYTE)

    def _turned(self, box: Box, seen: Box) -> Bytes:
        """Return its cells on a tile of the canvas, given those under it."""
        matrix = self.cell_from_canvas.copy()
        # from the middles of pixels of the tile to those of the layer's part that is seen, as OpenCV counts them
        matrix[:, 2] += matrix[:, :2] @ (box.left + 0.5, box.top + 0.5) - (seen.left + 0.5, seen.top + 0.5)
        rows, cols = box.shape
        found = cv2.warpAffine(
            self.cells[seen.slices(Box(0, 0, *self.cells.shape))],
            matrix,
            (cols, rows),
            flags=cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=UNKNOWN_BYTE,
        )
        return np.asarray(found, np.uint8)


def warped(layer: Layer, lattice: Grid, config: CellConfig) -> Warp:
    """Place a layer's known part on the lattice; a finer map is pooled first, so that thin walls stay."""
    scale = layer.merged_from_map.scale
    known = layer.grid.cropped_to_known()
    coarse_m = lattice.resolution_m / scale
    grid = at_resolution(known, coarse_m, config) if coarse_m > known.resolution_m else known
    lattice_from_grid = lattice.map_from_grid.inverse() @ layer.merged_from_map @ grid.map_from_grid
    linear = lattice_from_grid.linear * (grid.resolution_m / lattice.resolution_m)
    shift = np.array([lattice_from_grid.x_m, lattice_from_grid.y_m]) / lattice.resolution_m
    whole_shift = _whole_shift(linear, shift)
    if whole_shift is not None:
        linear, shift = np.eye(2), -np.array(whole_shift[::-1], np.float64)
    inverse = np.linalg.inv(linear) if whole_shift is None else linear
    canvas_from_cell = np.hstack([linear, shift[:, None]])
    cell_from_canvas = np.hstack([inverse, (-inverse @ shift)[:, None]])
    box = _box_around(Box(0, 0, *grid.cells.shape), canvas_from_cell) if grid.cells.size else NOTHING
    return Warp(layer, grid, canvas_from_cell, cell_from_canvas, box, whole_shift)


def _box_around(box: Box, affine: NDArray[np.float64]) -> Box:
    """Return the cells that hold a box after an affine map, shape (2, 3)."""
    # in plain numbers: for the four corners of many tiles several times as fast as in arrays
    (a, b, x), (c, d, y) = affine.tolist()
    xs = [a * col + b * row + x for col in (box.left, box.right) for row in (box.top, box.bottom)]
    ys = [c * col + d * row + y for col in (box.left, box.right) for row in (box.top, box.bottom)]
    low, high = (math.floor(min(ys) + 1e-6), math.floor(min(xs) + 1e-6)), (max(ys) - 1e-6, max(xs) - 1e-6)
    return Box(*low, math.ceil(high[0]), math.ceil(high[1]))


def _whole_shift(linear: NDArray[np.float64], shift: NDArray[np.float64]) -> tuple[int, int] | None:
    """Return rows and columns from the canvas to a layer that lies there by a whole shift, but for rounding errors.

    Its cells are then copied as they are. None if it lies otherwise.
    """
    ((a, b), (c, d)), (x, y) = linear.tolist(), shift.tolist()
    if max(abs(a - 1.0), abs(b), abs(c), abs(d - 1.0)) > _SAME_TURN:
        return None
    if max(abs(x - round(x)), abs(y - round(y))) > _WHOLE:
        return None
    return -round(y), -round(x)
