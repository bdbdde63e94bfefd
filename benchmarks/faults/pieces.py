"""By how much maps, or pieces of them, are shifted: damage moves bytes, and so cells along their rows."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

_LEAST_ALIKE, _LEAST_PIECE = 0.95, 0.25
_SHIFTS = 8
_WALL = 50


def alike(cells: np.ndarray, others: np.ndarray) -> float:
    """Return the share of cells that are the same, of those known in either; 0 of arrays of two shapes."""
    if cells.shape != others.shape:
        return 0.0
    known = (cells >= 0) | (others >= 0)
    return float(np.mean(cells[known] == others[known])) if known.any() else 0.0


def shifts(cells: np.ndarray, others: np.ndarray) -> Iterator[tuple[int, int]]:
    """Yield by how many columns and rows pieces of another map are shifted that a map shows."""
    flat, other = cells.reshape(-1), others.reshape(-1)
    if cells.shape != others.shape or not (flat >= 0).any():
        return
    for by in _likely_shifts(flat, other):
        if _piece(flat, _moved(other, by)) >= _LEAST_PIECE:
            rows = round(by / cells.shape[1])
            yield by - rows * cells.shape[1], rows


def _piece(flat: np.ndarray, other: np.ndarray) -> float:
    """Return which share of the known cells is in the longest stretch in which both are nearly the same."""
    known = (flat >= 0) | (other >= 0)
    # The stretch with the largest sum is one in which at least the wanted share agrees.
    against = _LEAST_ALIKE / (1 - _LEAST_ALIKE)
    sums = np.concatenate([[0.0], np.cumsum(np.where(flat == other, 1.0, -against) * known)])
    gains = sums - np.minimum.accumulate(sums)
    end = int(np.argmax(gains))
    begin = int(np.argmin(sums[: end + 1]))
    return float(np.sum(flat[begin:end] >= 0) / np.sum(flat >= 0))


def _moved(flat: np.ndarray, by: int) -> np.ndarray:
    """Return cells moved along the bytes, with unknown ones where there are none."""
    moved = np.full_like(flat, -1)
    if by >= 0:
        moved[by:] = flat[: len(flat) - by]
    else:
        moved[:by] = flat[-by:]
    return moved


def _likely_shifts(flat: np.ndarray, other: np.ndarray) -> list[int]:
    """Return the shifts at which most known cells, or most walls, are the same, and none.

    Walls are narrow: of a piece of a map they tell by how much it is shifted, where free space says little.
    """
    walls = _correlated(flat >= _WALL, other >= _WALL)
    known = walls + _correlated((flat >= 0) & (flat < _WALL), (other >= 0) & (other < _WALL))
    best = (int(by) for same in (walls, known) for by in np.argsort(same, kind="stable")[-_SHIFTS:])
    return sorted({0, *(by - len(walls) if by >= len(flat) else by for by in best)})


def _correlated(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return for each shift how often both are so; shifts to the left are at the end."""
    # a power of two, of which it is fast
    size = 1 << (2 * len(one) - 1).bit_length()
    spectrum = np.fft.rfft(one, size) * np.conj(np.fft.rfft(other, size))
    return np.round(np.fft.irfft(spectrum, size))
