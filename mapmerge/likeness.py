"""How alike a map and the true map of the same place are, where it is known how they lie."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmerge.config import CellConfig
from mapmerge.fuse import fuse
from mapmerge.grid import UNKNOWN_BYTE, Grid, Mask
from mapmerge.plane import Box, read
from mapmerge.sim2 import Sim2
from mapmerge.warp import Layer

_FAR_PERCENTILE = 95.0


@dataclass(frozen=True, slots=True)
class Likeness:
    """How alike they are. What one of them does not know is not held against the other.

    Parameters
    ----------
    walls_right
        Share of the map's wall cells, as far as the true map tells of their surroundings, that have a true wall within
        the tolerance; None if there is none.
    walls_found
        Share of the true wall cells, as far as the map knows their surroundings, that have a wall of the map within the
        tolerance; None if there is none.
    wall_error_m, far_wall_error_m
        How far the map's wall cells are from the nearest true wall: the median, and what 95% stay within.
    cells_alike
        Share of the cells that both call occupied or free and of which both say the same; None if there is none.
    free_iou
        Area that both call free over the area that either does, of what the true map knows; None if there is none.
    free_covered
        Share of the truly free area that the map calls free; None if there is none.
    """

    walls_right: float | None
    walls_found: float | None
    wall_error_m: float | None
    far_wall_error_m: float | None
    cells_alike: float | None
    free_iou: float | None
    free_covered: float | None


def likeness(found: Grid, true: Grid, found_from_true: Sim2, tolerance_m: float, config: CellConfig) -> Likeness:
    """Compare a map with the true one, on the map's own cells.

    Parameters
    ----------
    found, true
        The maps; the true one is pooled if it is finer.
    found_from_true
        Where the true map's frame lies in the map's.
    tolerance_m
        How far apart a wall and its true place may be.
    config
        When a cell counts as occupied or free.
    """
    cells, true_cells = _on_one_canvas(found, fuse([Layer(true, found_from_true)], found, config).grid)
    occupied, true_occupied = (_occupied(each, config) for each in (cells, true_cells))
    free, true_free = (each <= config.max_free_percent for each in (cells, true_cells))
    reach = tolerance_m / found.resolution_m
    to_true, to_found = _distances(true_occupied), _distances(occupied)
    judged = to_true[occupied & _near(true_cells != UNKNOWN_BYTE, reach)]
    seen = to_found[true_occupied & _near(cells != UNKNOWN_BYTE, reach)]
    decided = (occupied | free) & (true_occupied | true_free)
    either = (free & (true_cells != UNKNOWN_BYTE)) | true_free
    return Likeness(
        walls_right=_share(judged <= reach),
        walls_found=_share(seen <= reach),
        wall_error_m=_percentile_m(judged, 50.0, found.resolution_m),
        far_wall_error_m=_percentile_m(judged, _FAR_PERCENTILE, found.resolution_m),
        cells_alike=_share((occupied == true_occupied)[decided]),
        free_iou=_share((free & true_free)[either]),
        free_covered=_share(free[true_free]),
    )


def _on_one_canvas(found: Grid, true: Grid) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Return the cells of two grids on the same lattice, as bytes, as far as either reaches."""
    shift = found.map_from_grid.inverse() @ true.map_from_grid
    own = Box(0, 0, *found.cells.shape)
    top, left = round(shift.y_m / found.resolution_m), round(shift.x_m / found.resolution_m)
    whole = own.union(Box(0, 0, *true.cells.shape).shifted(top, left))
    return (
        read(found.cells.view(np.uint8), whole, UNKNOWN_BYTE),
        read(true.cells.view(np.uint8), whole.shifted(-top, -left), UNKNOWN_BYTE),
    )


def _occupied(cells: NDArray[np.uint8], config: CellConfig) -> Mask:
    return np.asarray((cells >= config.min_occupied_percent) & (cells != UNKNOWN_BYTE), np.bool_)


def _distances(walls: Mask) -> NDArray[np.float32]:
    """Return how far each cell is from the nearest wall, in cells; infinite without walls."""
    if not walls.any():
        return np.full(walls.shape, np.inf, np.float32)
    return np.asarray(cv2.distanceTransform((~walls).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE), np.float32)


def _near(mask: Mask, reach: float) -> Mask:
    return np.asarray(_distances(mask) <= reach, np.bool_)


def _share(holds: Mask) -> float | None:
    return float(holds.mean()) if holds.size else None


def _percentile_m(distances: NDArray[np.float32], percent: float, cell_m: float) -> float | None:
    if not distances.size:
        return None
    value = float(np.percentile(distances, percent)) * cell_m
    return value if np.isfinite(value) else None
