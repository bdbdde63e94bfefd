"""Candidates for a placement, from the maps' orientation spectra, from all rotations, or from a prior."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mapmerge.align import Poses, poses_of
from mapmerge.config import SearchConfig
from mapmerge.match.pair import PairOfMaps
from mapmerge.match.spectrum import rotation_peaks, spectrum_correlation
from mapmerge.match.surface import CoarseCells, TranslationSearch, surface_peaks
from mapmerge.prior import WITHIN_SIGMAS
from mapmerge.sim2 import Sim2

_SAME_TURN_RAD = math.radians(1.5)
_SAME_M, _SAME_RAD, _SAME_SCALE = 0.3, 0.03, 0.02
_BELIEVED_STEP_RAD = math.radians(2.0)
_SLACK_M, _SLACK_RAD = 0.8, math.radians(3.0)


def likely_rotations(pair: PairOfMaps, config: SearchConfig) -> tuple[float, ...]:
    """Return turns in [0, π) at which the orientation spectra agree; each is as likely turned by 180°."""
    found: list[float] = []
    for target, source, count in zip(pair.target.spectra, pair.source.spectra, config.rotations, strict=True):
        for yaw_rad in rotation_peaks(spectrum_correlation(target, source), count):
            if all(abs(math.remainder(yaw_rad - other, math.pi)) > _SAME_TURN_RAD for other in found):
                found.append(yaw_rad)
    return tuple(found)


def by_spectra(pair: PairOfMaps, rotations: Sequence[float], scales: Sequence[float], config: SearchConfig) -> Poses:
    """Return the shifts at which walls and free space agree best, for likely rotations and all scales."""
    turns = [Sim2(0.0, 0.0, yaw_rad, scale) for scale in scales for yaw_rad in rotations]
    most = config.max_candidates * (1 if len(scales) == 1 else 3)
    return _correlated(pair, turns, config.cell_m, config.free_weights, config.shifts, most, config)


def by_half_turn(pair: PairOfMaps, pose: Sim2, config: SearchConfig) -> Poses:
    """Return the best shifts at the rotation of a placement and turned by 180° from it.

    Where a building is symmetric, the best placement may be its other half: the right one then shares less.
    """
    turns = [Sim2(0.0, 0.0, pose.yaw_rad, pose.scale)]
    weights = config.free_weights[-1:]
    return _correlated(pair, turns, config.cell_m, weights, 2 * config.shifts, 4 * config.shifts, config)


def by_sweep(pair: PairOfMaps, config: SearchConfig) -> Poses:
    """Return the shifts at which walls and free space agree best, of all rotations.

    Slower, but finds the rotation of maps without straight walls, and of small maps of which the spectra tell little.
    """
    turns = [Sim2(yaw_rad=yaw) for yaw in np.arange(0.0, math.pi, config.sweep_step_rad).tolist()]
    most = config.sweep_candidates
    return _correlated(pair, turns, config.sweep_cell_m, config.sweep_free_weights, config.sweep_shifts, most, config)


def by_prior(pair: PairOfMaps, config: SearchConfig) -> Poses:
    """Return the believed placement, and the shifts near it at which walls and free space agree best."""
    believed = pair.believed
    if pair.prior is None or believed is None:
        return np.empty((0, 4))
    reach_rad = min(math.pi, WITHIN_SIGMAS * pair.prior.sigma_yaw_rad)
    steps = math.ceil(reach_rad / _BELIEVED_STEP_RAD)
    offsets = np.linspace(-reach_rad, reach_rad, 2 * steps + 1).tolist()
    turns = [Sim2(yaw_rad=believed.yaw_rad + offset) for offset in offsets]
    most = 2 * config.max_candidates
    found = _correlated(pair, turns, config.cell_m, config.free_weights, config.shifts, most, config)
    return np.vstack([poses_of([believed]), found])


def all_scales(least: float, largest: float, step: float) -> tuple[float, ...]:
    """Return scales from the least to the largest whose ratio is about ``step``; 1 is one, where it is within."""
    if not least <= 1.0 <= largest:
        return tuple(least * scale for scale in all_scales(1.0, largest / least, step))
    below, above = (round(abs(math.log(end)) / math.log(step)) for end in (least, largest))
    return tuple(
        math.exp(math.log(least if number < 0 else largest) * abs(number) / max(below if number < 0 else above, 1))
        for number in range(-below, above + 1)
    )


def _correlated(
    pair: PairOfMaps,
    turns: Sequence[Sim2],
    cell_m: float,
    free_weights: tuple[float, ...],
    shifts: int,
    most: int,
    config: SearchConfig,
) -> Poses:
    cells = CoarseCells.of(config, cell_m)
    search = TranslationSearch(pair.target.map, pair.source.map, cells, free_weights, turns)
    found: list[list[tuple[Poses, NDArray[np.float32]]]] = [[] for _ in free_weights]
    for turn in turns:
        for number, surface in enumerate(search.surfaces(turn)):
            poses, values = surface_peaks(surface, config.peak_distance_m)
            if pair.prior is not None:
                near = pair.allowed(poses, _SLACK_M + _SLACK_RAD * pair.reach_m, _SLACK_RAD)
                poses, values = poses[near], values[near]
            found[number % len(free_weights)].append((poses[:shifts], values[:shifts]))
    best = [_best(peaks, most) for peaks in found if peaks]
    return _without_doubles(np.vstack(best)) if best else np.empty((0, 4))


def _best(peaks: Sequence[tuple[Poses, NDArray[np.float32]]], most: int) -> Poses:
    values = np.concatenate([values for _, values in peaks])
    return np.vstack([poses for poses, _ in peaks])[np.argsort(-values, kind="stable")[:most]]


def _without_doubles(poses: Poses) -> Poses:
    if len(poses) == 0:
        return poses
    keyed = np.column_stack([poses[:, :2], np.remainder(poses[:, 2], math.tau), np.log(poses[:, 3])])
    cells = np.round(keyed / (_SAME_M, _SAME_M, _SAME_RAD, _SAME_SCALE)).astype(np.int64)
    _, first = np.unique(cells, axis=0, return_index=True)
    return poses[np.sort(first)]
