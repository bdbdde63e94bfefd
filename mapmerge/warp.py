"""Maps placed on the cells of a canvas."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmerge.config import CellConfig
from mapmerge.grid import UNKNOWN_BYTE, Grid
from mapmerge.plane import NOTHING, Box
from mapmerge.resample import at_resolution
from mapmerge.sim2 import Sim2

Bytes = NDArray[np.uint8]


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
    cell_from_canvas
        The affine map from cells of the canvas to its own, shape (2, 3).
    box
        The cells of the canvas that it may reach.
    """

    layer: Layer
    grid: Grid
    cell_from_canvas: NDArray[np.float64]
    box: Box

    @property
    def cells(self) -> Bytes:
        """Its cells, as bytes."""
        return self.grid.cells.view(np.uint8)

    @property
    def is_pooled(self) -> bool:
        """Whether its cells are not those of the map: how they are pooled depends on what is known."""
        return self.grid.resolution_m != self.layer.grid.resolution_m

    def on_canvas(self, cells: Box) -> Box:
        """Return the cells of the canvas on which some cells of the layer's map lie."""
        if cells.is_empty:
            return NOTHING
        resolution_m = self.grid.resolution_m
        corner = self.grid.map_from_grid.inverse() @ self.layer.grid.map_from_grid
        shift = round(corner.y_m / resolution_m), round(corner.x_m / resolution_m)
        top, left, bottom, right = cells.shifted(*shift).padded(1)
        linear = np.linalg.inv(self.cell_from_canvas[:, :2])
        corners = np.array([[left, top], [right, top], [left, bottom], [right, bottom]]) - self.cell_from_canvas[:, 2]
        return _box_around(corners @ linear.T)

    def tile(self, box: Box) -> Bytes | None:
        """Return its cells on a tile of the canvas, `UNKNOWN_BYTE` elsewhere, or None if it does not reach there.

        A cell of the canvas has the value of the layer's cell in which its middle lies, to a thousandth of a cell.
        """
        if self.box.within(box).is_empty:
            return None
        whole = Box(0, 0, *self.cells.shape)
        seen = self._under(box).within(whole)
        if seen.is_empty:
            return None
        matrix = self.cell_from_canvas.copy()
        # from the middles of pixels of the tile to those of the layer's part that is seen, as OpenCV counts them
        matrix[:, 2] += matrix[:, :2] @ (box.left + 0.5, box.top + 0.5) - (seen.left + 0.5, seen.top + 0.5)
        rows, cols = box.shape
        found = cv2.warpAffine(
            self.cells[seen.slices(whole)],
            matrix,
            (cols, rows),
            flags=cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_CONSTANT,
            borderValue=UNKNOWN_BYTE,
        )
        return np.asarray(found, np.uint8)

    def _under(self, box: Box) -> Box:
        """Return the cells of the layer that may lie under some cells of the canvas."""
        corners = np.array([[box.left, box.top], [box.right, box.top], [box.left, box.bottom], [box.right, box.bottom]])
        return _box_around(corners @ self.cell_from_canvas[:, :2].T + self.cell_from_canvas[:, 2]).padded(2)


def warped(layer: Layer, lattice: Grid, config: CellConfig) -> Warp:
    """Place a layer's known part on the lattice; a finer map is pooled first, so that thin walls stay."""
    scale = layer.merged_from_map.scale
    known = layer.grid.cropped_to_known()
    coarse_m = lattice.resolution_m / scale
    grid = at_resolution(known, coarse_m, config) if coarse_m > known.resolution_m else known
    lattice_from_grid = lattice.map_from_grid.inverse() @ layer.merged_from_map @ grid.map_from_grid
    linear = lattice_from_grid.linear * (grid.resolution_m / lattice.resolution_m)
    shift = np.array([lattice_from_grid.x_m, lattice_from_grid.y_m]) / lattice.resolution_m
    linear, shift = _snapped(linear, shift)
    inverse = np.linalg.inv(linear)
    cell_from_canvas = np.hstack([inverse, (-inverse @ shift)[:, None]])
    corners = np.array([[0, 0], [grid.cols, 0], [0, grid.rows], [grid.cols, grid.rows]]) @ linear.T + shift
    return Warp(layer, grid, cell_from_canvas, _box_around(corners) if grid.cells.size else NOTHING)


def _box_around(corners: NDArray[np.float64]) -> Box:
    """Return the cells that hold some points, shape (N, 2)."""
    low, high = np.floor(corners.min(axis=0) + 1e-6), np.ceil(corners.max(axis=0) - 1e-6)
    return Box(int(low[1]), int(low[0]), int(high[1]), int(high[0]))


def _snapped(
    linear: NDArray[np.float64], shift: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a map that is a whole shift but for rounding errors as exactly that, so that cells are copied as is."""
    whole = np.rint(shift)
    if np.allclose(linear, np.eye(2), rtol=0, atol=1e-7) and np.allclose(shift, whole, rtol=0, atol=1e-3):
        return np.eye(2), whole
    return linear, shift
