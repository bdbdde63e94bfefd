"""Hough spectra: S. Carpin, "Fast and accurate map merging for multi-robot systems", Autonomous Robots 25, 2008.

The rotations are the peaks of the circular cross-correlation of the two maps' Hough spectra; for each, the shifts along
x and y are the peaks of the cross-correlations of the projections of the walls onto the axes, the first map turned so
that its longest walls lie along them. The best of all by the acceptance index is taken if that is 0.95 or more.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from benchmarks.methods import Placed
from mapmerge.config import CellConfig
from mapmerge.grid import Grid
from mapmerge.resample import at_resolution
from mapmerge.sim2 import Points, Sim2
from samples.mission import known_at

_STEP_DEG = 0.5
_ROTATIONS = 4
_MIN_ACCEPTANCE = 0.95
_LEAST_WALLS = 10
_CELLS = CellConfig()

Spectrum = NDArray[np.float64]


def hough_spectra(target: Grid, source: Grid) -> Placed:
    """Place a map by Hough spectra."""
    resolution_m = max(target.resolution_m, source.resolution_m)
    grids = [at_resolution(grid.cropped_to_known(), resolution_m, _CELLS) for grid in (target, source)]
    walls = [grid.centres_m(grid.cells >= _CELLS.min_occupied_percent) for grid in grids]
    if min(map(len, walls)) < _LEAST_WALLS:
        return Placed(None, False, "too few walls")
    spectra = [hough_spectrum(points, resolution_m) for points in walls]
    upright = Sim2(yaw_rad=-math.radians(float(spectra[0].argmax()) * _STEP_DEG))
    upright_walls = upright.apply(walls[0])
    best: tuple[float, Sim2] | None = None
    for turn_rad in rotations(*spectra):
        turn = upright @ Sim2(yaw_rad=turn_rad)
        turned = turn.apply(walls[1])
        x_m, y_m = (_shift_m(upright_walls[:, axis], turned[:, axis], resolution_m) for axis in (0, 1))
        placement = upright.inverse() @ Sim2(x_m, y_m) @ turn
        acceptance = acceptance_index(grids[0], grids[1], placement)
        if best is None or acceptance > best[0]:
            best = acceptance, placement
    if best is None:
        return Placed(None, False, "no rotation")
    accepted = best[0] >= _MIN_ACCEPTANCE
    return Placed(best[1], accepted, "accepted" if accepted else "low_acceptance")


def hough_spectrum(walls_m: Points, resolution_m: float) -> Spectrum:
    """Return, for the direction of each normal from 0 to 180°, the sum of the squares of the Hough transform."""
    angles_rad = np.radians(np.arange(0.0, 180.0, _STEP_DEG))
    spectrum = np.empty(angles_rad.size)
    for index, angle_rad in enumerate(angles_rad.tolist()):
        along = np.floor((walls_m @ [math.cos(angle_rad), math.sin(angle_rad)]) / resolution_m).astype(np.intp)
        spectrum[index] = np.sum(np.bincount(along - along.min()).astype(np.float64) ** 2)
    return spectrum


def rotations(target: Spectrum, source: Spectrum) -> list[float]:
    """Return the likeliest rotations target_from_source, each also turned by 180°, which the spectra cannot tell."""
    correlation = np.fft.irfft(np.fft.rfft(target) * np.conj(np.fft.rfft(source)), target.size)
    is_peak = (correlation >= np.roll(correlation, 1)) & (correlation > np.roll(correlation, -1))
    peaks = np.flatnonzero(is_peak)
    best = peaks[np.argsort(-correlation[peaks], kind="stable")][:_ROTATIONS]
    return [math.radians(index * _STEP_DEG + half) for index in best.tolist() for half in (0.0, 180.0)]


def _shift_m(target_m: NDArray[np.float64], source_m: NDArray[np.float64], resolution_m: float) -> float:
    """Return the shift at which the projections of two maps' walls onto an axis correlate best."""
    low_m = [float(values.min()) for values in (target_m, source_m)]
    counts = [
        np.bincount(np.floor((values - low) / resolution_m).astype(np.intp)).astype(np.float64)
        for values, low in zip((target_m, source_m), low_m, strict=True)
    ]
    correlation = np.correlate(counts[0], counts[1], mode="full")
    return (int(correlation.argmax()) - (counts[1].size - 1)) * resolution_m + low_m[0] - low_m[1]


def acceptance_index(target: Grid, source: Grid, target_from_source: Sim2) -> float:
    """Return the acceptance index ω (equation 3 of Chen & Chan)."""
    points = source.centres_m(source.known)
    values = source.cells[source.known]
    placed = target_from_source.apply(points)
    both = known_at(target, placed)
    cells = np.floor(target.map_from_grid.inverse().apply(placed[both]) / target.resolution_m).astype(np.intp)
    here, there = values[both], target.cells[cells[:, 1], cells[:, 0]]
    walls = [value >= _CELLS.min_occupied_percent for value in (here, there)]
    free = [value <= _CELLS.max_free_percent for value in (here, there)]
    agree = int(np.count_nonzero((walls[0] & walls[1]) | (free[0] & free[1])))
    differ = int(np.count_nonzero((walls[0] & free[1]) | (free[0] & walls[1])))
    return agree / (agree + differ) if agree else 0.0
