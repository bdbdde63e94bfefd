"""The default matcher: orientation spectra, correlation of coarse maps, ICP, and tests of the outcome.

1. Rotations from the orientation spectra, each also turned by 180°.
2. Translations for each rotation from the correlation of coarse maps: walls on walls, less walls in free space.
3. Every candidate aligned by ICP against the target's distance transform.
4. Candidates ranked by walls and free space that agree, in both directions; the best one aligned more finely.
5. The best one verified, and compared with the best one that is distinct from it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import islice

from mapmerge.config import MergeConfig, VerifyConfig
from mapmerge.evidence import Curve, CurvesEvidence, Evidence, OverlayEvidence, SurfaceEvidence
from mapmerge.grid import Grid
from mapmerge.match.base import Match, Rival
from mapmerge.match.spectrum import Spectrum, orientation_spectrum, rotation_peaks, spectrum_correlation
from mapmerge.match.surface import CorrelationSurface, Peak, TranslationSearch, surface_peaks
from mapmerge.prepare import PreparedMap, prepare
from mapmerge.prior import Prior
from mapmerge.reasons import Reason, ReasonCode
from mapmerge.refine import evenly, polish, refine
from mapmerge.sim2 import Sim2
from mapmerge.verify import Scores, rank_score_m, verify

_RIVALS_REPORTED = 3
_BESIDE = 1.2
_BESIDE_POINTS = 500


@dataclass(frozen=True, slots=True, eq=False)
class _Prepared:
    """A map with its orientation spectrum."""

    map: PreparedMap
    spectrum: Spectrum


@dataclass(frozen=True, slots=True, eq=False)
class _Candidate:
    """A placement between the grid frames, refined, with what it came from."""

    target_from_source: Sim2
    score_m: float
    surface: CorrelationSurface
    peak: Peak


class CorrelationMatcher:
    """Finds a rigid placement; the resolutions are taken from the maps' metadata."""

    def prepare(self, grid: Grid, resolution_m: float, config: MergeConfig) -> _Prepared:
        """Return the walls, distances and orientation spectrum of one map."""
        prepared = prepare(grid, resolution_m, config)
        return _Prepared(
            prepared, orientation_spectrum(prepared.walls_m, config.search.angle_step_rad, prepared.wall_spacing_m)
        )

    def match(self, target: _Prepared, source: _Prepared, config: MergeConfig, prior: Prior | None = None) -> Match:
        """Return the best placement of the source on the target, accepted or refused."""
        poor = _too_little_structure(target.map, source.map, config)
        if poor is not None:
            return Match(None, None, accepted=False, reason=poor)
        correlation = spectrum_correlation(target.spectrum, source.spectrum)
        rotations = rotation_peaks(correlation, config.search.rotations)
        candidates = _candidates(target.map, source.map, rotations, config)
        if not candidates:
            reason = Reason(ReasonCode.NO_CANDIDATE, "no placement lets walls of the two maps coincide")
            return Match(None, None, accepted=False, reason=reason, evidence=(_spectra(target, source, rotations),))
        best = _polished(candidates[0], target.map, source.map, config)
        scores = verify(target.map, source.map, best.target_from_source, config.verify)
        others = candidates[1:]
        if judge(scores, None, config.verify).code is ReasonCode.ACCEPTED:
            others = [*others, *_beside(best, target.map, source.map, config)]
        candidates = [best, *sorted(others, key=lambda candidate: -candidate.score_m)]
        rivals = tuple(islice(_distinct(candidates, source.map, config.verify), _RIVALS_REPORTED))
        reason = judge(scores, rivals[0].score_m if rivals else None, config.verify)
        return Match(
            target_from_source=_between_maps(target.map, source.map, best.target_from_source),
            scores=scores,
            accepted=reason.code is ReasonCode.ACCEPTED,
            reason=reason,
            rivals=tuple(
                Rival(_between_maps(target.map, source.map, rival.target_from_source), rival.score_m)
                for rival in rivals
            ),
            evidence=(
                _spectra(target, source, rotations),
                _surface(best, candidates),
                _overlay(target.map, source.map, best, config.verify),
            ),
        )


def judge(scores: Scores, rival_score_m: float | None, config: VerifyConfig) -> Reason:
    """Return why a placement is accepted or, the first test that it fails, why not."""
    if scores.overlap_m2 < config.min_overlap_m2:
        message = f"the maps share {_down(scores.overlap_m2, 1):.1f} m², less than {config.min_overlap_m2:g} m²"
        return Reason(ReasonCode.TOO_LITTLE_OVERLAP, message)
    if scores.matched_wall_m < config.min_matched_wall_m:
        message = (
            f"the maps share {_down(scores.matched_wall_m, 1):.1f} m of wall, less than {config.min_matched_wall_m:g} m"
        )
        return Reason(ReasonCode.TOO_LITTLE_OVERLAP, message)
    if scores.wall_agreement < config.min_wall_agreement:
        message = (
            f"of the walls in the overlap {_down(scores.wall_agreement, 2):.0%} agree, "
            f"less than {config.min_wall_agreement:.0%}"
        )
        return Reason(ReasonCode.WALLS_DISAGREE, message)
    if scores.acceptance < config.min_acceptance:
        message = f"the acceptance index is {_down(scores.acceptance, 3):.3f}, less than {config.min_acceptance:g}"
        return Reason(ReasonCode.LOW_ACCEPTANCE, message)
    if scores.score_m <= 0.0:
        message = f"walls in the other map's free space outweigh what agrees, the score is {scores.score_m:.1f} m"
        return Reason(ReasonCode.WALLS_DISAGREE, message)
    likeness = max(0.0, rival_score_m / scores.score_m) if rival_score_m is not None else 0.0
    if likeness > 1.0 - config.min_margin:
        message = (
            f"another placement is {likeness:.2f} times as good as the best one, more than {1 - config.min_margin:.2f}"
        )
        return Reason(ReasonCode.AMBIGUOUS, message)
    message = (
        f"{scores.overlap_m2:.0f} m² overlap, walls agree {scores.wall_agreement:.2f}, "
        f"next best placement {likeness:.2f} times as good"
    )
    return Reason(ReasonCode.ACCEPTED, message)


def _down(value: float, digits: int) -> float:
    """Round down, so that what is less than a limit reads like that."""
    return math.floor(value * 10.0**digits) / 10.0**digits


def _too_little_structure(target: PreparedMap, source: PreparedMap, config: MergeConfig) -> Reason | None:
    """Return a refusal if one of the maps has fewer walls than a placement must match."""
    least_m = min(len(prepared.walls_m) * prepared.wall_spacing_m for prepared in (target, source))
    if least_m >= config.verify.min_matched_wall_m:
        return None
    message = f"one of the maps shows {least_m:.1f} m of wall, less than {config.verify.min_matched_wall_m:g} m"
    return Reason(ReasonCode.TOO_LITTLE_STRUCTURE, message)


def _candidates(
    target: PreparedMap, source: PreparedMap, rotations: tuple[float, ...], config: MergeConfig
) -> list[_Candidate]:
    """Return refined candidates of all rotations, best first."""
    search = TranslationSearch(target, source, config.search)
    surfaces = [search.surface(yaw_rad + half) for yaw_rad in rotations for half in (0.0, math.pi)]
    found = [(peak, surface) for surface in surfaces for peak in surface_peaks(surface, config.search)]
    found.sort(key=lambda item: -item[0].value)
    walls_m = evenly(source.walls_m, config.refine.max_points)
    candidates = []
    for peak, surface in found[: config.search.max_candidates]:
        pose = refine(target, walls_m, peak.target_from_source, config.refine)
        score_m = rank_score_m(target, source, pose, config.verify)
        candidates.append(_Candidate(pose, score_m, surface, peak))
    candidates.sort(key=lambda candidate: -candidate.score_m)
    return candidates


def _polished(best: _Candidate, target: PreparedMap, source: PreparedMap, config: MergeConfig) -> _Candidate:
    """Return the best candidate, aligned to a fraction of a cell."""
    pose = polish(target, source.wall_cells_m, best.target_from_source, config.refine)
    score_m = rank_score_m(target, source, pose, config.verify)
    return replace(best, target_from_source=pose, score_m=score_m)


def _beside(best: _Candidate, target: PreparedMap, source: PreparedMap, config: MergeConfig) -> list[_Candidate]:
    """Return candidates that begin beside the best one and do not come back to it.

    Along walls without an end the score has a ridge but no second peak, so that no peak of a surface is a rival there.
    """
    walls_m = evenly(source.walls_m, _BESIDE_POINTS)
    reach_m = _BESIDE * config.verify.distinct_m
    found = []
    for turn in range(8):
        angle_rad = turn * math.tau / 8
        shift = Sim2(reach_m * math.cos(angle_rad), reach_m * math.sin(angle_rad))
        pose = refine(target, walls_m, shift @ best.target_from_source, config.refine)
        if not _same_place(best.target_from_source, pose, source, config.verify):
            score_m = rank_score_m(target, source, pose, config.verify)
            found.append(_Candidate(pose, score_m, best.surface, best.peak))
    return found


def _same_place(one: Sim2, other: Sim2, source: PreparedMap, config: VerifyConfig) -> bool:
    x_m, y_m = source.walls_m.mean(axis=0)
    return one.is_close(
        other, distance_m=config.distinct_m, angle_rad=config.distinct_rad, at_m=(float(x_m), float(y_m))
    )


def _distinct(candidates: list[_Candidate], source: PreparedMap, config: VerifyConfig) -> list[_Candidate]:
    """Return the candidates, best first, each of which differs from all better ones."""
    kept = candidates[:1]
    for candidate in candidates[1:]:
        pose = candidate.target_from_source
        if not any(_same_place(pose, other.target_from_source, source, config) for other in kept):
            kept.append(candidate)
    return kept[1:]


def _between_maps(target: PreparedMap, source: PreparedMap, target_from_source: Sim2) -> Sim2:
    """Return a placement between grid frames as one between map frames."""
    return target.grid.map_from_grid @ target_from_source @ source.grid.map_from_grid.inverse()


def _spectra(target: _Prepared, source: _Prepared, rotations: tuple[float, ...]) -> CurvesEvidence:
    correlation = spectrum_correlation(target.spectrum, source.spectrum)
    return CurvesEvidence(
        step="orientation_spectra",
        title="Orientation spectra and their correlation",
        axis="angle [°]",
        start=0.0,
        stop=180.0,
        curves=(
            Curve("target", target.spectrum),
            Curve("source", source.spectrum),
            Curve("correlation", correlation),
        ),
        marks=tuple(math.degrees(angle) for angle in rotations),
    )


def _surface(best: _Candidate, candidates: list[_Candidate]) -> Evidence:
    surface = best.surface

    def at(peak: Peak) -> tuple[int, int]:
        pose = peak.target_from_source
        row = round((pose.y_m - surface.origin_m[1]) / surface.step_m)
        return row, round((pose.x_m - surface.origin_m[0]) / surface.step_m)

    return SurfaceEvidence(
        step="correlation_surface",
        title=f"Correlation of walls and free space, source turned by {math.degrees(surface.yaw_rad):.1f}°",
        values=surface.values,
        marks=tuple(at(candidate.peak) for candidate in candidates if candidate.surface is surface),
        chosen=at(best.peak),
    )


def _overlay(target: PreparedMap, source: PreparedMap, best: _Candidate, config: VerifyConfig) -> Evidence:
    return OverlayEvidence(
        step="overlay",
        title="Walls that agree are green, walls in the other map's free space red",
        target=target,
        source=source,
        target_from_source=best.target_from_source,
        tolerance_m=config.tolerance_m,
    )
