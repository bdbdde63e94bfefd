"""The image correction of section 4.2.1, from a map to straight walls of one width, step by step."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mapmerge.config import CellConfig, PaperConfig
from mapmerge.grid import Grid, cell_centres_m
from mapmerge.paper.interest import Cells, interest_points
from mapmerge.paper.pixels import Image, binarised, class_pixels, closed, thickened
from mapmerge.paper.radon import Radon, Turned, radon, turned
from mapmerge.paper.straighten import LineRule, straightened
from mapmerge.resample import at_resolution
from mapmerge.sim2 import Points, Sim2


@dataclass(frozen=True, slots=True, eq=False)
class Correction:
    """A map's picture after each step.

    Parameters
    ----------
    cell_m
        Side of a pixel.
    pixels
        The map as classes.
    binary
        After binarisation.
    radon
        The Radon transform of that.
    turned
        Turned parallel to the axes, and binarised again.
    closed
        After closing.
    marks
        Interest points of that (Algorithm 1).
    corrected
        Redrawn lines (Algorithm 2).
    thickened
        The same, dilated where its walls are thin: what SIFT sees.
    """

    cell_m: float
    pixels: Image
    binary: Image
    radon: Radon
    turned: Turned
    closed: Image
    marks: Cells
    corrected: Image
    thickened: Image

    @property
    def grid_from_turned(self) -> Sim2:
        """Where the turned picture lies in the frame of the map's grid, in metres."""
        return self.turned.turned_from_grid.inverse()

    def in_grid_m(self, pixels: Points) -> Points:
        """Return positions in the turned picture, whole numbers at centres of pixels, in the grid's frame."""
        return self.grid_from_turned.apply((pixels + 0.5) * self.cell_m)


def picture_grid(grid: Grid, least_cell_m: float, max_side_cells: int, config: CellConfig) -> Grid:
    """Return what is known of a map at its own resolution, coarser only if it were too large to work on."""
    known = grid.cropped_to_known()
    side_m = max(known.rows, known.cols) * known.resolution_m
    return at_resolution(known, max(known.resolution_m, least_cell_m, side_m / max_side_cells), config)


def correct(grid: Grid, cells: CellConfig, config: PaperConfig) -> Correction:
    """Return a map's picture after each of the five steps of the image correction (figure 4)."""
    cell_m = grid.resolution_m
    pixels = class_pixels(grid, cells)
    binary = binarised(pixels, config.binary_threshold)
    rows, cols = np.nonzero(binary)
    transform = radon(cell_centres_m(rows, cols, cell_m), config.angle_step_rad, max(config.radon_bin_m, cell_m))
    upright = turned(binary, transform.turn_rad, cell_m)
    filled = closed(upright.binary, side_px(config.closing_m, cell_m))
    marks = interest_points(filled, side_px(config.interest_m, cell_m))
    rule = LineRule(max(2, round(config.reach_m / cell_m)), config.min_line_share)
    lines = straightened(filled, marks, rule)
    thick = thickened(lines, side_px(config.min_wall_m, cell_m))
    return Correction(cell_m, pixels, binary, transform, upright, filled, marks, lines, thick)


def side_px(side_m: float, cell_m: float) -> int:
    """Return the side of a square in pixels: odd, and at least 3, as a square of one pixel does nothing."""
    return max(3, 2 * math.floor(side_m / cell_m / 2 + 1e-9) + 1)
