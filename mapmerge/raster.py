"""Placed maps on the pixels of one picture: what each knows there, where their walls agree, and where they do not."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapmerge.config import CellConfig
from mapmerge.grid import MAX_PERCENT, UNKNOWN_BYTE, Grid, Mask
from mapmerge.overlap import AGREE, ALONE, CONTRADICT, overlap
from mapmerge.plane import Box
from mapmerge.resample import in_bands
from mapmerge.sim2 import Sim2
from mapmerge.warp import Layer, warped

_MARGIN_PX = 2
_ROUNDING = 1e-6


@dataclass(frozen=True, slots=True)
class Pixels:
    """The pixels of a picture in the merged frame: upright, row 0 with the lowest y.

    Parameters
    ----------
    x_m, y_m
        Outer corner of pixel (0, 0).
    pixel_m
        Side of a pixel.
    rows, cols
        How many there are.
    """

    x_m: float
    y_m: float
    pixel_m: float
    rows: int
    cols: int

    @property
    def lattice(self) -> Grid:
        """A grid without cells, on whose lattice they are."""
        return Grid(np.empty((0, 0), np.int8), self.pixel_m, Sim2(self.x_m, self.y_m))

    @property
    def width_m(self) -> float:
        """Extent along x."""
        return self.cols * self.pixel_m

    @property
    def height_m(self) -> float:
        """Extent along y."""
        return self.rows * self.pixel_m


def pixels_around(layers: Sequence[Layer], max_side_px: int) -> Pixels | None:
    """Return the pixels that show all that some maps know; None if they know nothing.

    A pixel is a cell of the finest map or, where that would be too many a side, larger.

    Parameters
    ----------
    layers
        The maps.
    max_side_px
        The most pixels a side.
    """
    shown = [(layer, layer.grid.cropped_to_known()) for layer in layers]
    shown = [(layer, known) for layer, known in shown if known.cells.size]
    if not shown:
        return None
    corners_m = np.concatenate(
        [(layer.merged_from_map @ known.map_from_grid).apply(_corners_m(known)) for layer, known in shown]
    )
    low, high = corners_m.min(axis=0), corners_m.max(axis=0)
    finest_m = min(layer.grid.resolution_m * layer.merged_from_map.scale for layer, _ in shown)
    side_px = max_side_px - 2 * _MARGIN_PX - 1
    pixel_m = max(finest_m, float((high - low).max()) / side_px)
    cols, rows = (max(1, math.ceil(side / pixel_m - _ROUNDING)) + 2 * _MARGIN_PX for side in (high - low).tolist())
    # on the lattice of the frame's own cells, so that a map that lies on it is shown as it is
    x_m, y_m = (math.floor(float(side) / pixel_m + _ROUNDING) * pixel_m - _MARGIN_PX * pixel_m for side in low)
    return Pixels(x_m, y_m, pixel_m, rows + 1, cols + 1)


def values_on(layer: Layer, pixels: Pixels, config: CellConfig) -> NDArray[np.uint8]:
    """Return what a map says at each pixel: a percentage, or `UNKNOWN_BYTE`; walls stay where pixels are larger."""
    whole = Box(0, 0, pixels.rows, pixels.cols)
    found = warped(layer, pixels.lattice, config).tile(whole)
    return np.full(whole.shape, UNKNOWN_BYTE, np.uint8) if found is None else found


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """What one map knows at each pixel, shape (rows, columns) each.

    Parameters
    ----------
    known, free, walls
        Where it knows anything, where that is free, and where that is a wall.
    """

    known: Mask
    free: Mask
    walls: Mask


def seen(values: NDArray[np.uint8], config: CellConfig) -> Seen:
    """Return what the values of a map say."""
    known = values <= MAX_PERCENT
    return Seen(known, values <= config.max_free_percent, known & (values >= config.min_occupied_percent))


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """How placed maps fit at each pixel, shape (rows, columns) each.

    Parameters
    ----------
    agree
        Where they say the same, as `mapmerge.overlap.AGREE` has it.
    contradict
        Where they say the contrary, as `mapmerge.overlap.CONTRADICT` has it.
    """

    agree: Mask
    contradict: Mask


def compared_on(layers: Sequence[Layer], pixels: Pixels, config: CellConfig, tolerance_m: float) -> Comparison:
    """Compare placed maps at each pixel.

    Parameters
    ----------
    layers
        The maps.
    pixels
        The pixels.
    config
        When a cell counts as occupied or free.
    tolerance_m
        How far walls that agree may be apart.
    """
    most = max(pixels.rows, pixels.cols)
    found = overlap(layers, pixels.lattice, config, tolerance_m=tolerance_m, max_side_cells=most)
    kinds = np.full((pixels.rows, pixels.cols), ALONE, np.uint8)
    if found is not None:
        left = round((found.merged_from_grid.x_m - pixels.x_m) / pixels.pixel_m)
        top = round((found.merged_from_grid.y_m - pixels.y_m) / pixels.pixel_m)
        there = Box(0, 0, *found.kinds.shape).shifted(top, left)
        whole = Box(0, 0, *kinds.shape)
        inside = there.within(whole)
        kinds[inside.slices(whole)] = found.kinds[inside.slices(there)]
    return Comparison(kinds == AGREE, kinds == CONTRADICT)


def shrunk(grid: Grid, max_side_cells: int, config: CellConfig) -> Grid:
    """Return what a map knows, so many times as coarse that no side has more cells."""
    known = grid.cropped_to_known()
    factor = math.ceil(max(known.cells.shape) / max_side_cells)
    return known if factor <= 1 else in_bands(known, factor, config)


def _corners_m(grid: Grid) -> NDArray[np.float64]:
    width_m, height_m = grid.cols * grid.resolution_m, grid.rows * grid.resolution_m
    return np.array([[0.0, 0.0], [width_m, 0.0], [width_m, height_m], [0.0, height_m]])
