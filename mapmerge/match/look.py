"""A look at a pair: candidates aligned and ranked, and what competes with the best of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapmerge.align import Poses, align, evenly, middle_of, placed
from mapmerge.config import MergeConfig, VerifyConfig
from mapmerge.match.pair import PairOfMaps
from mapmerge.score import agreement, probe
from mapmerge.sim2 import wrap_angle

_SAME_M, _SAME_RAD = 0.3, math.radians(2.0)
_DISTINCT_SIZE = 0.05
_ROUNDING = 1e-9
_BESIDE = 1.2
_BESIDE_TURNS = 8


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """Aligned placements between the grid frames, best first.

    Parameters
    ----------
    poses
        Shape (C, 4).
    scores_m
        Their scores, see `VerifyConfig.violation_weight`, shape (C,).
    matched_m
        Length of the walls that agree, mean of both directions, shape (C,).
    shares
        Share of the walls that agree, in the worse of both directions, shape (C,).
    """

    poses: Poses
    scores_m: NDArray[np.float64]
    matched_m: NDArray[np.float64]
    shares: NDArray[np.float64]

    def rows(self, chosen: Sequence[int] | slice) -> Look:
        """Return some of the placements."""
        parts = (self.poses, self.scores_m, self.matched_m, self.shares)
        return Look(*(part[chosen] for part in parts))

    def followed_by(self, other: Look) -> Look:
        """Return the placements of this look, then those of the other."""
        return Look(
            np.vstack([self.poses, other.poses]),
            np.concatenate([self.scores_m, other.scores_m]),
            np.concatenate([self.matched_m, other.matched_m]),
            np.concatenate([self.shares, other.shares]),
        )

    def joined(self, other: Look) -> Look:
        """Return the placements of both, best first."""
        both = self.followed_by(other)
        return both.rows(np.argsort(-both.scores_m, kind="stable").tolist())


def look(pair: PairOfMaps, starts: Poses, scales: tuple[float, float], config: MergeConfig) -> Look:
    """Return the candidates, aligned in two passes: all roughly, the best of them well.

    Parameters
    ----------
    pair
        The maps.
    starts
        Where to begin, shape (C, 4).
    scales
        Least and largest scale.
    config
        Settings.
    """
    return _closely(pair, _roughly(pair, starts, scales, config), scales, config)


def look_around(pair: PairOfMaps, pose: Poses, others: Poses, scales: tuple[float, float], config: MergeConfig) -> Look:
    """Return what is found from starts beside a placement, and from other starts as `look` does.

    Along walls without an end the score has a ridge but no second peak, so that no peak of a surface is a rival there.

    Parameters
    ----------
    pair
        The maps.
    pose
        The placement, shape (1, 4).
    others
        Where else to begin, shape (C, 4).
    scales
        Least and largest scale.
    config
        Settings.
    """
    found = _roughly(pair, np.vstack([beside(pose, config.verify), others]), scales, config)
    near, far = found[:_BESIDE_TURNS], found[_BESIDE_TURNS:]
    near = near[_is_possible(pair, near, scales)]
    return scored(pair, near, config).joined(_closely(pair, far, scales, config))


def beside(pose: Poses, config: VerifyConfig) -> Poses:
    """Return starts all around a placement, shape (1, 4), a little further away than what is not distinct from it."""
    reach_m = _BESIDE * config.distinct_m
    angles = np.arange(_BESIDE_TURNS) * math.tau / _BESIDE_TURNS
    starts = np.repeat(pose, _BESIDE_TURNS, axis=0)
    starts[:, 0] += reach_m * np.cos(angles)
    starts[:, 1] += reach_m * np.sin(angles)
    return starts


def _roughly(pair: PairOfMaps, starts: Poses, scales: tuple[float, float], config: MergeConfig) -> Poses:
    limits = config.refine
    walls_m = evenly(pair.source.map.walls_m, limits.rough_points)
    return align(pair.target.map, walls_m, starts, limits.rough_reject_m, scales=scales)


def _closely(pair: PairOfMaps, poses: Poses, scales: tuple[float, float], config: MergeConfig) -> Look:
    """Return the best of some placements that are aligned roughly, aligned well."""
    target, source, limits = pair.target.map, pair.source.map, config.refine
    poses = poses[_is_possible(pair, poses, scales)]
    if len(poses) == 0:
        return scored(pair, poses, config)
    few = limits.rough_probes
    rough = agreement(target, source, poses, probe(source, few, few), probe(target, few, few))
    poses = poses[np.argsort(-rough.score_m(config.verify), kind="stable")]
    poses = poses[distinct(poses, source.walls_m, _SAME_M, _SAME_RAD, limits.survivors)]
    poses = align(target, evenly(source.walls_m, limits.points), poses, limits.reject_m, scales=scales)
    return scored(pair, poses[_is_possible(pair, poses, scales)], config)


def _is_possible(pair: PairOfMaps, poses: Poses, scales: tuple[float, float]) -> NDArray[np.bool_]:
    """Tell which placements are allowed, and have a scale within the limits; where to begin, some may not."""
    has_scale = (poses[:, 3] >= scales[0] - _ROUNDING) & (poses[:, 3] <= scales[1] + _ROUNDING)
    return np.asarray(pair.allowed(poses) & has_scale, np.bool_)


def scored(pair: PairOfMaps, poses: Poses, config: MergeConfig) -> Look:
    """Return placements, best first, judged by as many points as are used for the best ones."""
    target, source, most = pair.target.map, pair.source.map, config.refine.probes
    found = agreement(target, source, poses, probe(source, most, most // 2), probe(target, most, most // 2))
    matched_m = (found.ahead.matched_m + found.back.matched_m) / 2
    shares = np.minimum(found.ahead.share, found.back.share)
    judged = Look(poses, found.score_m(config.verify), matched_m, shares)
    return judged.rows(np.argsort(-judged.scores_m, kind="stable").tolist())


def rivals(best: Look, others: Look, pair: PairOfMaps, config: VerifyConfig) -> Look:
    """Return the others, best first, each of which differs from the best one and from all better ones."""
    poses = np.vstack([best.poses, others.poses])
    kept = distinct(poses, pair.source.map.walls_m, config.distinct_m, config.distinct_rad, len(poses))[1:]
    return others.rows([row - 1 for row in kept])


def distinct(poses: Poses, walls_m: NDArray[np.float64], distance_m: float, angle_rad: float, most: int) -> list[int]:
    """Return the rows, in order and at most so many, each of which differs from all that are kept before it.

    Placements differ if they take the middle of the walls further apart, turn further apart, or scale by a twentieth.
    """
    x, y = (values[:, 0].tolist() for values in placed(poses, middle_of(walls_m)[None]))
    turns, sizes = poses[:, 2].tolist(), np.log(poses[:, 3]).tolist()
    kept: list[int] = []
    for row in range(len(poses)):
        if len(kept) == most:
            break
        if all(
            math.hypot(x[row] - x[other], y[row] - y[other]) > distance_m
            or abs(wrap_angle(turns[row] - turns[other])) > angle_rad
            or abs(sizes[row] - sizes[other]) > _DISTINCT_SIZE
            for other in kept
        ):
            kept.append(row)
    return kept
