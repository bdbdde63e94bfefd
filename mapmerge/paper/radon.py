"""Turning a map so that its longest wall is parallel to an axis (equation 16)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmerge.paper.pixels import Image, binarised_again
from mapmerge.sim2 import Points, Sim2


@dataclass(frozen=True, slots=True, eq=False)
class Radon:
    """The Radon transform of a picture's occupied cells.

    Parameters
    ----------
    values
        Shape (angles, bins): cells on the line x cos α + y sin α = s.
    angle_step_rad
        Step of α, which begins at 0.
    """

    values: NDArray[np.float32]
    angle_step_rad: float

    @property
    def peak(self) -> tuple[int, int]:
        """Row and column of the largest value: the longest wall."""
        row, col = np.unravel_index(int(np.argmax(self.values)), self.values.shape)
        return int(row), int(col)

    @property
    def wall_normal_rad(self) -> float:
        """Direction α, in [0, π), at right angles to the longest wall."""
        return self.peak[0] * self.angle_step_rad

    @property
    def turn_rad(self) -> float:
        """The smallest turn, in [−π/4, π/4], that makes the longest wall parallel to an axis."""
        return 0.0 - math.remainder(self.wall_normal_rad, math.pi / 2)


def radon(occupied_m: Points, angle_step_rad: float, bin_m: float) -> Radon:
    """Return R(s, α) = Σ f(x, y) over x cos α + y sin α = s (equation 16).

    Parameters
    ----------
    occupied_m
        Centres of occupied cells, shape (N, 2).
    angle_step_rad
        Step of α; made to divide 90°, so that both directions of a right angle are met.
    bin_m
        Width of a line; each line is the sum of two neighbouring ones, so that no wall is halved.
    """
    angles = 2 * max(1, round(math.pi / 2 / angle_step_rad))
    if len(occupied_m) == 0:
        return Radon(np.zeros((angles, 1), np.float32), math.pi / angles)
    centred = occupied_m - 0.5 * (occupied_m.min(axis=0) + occupied_m.max(axis=0))
    reach_m = float(np.hypot(centred[:, 0], centred[:, 1]).max())
    bins = math.ceil(2 * reach_m / bin_m) + 2
    values = np.empty((angles, bins - 1), np.float32)
    for row in range(angles):
        alpha_rad = row * math.pi / angles
        offset_m = centred @ (math.cos(alpha_rad), math.sin(alpha_rad))
        counts = np.bincount(((offset_m + reach_m) / bin_m).astype(np.intp), minlength=bins)
        values[row] = counts[:-1] + counts[1:]
    return Radon(values, math.pi / angles)


@dataclass(frozen=True, slots=True, eq=False)
class Turned:
    """A turned binary picture.

    Parameters
    ----------
    interpolated
        As turned: grey at the borders of walls.
    binary
        The same binarised again.
    turned_from_grid
        Where the picture that was turned lies in the turned one, in metres from their corners.
    """

    interpolated: Image
    binary: Image
    turned_from_grid: Sim2


def turned(binary: Image, turn_rad: float, cell_m: float) -> Turned:
    """Return a picture turned by an angle, on a canvas that holds all of it."""
    if binary.size == 0:
        nothing = np.zeros((1, 1), np.uint8)
        return Turned(nothing, nothing, Sim2(yaw_rad=turn_rad))
    rows, cols = binary.shape
    corners = np.array([[0, 0], [cols, 0], [0, rows], [cols, rows]], np.float64) @ Sim2(yaw_rad=turn_rad).linear.T
    low, high = corners.min(axis=0), corners.max(axis=0)
    width, height = (max(1, math.ceil(side - 1e-9)) for side in high - low)
    linear = Sim2(yaw_rad=turn_rad).linear
    # a pixel's number is that of its centre, half a cell from its corner
    shift = linear @ (0.5, 0.5) - low - 0.5
    matrix = np.hstack([linear, shift[:, None]])
    picture = np.asarray(cv2.warpAffine(binary, matrix, (width, height), flags=cv2.INTER_LINEAR), np.uint8)
    pose = Sim2(-float(low[0]) * cell_m, -float(low[1]) * cell_m, turn_rad)
    return Turned(picture, binarised_again(picture), pose)
