"""What the default matcher saw of a pair, as data: made from the pair and its match alone, when it is asked for."""

from __future__ import annotations

import math
from dataclasses import replace

from mapmerge.config import MergeConfig, SearchConfig
from mapmerge.evidence import Curve, CurvesEvidence, Evidence, OverlayEvidence, SurfaceEvidence
from mapmerge.match.base import Match
from mapmerge.match.candidates import likely_rotations
from mapmerge.match.pair import PairOfMaps
from mapmerge.match.spectrum import spectrum_correlation
from mapmerge.match.surface import CoarseCells, TranslationSearch
from mapmerge.sim2 import Sim2, wrap_angle

_SAME_TURN_RAD = 0.1


def explained(pair: PairOfMaps, match: Match, config: MergeConfig) -> tuple[Evidence, ...]:
    """Return what each step of a match saw, in order, of the maps as they were given.

    Parameters
    ----------
    pair
        The maps in the order in which they were matched.
    match
        Its outcome, in that order.
    config
        Settings.
    """
    spectra = _spectra(pair, config.search)
    if match.target_from_source is None:
        return (spectra,)
    best = pair.between_grids(match.target_from_source)
    rivals = [pair.between_grids(rival.target_from_source) for rival in match.rivals]
    surface = _surface(pair, best, rivals, config.search)
    # said as the placement is: of the map frames, and of the pair in the order in which it was given
    yaw_rad = match.target_from_source.yaw_rad
    surface = replace(surface, turn_rad=-yaw_rad if pair.swapped else yaw_rad)
    return (spectra, surface, _overlay(pair, best, config))


def _spectra(pair: PairOfMaps, config: SearchConfig) -> CurvesEvidence:
    target, source = pair.target.spectra[0], pair.source.spectra[0]
    labels = ("source", "target") if pair.swapped else ("target", "source")
    return CurvesEvidence(
        step="orientation_spectra",
        title="Orientation spectra and their correlation",
        axis="angle [°]",
        start=0.0,
        stop=180.0,
        curves=(
            Curve(labels[0], target),
            Curve(labels[1], source),
            Curve("correlation", spectrum_correlation(target, source)),
        ),
        marks=tuple(math.degrees(angle) for angle in likely_rotations(pair, config)),
    )


def _surface(pair: PairOfMaps, best: Sim2, rivals: list[Sim2], config: SearchConfig) -> SurfaceEvidence:
    """Return the surface at the rotation of the best placement, with all rivals of about this rotation."""
    turn = Sim2(0.0, 0.0, best.yaw_rad, best.scale)
    translations = TranslationSearch(
        pair.target.map,
        pair.source.map,
        CoarseCells.of(config, config.cell_m),
        config.free_weights[-1:],
        [turn],
    )
    surface = translations.surfaces(turn)[0]
    return SurfaceEvidence(
        step="correlation_surface",
        title="Correlation of walls and free space",
        values=surface.values,
        marks=tuple(
            surface.index(rival) for rival in rivals if abs(wrap_angle(rival.yaw_rad - best.yaw_rad)) < _SAME_TURN_RAD
        ),
        chosen=surface.index(best),
    )


def _overlay(pair: PairOfMaps, best: Sim2, config: MergeConfig) -> Evidence:
    seen = OverlayEvidence(
        step="overlay",
        title="Both maps at the best placement: walls that agree, walls in the other's free space",
        target=pair.target.map,
        source=pair.source.map,
        target_from_source=best,
        tolerance_m=config.verify.tolerance_m,
    )
    if not pair.swapped:
        return seen
    return replace(seen, target=seen.source, source=seen.target, target_from_source=best.inverse())
