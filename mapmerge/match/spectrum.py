"""Rotations between two maps from their orientation spectra.

The projection of the walls on an axis is sharp where walls stand at right angles to it: the energy of the Radon
transform (paper, equation 16) over its angle tells the directions of a building's walls, whatever the shift. The
spectra of two maps of one place are the same but for their turn.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from mapmerge.align import evenly, middle_of
from mapmerge.sim2 import Points

Spectrum = NDArray[np.float64]
Spectra = NDArray[np.float64]

_AT_ONCE = 1 << 15
_ENOUGH_WALLS = 5_000


def orientation_spectra(walls_m: Points, angle_step_rad: float, bin_m: float) -> Spectra:
    """Return two spectra of the walls for angles from 0 to π, shape (2, A), each with mean 0 and norm 1.

    The first sums the fourth power of the projections, so that a few long straight walls decide; the second the square,
    the energy of the Radon transform, to which all walls contribute.

    Parameters
    ----------
    walls_m
        Wall points, shape (N, 2). Of very many, some that are evenly spread are as good.
    angle_step_rad
        Step of the angles; rounded so that a whole number of steps makes π.
    bin_m
        Width of a bin of the projections.
    """
    angles = max(1, round(np.pi / angle_step_rad))
    walls_m = evenly(walls_m, _ENOUGH_WALLS)
    if len(walls_m) < 2:
        return np.zeros((2, angles))
    centred = (walls_m - middle_of(walls_m)) / bin_m
    reach = float(np.hypot(centred[:, 0], centred[:, 1]).max())
    bins = math.ceil(2 * reach) + 2
    turns = np.arange(angles) * np.pi / angles
    axes = np.stack([np.cos(turns), np.sin(turns), np.zeros(angles)], axis=1)
    columns = np.concatenate([centred.T, np.ones((1, len(centred)))])
    at_once = max(1, _AT_ONCE // len(walls_m))
    parts = [_energies(axes[first : first + at_once], columns, reach, bins) for first in range(0, angles, at_once)]
    spectra = np.concatenate(parts, axis=1)
    spectra -= spectra.mean(axis=1, keepdims=True)
    norm = np.linalg.norm(spectra, axis=1, keepdims=True)
    return spectra / np.where(norm > 0, norm, 1.0)


def _energies(axes: Points, columns: Points, reach: float, bins: int) -> Spectra:
    """Return the sums of the fourth powers and of the squares of the projections on some axes, shape (2, A).

    Parameters
    ----------
    axes
        Shape (A, 3): cosine, sine, and room for where the bins of each begin.
    columns
        Points in bins, and 1, shape (3, N).
    reach
        How far the furthest one is from the origin.
    bins
        How many there are of each projection.
    """
    # one count for all axes: the bins of each follow those of the one before
    axes[:, 2] = reach + bins * np.arange(len(axes))
    place = axes @ columns
    counts = np.bincount(place.astype(np.intp).ravel(), minlength=bins * len(axes)).reshape(len(axes), bins)
    # neighbouring bins are summed so that a wall on the border of two bins counts in full
    square = np.square(counts[:, :-1] + counts[:, 1:], dtype=np.float64)
    energies = np.empty((2, len(axes)))
    np.einsum("ab,ab->a", square, square, out=energies[0])
    np.sum(square, axis=1, out=energies[1])
    return energies


def spectrum_correlation(target: Spectrum, source: Spectrum) -> Spectrum:
    """Return how well the source's spectrum, turned by each angle, fits the target's: shape (A,), −1 to 1."""
    product = np.fft.rfft(target) * np.conj(np.fft.rfft(source))
    return np.fft.irfft(product, len(target))


def rotation_peaks(correlation: Spectrum, count: int) -> tuple[float, ...]:
    """Return up to ``count`` turns in [0, π) at which the spectra agree best, best first.

    Peaks are refined between the steps by the parabola through three values.
    """
    before, after = np.roll(correlation, 1), np.roll(correlation, -1)
    peaks = np.flatnonzero((correlation >= before) & (correlation > after))
    best = peaks[np.argsort(-correlation[peaks], kind="stable")][:count]
    curvature = before[best] - 2 * correlation[best] + after[best]
    shift = np.where(curvature < 0, 0.5 * (before[best] - after[best]) / np.minimum(curvature, -1e-12), 0.0)
    step_rad = np.pi / len(correlation)
    return tuple(float(angle) for angle in ((best + shift) * step_rad) % np.pi)
