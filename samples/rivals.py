"""Whether another placement, anywhere, explains two maps in every respect as well as the true one does.

A map of one plain room fits turned by 180° as well; a stretch of bare corridor fits further along. Buildings are built
at right angles, so turns by quarters from the truth are tried, with every shift.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmerge.sim2 import Points, Sim2
from samples.likeness import Look, agreement, shared_m2

_CELL_M = 0.2
_DISTINCT_M = 0.8
_PEAKS = 4
_ALIKE, _COARSELY_ALIKE = 0.97, 0.9
_ALIKE_AREA = 0.9
_NUDGES_M = (-0.15, -0.05, 0.05, 0.15)

Image = NDArray[np.float64]
Cell = tuple[int, int]


def has_rival(target: Look, source: Look, truth: Sim2) -> bool:
    """Tell whether a placement other than the true one explains two maps as well.

    The area that both maps know must be at least 0.9 times as large, and the walls must agree at least 0.97 times as
    well, in the worse of both directions.
    """
    least_m2 = _ALIKE_AREA * shared_m2(target, source, truth)
    least_agreement = _ALIKE * agreement(target, source, truth)
    return any(
        shared_m2(target, source, nudged) >= least_m2 and agreement(target, source, nudged) >= least_agreement
        for placement in _candidates(target, source, truth)
        for nudged in _nudged(placement)
    )


def _nudged(placement: Sim2) -> Iterator[Sim2]:
    for x_m, y_m in product(_NUDGES_M, _NUDGES_M):
        yield Sim2(x_m, y_m) @ placement


@dataclass(frozen=True, slots=True, eq=False)
class _Canvas:
    """Images of the target's map frame, with room for the source on all sides.

    Parameters
    ----------
    low_m
        Corner of cell (0, 0).
    rows, cols
        Size.
    """

    low_m: Points
    rows: int
    cols: int

    def drawn(self, points_m: Points, low_m: Points) -> Image:
        """Return an image, one where there are points; ``low_m`` is at cell (0, 0)."""
        cells = np.floor((points_m - low_m) / _CELL_M).astype(np.intp)
        image = np.zeros((self.rows, self.cols))
        image[np.clip(cells[:, 1], 0, self.rows - 1), np.clip(cells[:, 0], 0, self.cols - 1)] = 1.0
        return image

    def cell(self, place_m: Points) -> Cell:
        """Return the cell (row, column) of a shift."""
        col, row = np.rint((place_m - self.low_m) / _CELL_M).astype(int).tolist()
        return row, col


def _candidates(target: Look, source: Look, truth: Sim2) -> Iterator[Sim2]:
    """Yield placements that, looked at coarsely, may explain the maps as well."""
    walls_m, known_m = truth.apply(source.walls_m), truth.apply(source.known_m)
    centre_m = known_m.mean(axis=0)
    reach_m = float(np.hypot(*(known_m - centre_m).T).max()) + _CELL_M
    low_m = target.known_m.min(axis=0) - 2.0 * reach_m
    cols, rows = np.ceil((target.known_m.max(axis=0) + 2.0 * reach_m - low_m) / _CELL_M).astype(int).tolist()
    canvas = _Canvas(low_m, rows, cols)
    walls = cv2.dilate(canvas.drawn(target.walls_m, low_m), np.ones((3, 3)))
    known = cv2.morphologyEx(canvas.drawn(target.known_m, low_m), cv2.MORPH_CLOSE, np.ones((5, 5)))
    spectra = [np.fft.rfft2(image) for image in (walls, known * (1.0 - walls), known)]
    least: tuple[float, float] | None = None
    corner_m = centre_m - reach_m
    for quarter in range(4):
        turn = Sim2(*centre_m.tolist()) @ Sim2(yaw_rad=0.5 * math.pi * quarter) @ Sim2(*(-centre_m).tolist())
        parts = [np.conj(np.fft.rfft2(canvas.drawn(turn.apply(part), corner_m))) for part in (walls_m, known_m)]
        matched, violated, area = (
            np.fft.irfft2(spectrum * parts[part], (rows, cols))
            for spectrum, part in zip(spectra, (0, 0, 1), strict=True)
        )
        share: Image = matched / np.maximum(matched + violated, 1.0)
        row, col = canvas.cell(corner_m)
        if least is None:
            least = _COARSELY_ALIKE * float(share[row, col]), _ALIKE_AREA * float(area[row, col])
            _blank(share, (row, col))
        share[(share < least[0]) | (area < least[1])] = 0.0
        for peak in _peaks(share):
            yield Sim2((peak[1] - col) * _CELL_M, (peak[0] - row) * _CELL_M) @ turn @ truth


def _peaks(share: Image) -> Iterator[Cell]:
    """Yield the highest places that are not zero, none near a higher one."""
    left = share.copy()
    for _ in range(_PEAKS):
        row, col = divmod(int(left.argmax()), left.shape[1])
        if left[row, col] <= 0.0:
            return
        yield row, col
        _blank(left, (row, col))


def _blank(share: Image, at: Cell) -> None:
    reach = round(_DISTINCT_M / _CELL_M)
    share[max(at[0] - reach, 0) : at[0] + reach + 1, max(at[1] - reach, 0) : at[1] + reach + 1] = 0.0
