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
from mapmerge.plane import Box, read
from mapmerge.reasons import Reason, ReasonCode
from mapmerge.sim2 import IDENTITY
from mapmerge.warp import Layer, warped


def jump(before: Grid, after: Grid, changed: Box | None, known_m2: float, config: MergeConfig) -> Reason | None:
    """Return how a robot's new map contradicts the one before it, if it does by more than a SLAM's growth explains.

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
        old, new = read(before.cells, around.shifted(*offset), UNKNOWN), read(after.cells, around, UNKNOWN)
        kept_m2 = known_m2 - int(np.count_nonzero((old >= 0) & (new < 0))) * after.resolution_m**2
    if kept_m2 < config.watch.least_kept_share * known_m2:
        message = f"of the {known_m2:.0f} m² that it knew before it still knows {kept_m2:.0f} m²"
        return Reason(ReasonCode.MAP_JUMPED, message)
    contradicted_m = _contradicted_cells(old, new, after.resolution_m, config) * after.resolution_m
    if contradicted_m <= config.verify.min_matched_wall_m:
        return None
    walls_m = int(np.count_nonzero(before.cells >= config.cells.min_occupied_percent)) * before.resolution_m
    if contradicted_m <= config.watch.jump_share * walls_m:
        return None
    message = f"{contradicted_m / walls_m:.0%} of its walls contradict what it was before"
    return Reason(ReasonCode.MAP_JUMPED, message)


def _contradicted_cells(old: Cells, new: Cells, resolution_m: float, config: MergeConfig) -> float:
    """Return how many cells of wall stand where the other map is free, and off its walls, mean of both directions."""
    limits = config.cells
    old_walls, new_walls = old >= limits.min_occupied_percent, new >= limits.min_occupied_percent
    gone = old_walls & (new >= 0) & (new <= limits.max_free_percent)
    came = new_walls & (old >= 0) & (old <= limits.max_free_percent)
    most = (int(np.count_nonzero(gone)) + int(np.count_nonzero(came))) / 2
    if most * resolution_m <= config.verify.min_matched_wall_m:
        return most
    tolerance_cells = max(1.0, config.verify.tolerance_m / resolution_m)
    far_gone, far_came = gone & _far(new_walls, tolerance_cells), came & _far(old_walls, tolerance_cells)
    return (int(np.count_nonzero(far_gone)) + int(np.count_nonzero(far_came))) / 2


def _far(walls: Mask, distance_cells: float) -> Mask:
    """Return which cells are farther from all walls."""
    if not walls.any():
        return np.ones(walls.shape, np.bool_)
    distance: NDArray[np.float32] = np.asarray(
        cv2.distanceTransform(np.where(walls, np.uint8(0), np.uint8(255)), cv2.DIST_L2, cv2.DIST_MASK_5), np.float32
    )
    return np.asarray(distance > distance_cells, np.bool_)
