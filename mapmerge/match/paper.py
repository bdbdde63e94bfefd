"""The paper's method (Chen & Chan 2023, section 4.2): image correction, SIFT, RANSAC, ICP, acceptance index.

Its figure 4, step by step; each step is a function of its own in `mapmerge.paper`, and shown by its evidence.
Accepted maps are fused with the entropy filter (equations 12 to 14) by `mapmerge.fuse`, as with every method.
"""

from __future__ import annotations

from dataclasses import dataclass

from mapmerge.config import MergeConfig
from mapmerge.grid import Grid
from mapmerge.match.base import Match, Matcher
from mapmerge.paper.consensus import best_models, conforming_features, conforming_pairs, limits_m, refitted
from mapmerge.paper.correction import Correction, correct, picture_grid
from mapmerge.paper.features import Features, one_a_place, sift
from mapmerge.paper.icp import OccupiedCells, icp, occupied_cells
from mapmerge.paper.ransac import models_of_all_pairs
from mapmerge.paper.show import correction_evidence, pairs_evidence
from mapmerge.paper.stitch import (
    MIN_FEATURES,
    allowed,
    bounds_of,
    candidates,
    outcome,
    refused,
    with_known_scale,
)
from mapmerge.prepare import prepare
from mapmerge.prepared import PreparedMap
from mapmerge.prior import Prior
from mapmerge.reasons import ReasonCode
from mapmerge.sim2 import Points, Sim2


@dataclass(frozen=True, slots=True, eq=False)
class _Prepared:
    """A map with its corrected picture and the features of that.

    Parameters
    ----------
    features_m
        Places of the features in the frame of the map's grid, shape (N, 2).
    """

    map: PreparedMap
    occupied: OccupiedCells
    correction: Correction
    features: Features
    features_m: Points


class PaperMatcher(Matcher[_Prepared]):
    """Finds a placement from the corners of corrected maps; accepted on the acceptance index alone."""

    def prepare(self, grid: Grid, resolution_m: float, config: MergeConfig) -> _Prepared:
        """Return one map's corrected picture, at the map's own resolution, and its features."""
        paper = config.paper
        picture = picture_grid(grid, config.search.working_cell_m, paper.max_side_cells, config.cells)
        correction = correct(picture, config.cells, paper)
        features = one_a_place(sift(correction.thickened, 0, paper.max_features))
        prepared = prepare(grid, resolution_m, config)
        occupied = occupied_cells(prepared.wall_cells_m, prepared.resolution_m)
        return _Prepared(prepared, occupied, correction, features, correction.in_grid_m(features.pixels))

    def match(self, target: _Prepared, source: _Prepared, config: MergeConfig, prior: Prior | None = None) -> Match:
        """Return where the source lies on the target by RANSAC on all pairs of features, then ICP."""
        paper, ransac = config.paper, config.paper.ransac
        shown = correction_evidence(target.correction, source.correction, target.features, source.features)
        fewest = min(len(target.features_m), len(source.features_m))
        if fewest < MIN_FEATURES:
            message = f"one of the maps shows {fewest} corners after its correction, less than {MIN_FEATURES}"
            return refused(ReasonCode.TOO_LITTLE_STRUCTURE, message, shown)
        p_m, q_m = source.features_m, target.features_m
        turn_rad = source.correction.radon.turn_rad - target.correction.radon.turn_rad
        bounds = bounds_of(config, ransac, turn_rad, paper.turn_tolerance_rad)
        drawn = models_of_all_pairs(p_m, q_m, bounds, ransac.draws, ransac.seed)
        models = allowed(drawn, target.map, source.map, prior, max(paper.icp_reject_m))
        if len(models) == 0:
            if len(drawn):
                message = "no two corners of one map fit two of the other where the prior allows it"
                return refused(ReasonCode.PRIOR_CONTRADICTED, message, shown)
            message = "no two corners of one map lie to each other as two of the other do"
            return refused(ReasonCode.NO_CANDIDATE, message, shown)
        limit_m = limits_m(models, ransac.inlier_m, in_both=ransac.in_both)
        counts = conforming_features(models, p_m, q_m, limit_m)
        best = best_models(models, counts, p_m, paper.max_models, config.verify.distinct_m)

        def align(model: Sim2) -> Sim2:
            inliers = conforming_pairs(model, p_m, q_m, ransac.inlier_m)
            fitted = refitted(model, p_m[inliers[:, 0]], q_m[inliers[:, 1]])
            start = with_known_scale(fitted, config, p_m[inliers[:, 0]])
            return icp(
                target.occupied,
                source.occupied.cells_m,
                start,
                paper.icp_reject_m,
                paper.icp_iterations,
                scale_range=config.scale_range if config.scale == "free" else None,
            )

        found = candidates(target.map, source.map, best, align, config.verify)
        inliers = conforming_pairs(found[0].target_from_source, p_m, q_m, ransac.inlier_m)
        pairs = pairs_evidence(
            (target.correction.thickened, target.features), (source.correction.thickened, source.features), inliers
        )
        return outcome(target.map, source.map, found, prior, config.verify, (*shown, pairs))
