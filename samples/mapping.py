"""Occupancy grid mapping with known poses: log-odds, a grid that grows with what the robot sees."""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmerge.grid import Cells, Grid
from mapmerge.sim2 import Points, Sim2

LogOdds = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class SensorModel:
    """The inverse sensor model.

    Parameters
    ----------
    resolution_m
        Side of a cell.
    hit, miss
        Probability of being occupied that one scan gives a cell where a beam ended, or that it passed.
    lowest, highest
        No cell gets more certain than this.
    """

    resolution_m: float = 0.05
    hit: float = 0.72
    miss: float = 0.43
    lowest: float = 0.03
    highest: float = 0.97


class Mapper:
    """One map in the making.

    Parameters
    ----------
    model
        How a scan changes the map.
    """

    __slots__ = ("_bounds", "_corner", "_log_odds", "_model", "_seen")

    _GROWTH = 64

    def __init__(self, model: SensorModel) -> None:
        self._model = model
        self._corner = (0, 0)
        self._log_odds: LogOdds = np.zeros((0, 0), np.float32)
        self._seen = np.zeros((0, 0), np.bool_)
        self._bounds: tuple[int, int, int, int] | None = None

    def add(self, at_m: tuple[float, float], ends_m: Points) -> None:
        """Add one scan.

        Parameters
        ----------
        at_m
            Where the scanner was, in the map frame.
        ends_m
            Shape (N, 2): where the beams ended, in the map frame.
        """
        cells = np.floor(np.vstack([ends_m, at_m]) / self._model.resolution_m).astype(np.int32)
        (col, row), (last_col, last_row) = cells.min(axis=0).tolist(), cells.max(axis=0).tolist()
        self._make_room(row, col, last_row, last_col)
        free, hit = _traced(cells - (col, row), (last_row - row + 1, last_col - col + 1))
        top, left = row - self._corner[0], col - self._corner[1]
        part = np.s_[top : top + free.shape[0], left : left + free.shape[1]]
        self._seen[part] |= free | hit
        change = np.where(hit, _logit(self._model.hit), np.where(free, _logit(self._model.miss), 0.0))
        lowest, highest = _logit(self._model.lowest), _logit(self._model.highest)
        self._log_odds[part] = np.clip(self._log_odds[part] + change.astype(np.float32), lowest, highest)

    def grid(self) -> Grid:
        """Return the map so far: the smallest rectangle that holds all that was seen."""
        if self._bounds is None:
            return Grid(np.zeros((0, 0), np.int8), self._model.resolution_m)
        row, col, last_row, last_col = self._bounds
        top, left = row - self._corner[0], col - self._corner[1]
        part = np.s_[top : top + last_row - row + 1, left : left + last_col - col + 1]
        percent = np.rint(100.0 / (1.0 + np.exp(-self._log_odds[part])))
        cells: Cells = np.where(self._seen[part], percent, -1.0).astype(np.int8)
        resolution_m = self._model.resolution_m
        return Grid(cells, resolution_m, Sim2(col * resolution_m, row * resolution_m))

    def _make_room(self, row: int, col: int, last_row: int, last_col: int) -> None:
        """Grow the arrays so that they hold the given cells, and note that the map reaches there."""
        old = self._bounds
        new = (row, col, last_row, last_col)
        if old is not None:
            new = (min(old[0], row), min(old[1], col), max(old[2], last_row), max(old[3], last_col))
        self._bounds = new
        rows, cols = self._log_odds.shape
        top, left = self._corner
        if old and new[0] >= top and new[1] >= left and new[2] < top + rows and new[3] < left + cols:
            return
        corner = (new[0] - self._GROWTH, new[1] - self._GROWTH)
        shape = (new[2] - corner[0] + self._GROWTH + 1, new[3] - corner[1] + self._GROWTH + 1)
        log_odds, seen = np.zeros(shape, np.float32), np.zeros(shape, np.bool_)
        if old is not None:
            part = np.s_[top - corner[0] : top - corner[0] + rows, left - corner[1] : left - corner[1] + cols]
            log_odds[part], seen[part] = self._log_odds, self._seen
        self._corner, self._log_odds, self._seen = corner, log_odds, seen


def _traced(cells: NDArray[np.int32], shape: tuple[int, int]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which cells the beams passed and in which they ended; the last of ``cells`` is the scanner's."""
    ends, origin = cells[:-1], cells[-1]
    passed = np.zeros(shape, np.uint8)
    beams = np.stack([np.broadcast_to(origin, ends.shape), ends], axis=1)
    cv2.polylines(passed, list(beams), isClosed=False, color=1)
    hit = np.zeros(shape, np.bool_)
    hit[ends[:, 1], ends[:, 0]] = True
    return (passed > 0) & ~hit, hit


def _logit(probability: float) -> float:
    return math.log(probability / (1.0 - probability))
