"""Whether a robot's map jumped: its new and its previous grid disagree in its own map frame.

So do maps after a loop closure, or after SLAM began anew. A map that only grew says the same where both know something.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmerge.config import MergeConfig
from mapmerge.grid import UNKNOWN, Cells, Grid, Mask
from mapmerge.lattice import offset_cells
from mapmerge.plane import Box
from mapmerge.sim2 import IDENTITY
from mapmerge.warp import Layer, warped


def has_jumped(before: Grid, after: Grid, changed: Box | None, known_m2: float, config: MergeConfig) -> bool:
    """Tell whether a robot's new map contradicts the one before it by more than a SLAM's growth explains.

    Parameters
    ----------
    before, after
        The maps.
    changed
        Cells of ``after`` outside of which both say the same, see `mapmerge.lattice.changed_box`.
    known_m2
        What the map before knows.
    config
        Settings.
    """
    offset = offset_cells(before, after)
    if offset is None or changed is None:
        changed = Box(0, 0, *after.cells.shape)
        there = warped(Layer(before, IDENTITY), after, config.cells).tile(changed)
        old, new = np.full(changed.shape, UNKNOWN, np.int8) if there is None else there.view(np.int8), after.cells
        # what was known beyond the new map is not among these cells
        kept_m2 = int(np.count_nonzero((old >= 0) & (new >= 0))) * after.resolution_m**2
    else:
        around = changed.padded(math.ceil(config.verify.tolerance_m / after.resolution_m) + 2)
        old, new = _read(before, around.shifted(*offset)), _read(after, around)
        kept_m2 = known_m2 - int(np.count_nonzero((old >= 0) & (new < 0))) * after.resolution_m**2
    if kept_m2 < config.watch.least_kept_share * known_m2:
        return True
    walls_m = int(np.count_nonzero(before.cells >= config.cells.min_occupied_percent)) * before.resolution_m
    return _contradicts(old, new, walls_m, after.resolution_m, config)


def _contradicts(old: Cells, new: Cells, walls_m: float, resolution_m: float, config: MergeConfig) -> bool:
    """Tell whether walls stand where the other map is free, and off its walls: too many of all that were there."""
    limits = config.cells
    old_walls, new_walls = old >= limits.min_occupied_percent, new >= limits.min_occupied_percent
    gone = old_walls & (new >= 0) & (new <= limits.max_free_percent)
    came = new_walls & (old >= 0) & (old <= limits.max_free_percent)
    least_cells = config.verify.min_matched_wall_m / resolution_m
    if np.count_nonzero(gone) + np.count_nonzero(came) <= 2 * least_cells:
        return False
    tolerance_cells = max(1.0, config.verify.tolerance_m / resolution_m)
    far = np.count_nonzero(gone & _far(new_walls, tolerance_cells))
    far += np.count_nonzero(came & _far(old_walls, tolerance_cells))
    return bool(far > 2 * max(least_cells, config.watch.jump_share * walls_m / resolution_m))


def _far(walls: Mask, distance_cells: float) -> Mask:
    """Return which cells are farther from all walls."""
    if not walls.any():
        return np.ones(walls.shape, np.bool_)
    distance: NDArray[np.float32] = np.asarray(
        cv2.distanceTransform(np.where(walls, np.uint8(0), np.uint8(255)), cv2.DIST_L2, cv2.DIST_MASK_5), np.float32
    )
    return np.asarray(distance > distance_cells, np.bool_)


def _read(grid: Grid, box: Box) -> Cells:
    """Return the cells of a box, unknown where there are none."""
    whole = Box(0, 0, *grid.cells.shape)
    inside = box.within(whole)
    if inside == box:
        return grid.cells[box.slices(whole)]
    cells = np.full(box.shape, UNKNOWN, np.int8)
    cells[inside.slices(box)] = grid.cells[inside.slices(whole)]
    return cells
