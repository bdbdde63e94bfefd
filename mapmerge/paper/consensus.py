"""RANSAC's second and third step: how many pairs conform to a model, and the best of the models (equations 10, 11)."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmerge.paper.icp import least_squares
from mapmerge.paper.interest import Cells
from mapmerge.paper.ransac import Models, Numbers
from mapmerge.sim2 import Points, Sim2

Counts = NDArray[np.intp]

_CHUNK = 2_000_000
_MIN_PAIRS = 3
_CELLS_IN_LIMIT = 8
_MAX_SIDE_CELLS = 4000


def limits_m(models: Models, inlier_m: float, *, in_both: bool) -> Numbers:
    """Return the limit ε of each model.

    Parameters
    ----------
    in_both
        Whether a pair must conform in both maps' metres; else in the target's, as printed, where any pair conforms to
        a model that shrinks the source to a point.
    """
    return inlier_m * (np.minimum(models.scale, 1.0) if in_both else np.ones(len(models)))


def conforming(models: Models, p_m: Points, q_m: Points, pairs: Cells, limit_m: Numbers) -> Counts:
    """Return for each model the number of pairs that conform to it, ‖v_q − v_p‖ < ε (equation 11)."""
    p, q = p_m[pairs[:, 0]], q_m[pairs[:, 1]]
    counts = [
        np.count_nonzero(np.square(models[part].apply(p) - q).sum(axis=-1) < limit_m[part, None] ** 2, axis=1)
        for part in _parts(len(models), len(p))
    ]
    return np.concatenate(counts) if counts else np.empty(0, np.intp)


def conforming_to(model: Sim2, p_m: Points, q_m: Points, pairs: Cells, limit_m: float) -> NDArray[np.bool_]:
    """Tell which pairs conform to one model."""
    error = model.apply(p_m[pairs[:, 0]]) - q_m[pairs[:, 1]]
    return np.asarray(np.square(error).sum(axis=1) < limit_m**2, np.bool_)


def conforming_features(models: Models, p_m: Points, q_m: Points, limit_m: Numbers) -> Counts:
    """Return for each model the number of p that conform with some q, of all pairs (equations 11 and 22).

    A feature counts once however many others are near: else a crowd of features would count by its square.
    """
    if len(q_m) == 0 or len(models) == 0:
        return np.zeros(len(models), np.intp)
    nearest = _Distance(q_m, float(limit_m.max()))
    counts = [
        np.count_nonzero(nearest.at(models[part].apply(p_m)) < limit_m[part, None], axis=1)
        for part in _parts(len(models), len(p_m))
    ]
    return np.concatenate(counts)


def conforming_pairs(model: Sim2, p_m: Points, q_m: Points, limit_m: float) -> Cells:
    """Return the pairs of all pairs that conform to a model, each p with its nearest q."""
    if len(p_m) == 0 or len(q_m) == 0:
        return np.empty((0, 2), np.intp)
    squared = np.square(model.apply(p_m)[:, None, :] - q_m[None, :, :]).sum(axis=-1)
    nearest = np.argmin(squared, axis=1)
    ones = np.flatnonzero(squared[np.arange(len(p_m)), nearest] < limit_m**2)
    return np.stack([ones, nearest[ones]], axis=1).astype(np.intp)


def refitted(model: Sim2, p_m: Points, q_m: Points) -> Sim2:
    """Return the similarity of least squares of pairs that conform to a model; the model itself if they are too few.

    A model is that of two pairs alone, whose own errors are in its scale and turn.
    """
    return model if len(p_m) < _MIN_PAIRS else least_squares(p_m, q_m, scaled=True)


def best_models(models: Models, counts: Counts, at_m: Points, most: int, apart_m: float) -> list[Sim2]:
    """Return the models that most pairs conform to, best first, each distinct from all better ones.

    Parameters
    ----------
    models, counts
        The models and how many pairs conform to each.
    at_m
        Points of the source, shape (N, 2): where models are compared.
    most
        How many to return at most; the paper takes one.
    apart_m
        Models that take all of these points to within this distance of each other are the same.
    """
    kept: list[tuple[int, Points]] = []
    order = np.argsort(-counts, kind="stable")
    probe = np.array([at_m.min(axis=0), at_m.max(axis=0)]) if len(at_m) else np.zeros((1, 2))
    places = models.apply(probe)
    left = np.ones(len(order), np.bool_)
    while len(kept) < most and left.any():
        index = int(order[int(np.argmax(left))])
        kept.append((index, places[index]))
        moved = np.abs(places[order] - places[index]).max(axis=(1, 2))
        left &= moved > apart_m
    return [models.one(index) for index, _ in kept]


class _Distance:
    """The distance from any point to the nearest of a set: a look-up in a raster, exact to about its cells."""

    def __init__(self, points_m: Points, limit_m: float) -> None:
        self._low = points_m.min(axis=0) - 2 * limit_m
        sides_m = points_m.max(axis=0) + 2 * limit_m - self._low
        self._cell_m = max(limit_m / _CELLS_IN_LIMIT, float(sides_m.max()) / _MAX_SIDE_CELLS)
        cols, rows = (int(side) + 1 for side in np.ceil(sides_m / self._cell_m))
        raster = np.full((rows, cols), 255, np.uint8)
        col, row = np.floor((points_m - self._low) / self._cell_m).astype(np.intp).T
        raster[row, col] = 0
        self._distance_m = np.asarray(cv2.distanceTransform(raster, cv2.DIST_L2, cv2.DIST_MASK_5), np.float32)
        self._distance_m *= np.float32(self._cell_m)
        # a frame that is near nothing, for what lies outside
        self._distance_m[[0, -1]] = self._distance_m[:, [0, -1]] = np.inf

    def at(self, points_m: Numbers) -> NDArray[np.float32]:
        rows, cols = self._distance_m.shape
        cell = np.floor((points_m - self._low) / self._cell_m)
        col = np.clip(cell[..., 0], 0, cols - 1).astype(np.intp)
        row = np.clip(cell[..., 1], 0, rows - 1).astype(np.intp)
        return np.asarray(self._distance_m[row, col], np.float32)


def _parts(models: int, points: int) -> list[slice]:
    size = max(1, _CHUNK // max(1, points))
    return [slice(low, low + size) for low in range(0, models, size)]
