"""Whether a robot's map jumped: its new and its previous grid disagree in its own map frame.

So do maps after a loop closure, or after SLAM began anew. A map that only grew says the same where both know something.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmerge.config import MergeConfig
from mapmerge.grid import UNKNOWN, Cells, Grid, Mask
from mapmerge.lattice import changed_box, offset_cells
from mapmerge.plane import Box
from mapmerge.sim2 import IDENTITY
from mapmerge.warp import Layer, warped


@dataclass(frozen=True, slots=True)
class Difference:
    """How two maps of one robot differ in its map frame.

    Parameters
    ----------
    contradicted_share
        Share of the walls that the other map shows as free space, off its own walls, mean of both directions.
    kept_share
        Share of what the first map knows that the second one knows as well.
    """

    contradicted_share: float
    kept_share: float

    def is_jump(self, config: MergeConfig) -> bool:
        """Tell whether they differ by more than growth explains."""
        limits = config.watch
        return self.contradicted_share > limits.jump_share or self.kept_share < limits.least_kept_share


def difference(before: Grid, after: Grid, config: MergeConfig) -> Difference:
    """Return how a robot's new map differs from the one before it; only what changed is compared cell by cell."""
    offset, changed = offset_cells(before, after), changed_box(before, after)
    if offset is None or changed is None:
        changed = Box(0, 0, *after.cells.shape)
        there = warped(Layer(before, IDENTITY), after, config.cells).tile(changed)
        old = np.full(changed.shape, UNKNOWN, np.int8) if there is None else there.view(np.int8)
        return _compared(old, after.cells, _Totals.of(old, config), config, after.resolution_m)
    reach = max(1, round(config.verify.tolerance_m / after.resolution_m)) + 2
    around = changed.padded(reach)
    old, new = _read(before, around.shifted(*offset)), _read(after, around)
    totals = _Totals.of(before.cells, config)
    return _compared(old, new, totals, config, after.resolution_m)


@dataclass(frozen=True, slots=True)
class _Totals:
    """Cells of the whole map before."""

    known: int
    walls: int

    @staticmethod
    def of(cells: Cells, config: MergeConfig) -> _Totals:
        occupied = int(np.count_nonzero(cells >= config.cells.min_occupied_percent))
        return _Totals(int(np.count_nonzero(cells >= 0)), occupied)


def _compared(old: Cells, new: Cells, totals: _Totals, config: MergeConfig, resolution_m: float) -> Difference:
    """Compare cells of both maps, outside of which both say the same."""
    limits, tolerance_cells = config.cells, max(1.0, config.verify.tolerance_m / resolution_m)
    old_walls, new_walls = old >= limits.min_occupied_percent, new >= limits.min_occupied_percent
    contradicted = 0
    for walls, others, other in ((old_walls, new_walls, new), (new_walls, old_walls, old)):
        free = (other >= 0) & (other <= limits.max_free_percent)
        contradicted += int(np.count_nonzero(walls & free & _far(others, tolerance_cells)))
    forgotten = int(np.count_nonzero((old >= 0) & (new < 0)))
    return Difference(
        contradicted_share=contradicted / 2 / totals.walls if totals.walls else 0.0,
        kept_share=1.0 - forgotten / totals.known if totals.known else 1.0,
    )


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
