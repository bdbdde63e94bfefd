"""Grids at another resolution."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mapmerge.config import CellConfig
from mapmerge.grid import UNKNOWN, Cells, Grid
from mapmerge.plane import Box

_SAME = 1e-6
_BAND_CELLS = 256


def at_resolution(grid: Grid, resolution_m: float, config: CellConfig) -> Grid:
    """Return the map at this resolution, its origin unchanged.

    Coarser: a cell is as occupied as its most occupied part where that counts as occupied, so that thin walls stay;
    else it is the mean of what is known. Finer: cells are repeated.
    """
    ratio = resolution_m / grid.resolution_m
    if abs(ratio - 1.0) < _SAME:
        return grid
    if grid.cells.size == 0:
        return Grid(grid.cells, resolution_m, grid.map_from_grid, is_own=True)
    cells = _pooled(grid.cells, ratio, config) if ratio > 1.0 else _repeated(grid.cells, ratio)
    return Grid(cells, resolution_m, grid.map_from_grid, is_own=True)


def in_bands(grid: Grid, factor: int, config: CellConfig) -> Grid:
    """Return the map so many times as coarse, as `at_resolution` does, in the memory of a part of it."""
    whole, resolution_m = Box(0, 0, *grid.cells.shape), grid.resolution_m * factor
    parts = [
        at_resolution(Grid(grid.cells[band.slices(whole)], grid.resolution_m), resolution_m, config).cells
        for band in whole.bands(_BAND_CELLS * factor)
    ]
    return Grid(np.concatenate(parts), resolution_m, grid.map_from_grid, is_own=True)


def _starts(count: int, ratio: float) -> NDArray[np.intp]:
    """First fine index of each coarse cell along one axis."""
    coarse = math.ceil(count / ratio - _SAME)
    starts = np.ceil(np.arange(coarse) * ratio - 0.5 - _SAME).astype(np.intp)
    return np.asarray(starts[starts < count], np.intp)


def _pooled(cells: Cells, ratio: float, config: CellConfig) -> Cells:
    rows, cols = _starts(cells.shape[0], ratio), _starts(cells.shape[1], ratio)

    def reduce(ufunc: np.ufunc, values: NDArray[np.int32] | Cells) -> NDArray[np.int32]:
        partial = ufunc.reduceat(values, rows, axis=0)
        return np.asarray(ufunc.reduceat(partial, cols, axis=1), dtype=np.int32)

    highest = reduce(np.maximum, cells)
    known = (cells >= 0).astype(np.int32)
    count = reduce(np.add, known)
    total = reduce(np.add, cells * known)
    mean = np.where(count > 0, (2 * total + count) // np.maximum(2 * count, 1), UNKNOWN)
    return np.where(highest >= config.min_occupied_percent, highest, mean).astype(np.int8)


def _repeated(cells: Cells, ratio: float) -> Cells:
    def indices(count: int) -> NDArray[np.intp]:
        fine = math.ceil(count / ratio - _SAME)
        nearest = ((np.arange(fine) + 0.5) * ratio).astype(np.intp)
        return np.asarray(np.minimum(nearest, count - 1), np.intp)

    return cells[np.ix_(indices(cells.shape[0]), indices(cells.shape[1]))]
