"""The method that the paper compares with (section 4.1, figure 3): SIFT on the map as it is, RANSAC, no ICP."""

from __future__ import annotations

from dataclasses import dataclass

from mapmerge.config import MergeConfig
from mapmerge.grid import Grid
from mapmerge.match.base import Match, Matcher
from mapmerge.paper.consensus import best_models, conforming, conforming_to, limits_m, refitted
from mapmerge.paper.correction import picture_grid
from mapmerge.paper.features import Features, nearest_pairs, sift
from mapmerge.paper.pixels import PIXEL_UNKNOWN, Image, class_pixels
from mapmerge.paper.ransac import drawn_models
from mapmerge.paper.show import keypoints_evidence, pairs_evidence
from mapmerge.paper.stitch import MIN_FEATURES, allowed, bounds_of, candidates, outcome, refused, with_known_scale
from mapmerge.prepare import prepare
from mapmerge.prepared import PreparedMap
from mapmerge.prior import Prior
from mapmerge.reasons import ReasonCode
from mapmerge.sim2 import Points, Sim2


@dataclass(frozen=True, slots=True, eq=False)
class _Prepared:
    """A map as a picture of three values, and its features; their places are in the frame of the map's grid."""

    map: PreparedMap
    pixels: Image
    features: Features
    features_m: Points


class ExistingMatcher(Matcher[_Prepared]):
    """Finds a placement from features paired by their descriptors; accepted on the acceptance index alone."""

    def prepare(self, grid: Grid, resolution_m: float, config: MergeConfig) -> _Prepared:
        """Return the features of one map, as it is, at its own resolution."""
        existing = config.existing
        picture = picture_grid(grid, config.search.working_cell_m, existing.max_side_cells, config.cells)
        pixels = class_pixels(picture, config.cells)
        features = sift(pixels, PIXEL_UNKNOWN, existing.max_features)
        features_m = (features.pixels + 0.5) * picture.resolution_m
        return _Prepared(prepare(grid, resolution_m, config), pixels, features, features_m)

    def match(self, target: _Prepared, source: _Prepared, config: MergeConfig, prior: Prior | None = None) -> Match:
        """Return where the source lies on the target by RANSAC on the pairs of nearest descriptors."""
        ransac = config.existing.ransac
        shown = (keypoints_evidence((target.pixels, target.features), (source.pixels, source.features)),)
        fewest = min(len(target.features_m), len(source.features_m))
        if fewest < MIN_FEATURES:
            message = f"one of the maps shows {fewest} features, less than {MIN_FEATURES}"
            return refused(ReasonCode.TOO_LITTLE_STRUCTURE, message, shown)
        p_m, q_m = source.features_m, target.features_m
        pairs = nearest_pairs(source.features, target.features)
        drawn = drawn_models(p_m, q_m, pairs, bounds_of(config, ransac, 0.0, 0.0), ransac.draws, ransac.seed)
        models = allowed(drawn, target.map, source.map, prior, 0.0)
        if len(models) == 0:
            if len(drawn):
                message = "no two pairs of features fit each other where the prior allows it"
                return refused(ReasonCode.PRIOR_CONTRADICTED, message, shown)
            message = "no two pairs of features fit each other at the maps' scale"
            return refused(ReasonCode.NO_CANDIDATE, message, shown)
        limit_m = limits_m(models, ransac.inlier_m, in_both=ransac.in_both)
        counts = conforming(models, p_m, q_m, pairs, limit_m)
        best = best_models(models, counts, p_m, 1, config.verify.distinct_m)

        def align(model: Sim2) -> Sim2:
            inliers = pairs[conforming_to(model, p_m, q_m, pairs, ransac.inlier_m)]
            fitted = refitted(model, p_m[inliers[:, 0]], q_m[inliers[:, 1]])
            return with_known_scale(fitted, config, p_m[inliers[:, 0]])

        found = candidates(target.map, source.map, best, align, config.verify)
        inliers = pairs[conforming_to(found[0].target_from_source, p_m, q_m, pairs, ransac.inlier_m)]
        evidence = pairs_evidence((target.pixels, target.features), (source.pixels, source.features), inliers)
        return outcome(target.map, source.map, found, prior, config.verify, (*shown, evidence))
