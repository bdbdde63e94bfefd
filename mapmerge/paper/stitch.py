"""From RANSAC's models to a match: what the paper's method and the one it compares with have in common."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from mapmerge.config import MergeConfig, RansacConfig, VerifyConfig
from mapmerge.evidence import Evidence, OverlayEvidence
from mapmerge.match.base import Match, Rival
from mapmerge.paper.ransac import Bounds, Models
from mapmerge.prepared import PreparedMap
from mapmerge.prior import Prior
from mapmerge.reasons import Reason, ReasonCode
from mapmerge.sim2 import Points, Sim2
from mapmerge.verify import Scores, verify

MIN_FEATURES = 4
_RIVALS_REPORTED = 3
_SLACK_RAD = math.radians(3.0)


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A placement between the grid frames and its figures."""

    target_from_source: Sim2
    scores: Scores


def scale_bounds(config: MergeConfig, ransac: RansacConfig) -> tuple[float, float]:
    """Return what a model's scale may be, in metres per metre: near 1, unless the resolutions are not believed."""
    if config.scale == "free":
        return config.scale_range
    return 1.0 - ransac.scale_tolerance, 1.0 + ransac.scale_tolerance


def with_known_scale(model: Sim2, config: MergeConfig, at_m: Points) -> Sim2:
    """Return the model with the scale that the resolutions say, about the middle of some points of the source."""
    if config.scale == "free" or len(at_m) == 0:
        return model
    x_m, y_m = at_m.mean(axis=0).tolist()
    here_x, here_y = model.apply_point(x_m, y_m)
    turned_x, turned_y = Sim2(yaw_rad=model.yaw_rad).apply_point(x_m, y_m)
    return Sim2(here_x - turned_x, here_y - turned_y, model.yaw_rad)


def between_maps(target: PreparedMap, source: PreparedMap, target_from_source: Sim2) -> Sim2:
    """Return a placement between grid frames as one between map frames."""
    return target.grid.map_from_grid @ target_from_source @ source.grid.map_from_grid.inverse()


def allowed(models: Models, target: PreparedMap, source: PreparedMap, prior: Prior | None, slack_m: float) -> Models:
    """Return the models, given between grid frames, that a prior allows, give or take what ICP may yet mend."""
    if prior is None:
        return models
    outer, inner = target.grid.map_from_grid, source.grid.map_from_grid.inverse()
    shift = models.apply(np.array([[inner.x_m, inner.y_m]]))[:, 0]
    turn_rad = models.turn_rad + outer.yaw_rad + inner.yaw_rad
    poses = np.column_stack([outer.apply(shift), turn_rad])
    return models[prior.allows_each(poses, slack_m, _SLACK_RAD)]


def candidates(
    target: PreparedMap,
    source: PreparedMap,
    models: Sequence[Sim2],
    align: Callable[[Sim2], Sim2],
    config: VerifyConfig,
) -> list[Candidate]:
    """Return the models aligned and verified, by acceptance index, the largest first."""
    found = [Candidate(pose, verify(target, source, pose, config)) for pose in map(align, models)]
    return sorted(found, key=lambda candidate: -candidate.scores.acceptance)


def judge(scores: Scores, config: VerifyConfig) -> Reason:
    """Return whether a placement is accepted: ω ≥ ω_thres, and nothing else (equations 3 and 4)."""
    omega = math.floor(scores.acceptance * 1000.0) / 1000.0
    if scores.acceptance == 0.0:
        message = "no cell of the two maps agrees at the best placement, so that its acceptance index is 0"
        return Reason(ReasonCode.TOO_LITTLE_OVERLAP, message)
    if scores.acceptance < config.min_acceptance:
        message = f"the acceptance index is {omega:.3f}, less than {config.min_acceptance:g}"
        return Reason(ReasonCode.LOW_ACCEPTANCE, message)
    message = f"the acceptance index is {omega:.3f}, at least {config.min_acceptance:g}, on {scores.overlap_m2:.0f} m²"
    return Reason(ReasonCode.ACCEPTED, message)


def outcome(
    target: PreparedMap,
    source: PreparedMap,
    found: Sequence[Candidate],
    prior: Prior | None,
    config: VerifyConfig,
    evidence: tuple[Evidence, ...],
) -> Match:
    """Return the match of the best candidate, the others as rivals.

    The acceptance index is the paper's only measure of a placement; so it is also what the match is trusted by when
    matches of several robots contradict each other.
    """
    poses = [between_maps(target, source, candidate.target_from_source) for candidate in found]
    best = found[0]
    if prior is not None and not prior.allows(poses[0]):
        reason = Reason(
            ReasonCode.PRIOR_CONTRADICTED,
            f"once aligned, the maps lie outside of the spread of the placement {prior.origin}",
        )
    else:
        reason = judge(best.scores, config)
    others = [item for item in zip(poses[1:], found[1:], strict=True) if not same_place(best, item[1], source, config)]
    others.sort(key=lambda item: -item[1].scores.score_m)
    return Match(
        target_from_source=poses[0],
        scores=best.scores,
        accepted=reason.code is ReasonCode.ACCEPTED,
        reason=reason,
        weight=best.scores.acceptance,
        rivals=tuple(Rival(pose, candidate.scores.score_m) for pose, candidate in others[:_RIVALS_REPORTED]),
        evidence=(*evidence, overlay(target, source, best, config)),
    )


def same_place(one: Candidate, other: Candidate, source: PreparedMap, config: VerifyConfig) -> bool:
    """Tell whether two candidates put the source in about the same place."""
    width_m, height_m = source.extent_m
    return one.target_from_source.is_close(
        other.target_from_source,
        distance_m=config.distinct_m,
        angle_rad=config.distinct_rad,
        at_m=(width_m / 2, height_m / 2),
    )


def refused(code: ReasonCode, message: str, evidence: tuple[Evidence, ...]) -> Match:
    """Return a match without a placement."""
    return Match(None, None, accepted=False, reason=Reason(code, message), evidence=evidence)


def overlay(target: PreparedMap, source: PreparedMap, best: Candidate, config: VerifyConfig) -> Evidence:
    """Return what figures 14, 17 and 20 show: what agrees in green and what does not in red."""
    return OverlayEvidence(
        step="overlay",
        title=f"Acceptance index {best.scores.acceptance:.3f}: walls that agree green, in the other's free space red",
        target=target,
        source=source,
        target_from_source=best.target_from_source,
        tolerance_m=config.tolerance_m,
    )


def bounds_of(config: MergeConfig, ransac: RansacConfig, turn_rad: float, tolerance_rad: float) -> Bounds:
    """Return the bounds of RANSAC's models; a tolerance of 0 leaves the turn free."""
    step_rad = math.pi / 2 if tolerance_rad > 0 else 0.0
    return Bounds(scale_bounds(config, ransac), turn_rad, step_rad, tolerance_rad, ransac.min_arm_m)
