"""Candidates weighed against each other: at most one placement of a pair is right."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapmerge.align import placement_of
from mapmerge.config import MergeConfig, VerifyConfig
from mapmerge.match.confidence import contest, log_odds_of
from mapmerge.match.cues import Contest, Fit, fit_of
from mapmerge.match.look import Look
from mapmerge.match.pair import PairOfMaps

_OTHER_HALF_SHARE, _SAME_SIZE = 0.15, 0.05


@dataclass(frozen=True, slots=True, eq=False)
class Weighed:
    """Distinct placements between the grid frames, the likeliest first; those that share too little come last.

    Parameters
    ----------
    look
        The placements.
    fits
        How well the maps fit at each.
    log_odds
        See `mapmerge.match.confidence.log_odds_of`.
    """

    look: Look
    fits: tuple[Fit, ...]
    log_odds: tuple[float, ...]

    @property
    def contest(self) -> Contest:
        """How the first one stands among them."""
        return contest(self.fits, self.log_odds)

    def other_half(self, config: VerifyConfig) -> Fit | None:
        """Return how the maps fit where they are turned by half against the first placement, if they do as well there.

        The halves of a symmetric building look alike. That one placement lets the maps overlap more, and so has more
        that speaks for it, does not say which half was seen.
        """
        best, *others = self.fits
        first, poses = self.look.poses[0], self.look.poses[1:]
        turned = np.abs(np.remainder(poses[:, 2] - first[2], math.tau) - math.pi) <= 2 * config.distinct_rad
        turned &= np.abs(np.log(poses[:, 3] / first[3])) <= _SAME_SIZE
        least_m = _OTHER_HALF_SHARE * best.matched_wall_m
        for fit, is_turned in zip(others, turned.tolist(), strict=True):
            is_other_half = is_turned and not shares_too_little(fit, config)
            fits_as_well = fit.slack_agreement >= best.slack_agreement
            if is_other_half and fits_as_well and fit.matched_wall_m >= least_m:
                return fit
        return None


def weighed(pair: PairOfMaps, ranked: Look, config: MergeConfig, known: dict[bytes, Fit] | None = None) -> Weighed:
    """Return the best of some distinct placements, likeliest first.

    A score in metres prefers the placement that lets two maps overlap most; the likeliest one may share less ground,
    and be contradicted by less. Placements that share too little to be accepted come last: they have hardly any
    overlap, and so hardly anything against them, and say nothing of why maps do not fit.

    Parameters
    ----------
    pair
        The maps.
    ranked
        Placements, the largest score first.
    config
        Settings.
    known
        Fits of placements that were weighed before, by the bytes of their poses; those of others are added.
    """
    limits = config.search
    worth = ranked.scores_m >= limits.worth_weighing * max(0.0, float(ranked.scores_m[0]))
    rows = np.flatnonzero(worth)[: limits.weighed].tolist()
    chosen = ranked.rows(rows or [0])
    fits = [_fit_of(pair, pose, config, {} if known is None else known) for pose in chosen.poses]
    log_odds = [log_odds_of(fit) for fit in fits]
    order = likeliest_first(fits, log_odds, config.verify)
    return Weighed(chosen.rows(order), tuple(fits[row] for row in order), tuple(log_odds[row] for row in order))


def _fit_of(pair: PairOfMaps, pose: NDArray[np.float64], config: MergeConfig, known: dict[bytes, Fit]) -> Fit:
    key = pose.tobytes()
    if key not in known:
        known[key] = fit_of(pair, placement_of(pose), config)
    return known[key]


def likeliest_first(fits: Sequence[Fit], log_odds: Sequence[float], config: VerifyConfig) -> list[int]:
    """Return the order of placements: by their odds, but last those that share less than an accepted one must."""
    return sorted(range(len(fits)), key=lambda row: (shares_too_little(fits[row], config), -log_odds[row]))


def shares_too_little(fit: Fit, config: VerifyConfig) -> bool:
    """Tell whether the maps share less at a placement than they do at one that is accepted."""
    return fit.overlap_m2 < config.min_overlap_m2 or fit.matched_wall_m < config.min_matched_wall_m
