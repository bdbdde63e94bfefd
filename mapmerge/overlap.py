"""Where placed maps agree, and where they contradict each other, as an image: to look at, nothing is decided by it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmerge.config import CellConfig
from mapmerge.grid import UNKNOWN, Grid
from mapmerge.plane import NOTHING, Box
from mapmerge.sim2 import Sim2
from mapmerge.warp import Bytes, Layer, Warp, warped

ALONE = 0
"""At most one map knows the cell."""
AGREE = 1
"""Two maps or more know it as free, or have a wall within the tolerance, and none says the contrary."""
CONTRADICT = 2
"""It is a wall of one map and, within the tolerance, free space of another."""
SHARED = 3
"""Two maps or more know it, and say neither the same nor the contrary: not all of them are sure of it."""

_BAND_CELLS = 256


@dataclass(frozen=True, slots=True, eq=False)
class Overlap:
    """Where maps say the same, and where they do not.

    Parameters
    ----------
    kinds
        Shape (rows, columns), uint8: `ALONE`, `AGREE`, `CONTRADICT` or `SHARED`; row 0 has the lowest y.
    resolution_m
        Side of a cell.
    merged_from_grid
        Where the outer corner of cell (0, 0) lies in the merged frame.
    """

    kinds: NDArray[np.uint8]
    resolution_m: float
    merged_from_grid: Sim2


def overlap(
    layers: Sequence[Layer], lattice: Grid, config: CellConfig, *, tolerance_m: float, max_side_cells: int
) -> Overlap | None:
    """Compare placed maps cell by cell.

    Memory is that of some images of at most ``max_side_cells`` a side, whatever the size of the maps.

    Parameters
    ----------
    layers
        The placed maps, in any order.
    lattice
        The merged map: its frame and resolution are those of the outcome, unless that would be too large.
    config
        When a cell is occupied or free.
    tolerance_m
        How far a wall of one map may lie from that of another and be the same.
    max_side_cells
        Longest side of the outcome; more ground is compared in larger cells.

    Returns
    -------
    Overlap or None
        Cropped to where two boxes of maps meet; None where none do.
    """
    resolution_m = lattice.resolution_m * max(1, math.ceil(max(lattice.cells.shape) / max_side_cells))
    coarse = Grid(np.empty((0, 0), np.int8), resolution_m, lattice.map_from_grid)
    warps = [warped(_coarser(layer, resolution_m), coarse, config) for layer in layers]
    box = _shared([warp.box for warp in warps])
    if box.is_empty:
        return None
    reach = max(1, round(tolerance_m / resolution_m))
    corner = Sim2(box.left * resolution_m, box.top * resolution_m)
    # a wall just outside may be the one that another within is near to
    around = box.padded(reach)
    kinds = _compared(warps, around, reach, config)[box.slices(around)]
    return Overlap(kinds, resolution_m, lattice.map_from_grid @ corner)


def _coarser(layer: Layer, resolution_m: float) -> Layer:
    """Return a layer whose map is about as coarse as the outcome, if it is much finer.

    A cell is as occupied as its most occupied part. Only that is asked here, and it is ten times as fast as the mean.
    """
    factor = int(resolution_m / layer.merged_from_map.scale / layer.grid.resolution_m + 1e-6)
    grid = layer.grid
    if factor < 2 or grid.cells.size == 0:
        return layer
    whole, square = Box(0, 0, *grid.cells.shape), np.ones((factor, factor), np.uint8)
    parts = []
    for band in whole.bands(_BAND_CELLS * factor):
        above_unknown = grid.cells[band.slices(whole)].view(np.uint8) + np.uint8(1)
        highest = cv2.dilate(above_unknown, square, anchor=(0, 0), borderType=cv2.BORDER_CONSTANT, borderValue=0)
        parts.append(highest[::factor, ::factor] - np.uint8(1))
    pooled = Grid(np.concatenate(parts).view(np.int8), grid.resolution_m * factor, grid.map_from_grid, is_own=True)
    return Layer(pooled, layer.merged_from_map)


def _shared(boxes: Sequence[Box]) -> Box:
    """Return a box around all ground over which two boxes meet."""
    found = NOTHING
    for index, one in enumerate(boxes):
        for other in boxes[index + 1 :]:
            met = one.within(other)
            if not met.is_empty:
                found = found.union(met)
    return found


def _compared(warps: Sequence[Warp], box: Box, reach: int, config: CellConfig) -> Bytes:
    """Return the kind of each cell, given how many cells off a wall may be."""
    around = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
    any_wall, any_clear = np.zeros(box.shape, bool), np.zeros(box.shape, bool)
    near_walls, free, known = (np.zeros(box.shape, np.uint16) for _ in range(3))
    for warp in warps:
        tile = warp.tile(box)
        if tile is None:
            continue
        cells = tile.view(np.int8)
        wall = cells >= config.min_occupied_percent
        is_free = (cells > UNKNOWN) & (cells <= config.max_free_percent)
        near = cv2.dilate(wall.view(np.uint8), around).view(bool)
        any_wall |= wall
        any_clear |= is_free & ~near
        near_walls += near
        free += is_free
        known += cells > UNKNOWN
    contradict = any_wall & any_clear
    agree = ((free > 1) | (any_wall & (near_walls > 1))) & ~contradict
    kinds = np.where(known > 1, np.uint8(SHARED), np.uint8(ALONE))
    kinds[agree] = AGREE
    kinds[contradict] = CONTRADICT
    return kinds
