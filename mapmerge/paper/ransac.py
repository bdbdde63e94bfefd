"""RANSAC on pairs of features, two pairs a draw (equations 5 to 11).

Draws are bounded by what is known beforehand: the scale by the maps' resolutions, the turn by the turns that made both
maps parallel to the axes, the placement by a prior. Unbounded, as the paper may be read, the scale collapses: in a
small copy of one map many features fall into one neighbourhood of the other.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from mapmerge.paper.interest import Cells
from mapmerge.sim2 import Points, Sim2

Numbers = NDArray[np.float64]

_CHUNK = 4_000_000
_SMALL_M = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Models:
    """Guess models, ``q_from_p``, one a row (equation 5).

    Parameters
    ----------
    scale, turn_rad
        Shape (K,).
    shift_m
        Shape (K, 2).
    """

    scale: Numbers
    turn_rad: Numbers
    shift_m: Points

    def __len__(self) -> int:
        return len(self.scale)

    def __getitem__(self, kept: NDArray[np.bool_] | slice) -> Models:
        return Models(self.scale[kept], self.turn_rad[kept], self.shift_m[kept])

    def one(self, index: int) -> Sim2:
        """Return one of them as a transform."""
        x_m, y_m = self.shift_m[index].tolist()
        return Sim2(x_m, y_m, float(self.turn_rad[index]), float(self.scale[index]))

    def apply(self, points_m: Points) -> NDArray[np.float64]:
        """Return the points, shape (N, 2), where each model takes them, shape (K, N, 2) (equation 10)."""
        cos, sin = self.scale * np.cos(self.turn_rad), self.scale * np.sin(self.turn_rad)
        x_m = cos[:, None] * points_m[:, 0] - sin[:, None] * points_m[:, 1] + self.shift_m[:, :1]
        y_m = sin[:, None] * points_m[:, 0] + cos[:, None] * points_m[:, 1] + self.shift_m[:, 1:]
        return np.stack([x_m, y_m], axis=-1)


@dataclass(frozen=True, slots=True)
class Bounds:
    """What a model may be.

    Parameters
    ----------
    scale
        Least and largest.
    turn_rad, turn_step_rad, turn_tolerance_rad
        The turn is this one plus a multiple of the step, to within the tolerance; any, if the step is 0.
    min_arm_m
        Two features of one map nearer to each other than this say too little of the turn.
    """

    scale: tuple[float, float]
    turn_rad: float = 0.0
    turn_step_rad: float = 0.0
    turn_tolerance_rad: float = 0.0
    min_arm_m: float = 0.0

    def allow(self, scale: Numbers, turn_rad: Numbers) -> NDArray[np.bool_]:
        """Tell which models are within the bounds."""
        allowed: NDArray[np.bool_] = (scale >= self.scale[0]) & (scale <= self.scale[1])
        if self.turn_step_rad > 0:
            steps = (turn_rad - self.turn_rad) / self.turn_step_rad
            allowed &= np.abs(steps - np.rint(steps)) * self.turn_step_rad <= self.turn_tolerance_rad
        return allowed


def two_pair_models(p_a: Points, p_b: Points, q_a: Points, q_b: Points) -> Models:
    """Return the models of two pairs each (equations 7 to 9), all arguments of shape (K, 2).

    The paper prints y_qb − y_pa in the equation of the turn, where y_qb − y_qa must be meant.
    """
    p, q = p_b - p_a, q_b - q_a
    length = np.maximum(np.hypot(p[:, 0], p[:, 1]), _SMALL_M)
    scale = np.hypot(q[:, 0], q[:, 1]) / length
    turn_rad = np.arctan2(q[:, 1], q[:, 0]) - np.arctan2(p[:, 1], p[:, 0])
    cos, sin = scale * np.cos(turn_rad), scale * np.sin(turn_rad)
    moved = np.stack([cos * p_a[:, 0] - sin * p_a[:, 1], sin * p_a[:, 0] + cos * p_a[:, 1]], axis=1)
    return Models(scale, turn_rad, q_a - moved)


def drawn_models(p_m: Points, q_m: Points, pairs: Cells, bounds: Bounds, draws: int, seed: int) -> Models:
    """Return the models of two matched pairs each: of all twos if there are few, else of so many drawn at random."""
    count = len(pairs)
    if count * (count - 1) // 2 <= draws:
        a, b = np.triu_indices(count, 1)
    else:
        a, b = np.random.default_rng(seed).integers(0, count, (2, draws))
    p_a, p_b, q_a, q_b = p_m[pairs[a, 0]], p_m[pairs[b, 0]], q_m[pairs[a, 1]], q_m[pairs[b, 1]]
    models = two_pair_models(p_a, p_b, q_a, q_b)
    long = (np.hypot(*(p_b - p_a).T) >= bounds.min_arm_m) & (np.hypot(*(q_b - q_a).T) >= _SMALL_M)
    return models[long & bounds.allow(models.scale, models.turn_rad)]


def models_of_all_pairs(p_m: Points, q_m: Points, bounds: Bounds, draws: int, seed: int) -> Models:
    """Return the models of two of all pairs p, q (equation 22), about as many as ``draws`` at most.

    Of millions of twos nearly all break the bounds of scale. Twos of p are taken in an order drawn at random, and for
    each of them the twos of q are looked up that are of about the same length: the same as drawing and throwing away.
    """
    p_a, p_b = np.triu_indices(len(p_m), 1)
    low, high = np.triu_indices(len(q_m), 1)
    q_a, q_b = np.concatenate([low, high]), np.concatenate([high, low])
    p_length, q_length = np.hypot(*(p_m[p_b] - p_m[p_a]).T), np.hypot(*(q_m[q_b] - q_m[q_a]).T)
    long = p_length >= max(bounds.min_arm_m, _SMALL_M)
    p_a, p_b, p_length = p_a[long], p_b[long], p_length[long]
    by_length = np.argsort(q_length, kind="stable")
    q_a, q_b, q_length = q_a[by_length], q_b[by_length], q_length[by_length]
    order = np.random.default_rng(seed).permutation(len(p_a))
    first = np.searchsorted(q_length, np.maximum(p_length * bounds.scale[0], _SMALL_M), side="left")[order]
    last = np.searchsorted(q_length, p_length * bounds.scale[1], side="right")[order]
    found: list[Models] = []
    kept = 0
    for chunk in _chunks(last - first):
        one, other = _spans(first[chunk], last[chunk])
        p = order[chunk][one]
        models = two_pair_models(p_m[p_a[p]], p_m[p_b[p]], q_m[q_a[other]], q_m[q_b[other]])
        found.append(models[bounds.allow(models.scale, models.turn_rad)])
        kept += len(found[-1])
        if kept >= draws:
            break
    if not found:
        return Models(np.empty(0), np.empty(0), np.empty((0, 2)))
    return Models(*(np.concatenate([getattr(each, name) for each in found]) for name in Models.__slots__))


def _chunks(counts: NDArray[np.intp]) -> list[slice]:
    """Return consecutive parts whose counts add up to about `_CHUNK` at most, the first a tenth of that."""
    total = np.cumsum(counts) // (_CHUNK // 10)
    borders = np.concatenate([[0], np.flatnonzero(np.diff(total)) + 1, [len(counts)]])
    return [slice(int(low), int(high)) for low, high in pairwise(borders) if high > low]


def _spans(first: NDArray[np.intp], last: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return for spans [first, last) the number of the span and the index within it, one after the other."""
    counts = np.maximum(last - first, 0)
    number = np.repeat(np.arange(len(counts)), counts)
    start = np.cumsum(counts) - counts
    return number, np.arange(int(counts.sum())) - start[number] + first[number]
