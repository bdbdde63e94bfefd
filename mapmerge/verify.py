"""The evidence for a placement: the acceptance index (paper, equation 3) and the tests that it lacks.

Free cells outnumber walls, so that ω alone is high for many wrong placements; walls that agree in both directions,
walls that stand in the other map's free space, and the lead over rival placements tell them apart.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from mapmerge.align import poses_of
from mapmerge.config import VerifyConfig
from mapmerge.prepared import CELL_FREE, CELL_OCCUPIED, CELL_UNKNOWN, PreparedMap
from mapmerge.score import Agreement, agreement, probe
from mapmerge.sim2 import Sim2

_CLASSES = 4
_BAND_CELLS = 1 << 20  # so few that single precision counts them


@dataclass(frozen=True, slots=True)
class Scores:
    """How well two maps agree at one placement.

    Parameters
    ----------
    score_m
        What placements of one pair are ranked by, see `VerifyConfig.violation_weight`.
    acceptance
        Acceptance index ω, equation 3, cell by cell at the working resolution.
    overlap_m2
        Area that both maps know.
    overlap_fraction
        The same over the smaller known area.
    wall_agreement
        Share of walls that agree, in the worse of both directions.
    matched_wall_m
        Length of the walls that agree, mean of both directions.
    violated_wall_m
        Length of the walls in the other's free space, mean of both directions.
    """

    score_m: float
    acceptance: float
    overlap_m2: float
    overlap_fraction: float
    wall_agreement: float
    matched_wall_m: float
    violated_wall_m: float


def rank_score_m(target: PreparedMap, source: PreparedMap, target_from_source: Sim2, config: VerifyConfig) -> float:
    """Return what placements are ranked by, see `VerifyConfig.violation_weight`, from all points of both maps."""
    return float(_agreement(target, source, target_from_source).score_m(config)[0])


def verify(target: PreparedMap, source: PreparedMap, target_from_source: Sim2, config: VerifyConfig) -> Scores:
    """Return all that is known of a placement between the grid frames."""
    return verified(target, source, target_from_source, config)[0]


def verified(
    target: PreparedMap, source: PreparedMap, target_from_source: Sim2, config: VerifyConfig
) -> tuple[Scores, Agreement]:
    """Return all that is known of a placement between the grid frames, and what it was computed from."""
    found = _agreement(target, source, target_from_source)
    agree, disagree, both = cell_agreement(target, source, target_from_source)
    cell_m2 = (source.resolution_m * target_from_source.scale) ** 2
    smaller_m2 = min(target.known_area_m2, source.known_area_m2 * target_from_source.scale**2)
    ahead, back = found.ahead, found.back
    scores = Scores(
        score_m=float(found.score_m(config)[0]),
        acceptance=agree / (agree + disagree) if agree else 0.0,
        overlap_m2=both * cell_m2,
        overlap_fraction=min(1.0, both * cell_m2 / smaller_m2) if smaller_m2 > 0 else 0.0,
        wall_agreement=float(min(ahead.share[0], back.share[0])),
        matched_wall_m=float(ahead.matched_m[0] + back.matched_m[0]) / 2,
        violated_wall_m=float(ahead.violated_m[0] + back.violated_m[0]) / 2,
    )
    return scores, found


def _agreement(target: PreparedMap, source: PreparedMap, target_from_source: Sim2) -> Agreement:
    most = max(len(target.walls_m), len(source.walls_m), len(source.free_m), 1)
    pose = poses_of([target_from_source])
    return agreement(target, source, pose, probe(source, most, most), probe(target, most, most))


def cell_agreement(target: PreparedMap, source: PreparedMap, target_from_source: Sim2) -> tuple[int, int, int]:
    """Count the cells that agree (both occupied or both free), that disagree, and that both maps know.

    Each cell of the source is compared with the target's cell in which its centre lies.
    """
    # cv2 has integer coordinates at the centres of the cells
    half = Sim2(0.5, 0.5)
    ratio = target.resolution_m / source.resolution_m
    margins_m = target.margin * target.resolution_m, source.margin * source.resolution_m
    pose = Sim2(margins_m[0], margins_m[0]) @ target_from_source @ Sim2(-margins_m[1], -margins_m[1])
    in_cells = replace(
        pose, x_m=pose.x_m / target.resolution_m, y_m=pose.y_m / target.resolution_m, scale=pose.scale / ratio
    )
    part = _where_both_are(in_cells.inverse(), target.classes.shape, source.classes.shape)
    here = source.classes[part]
    if here.size == 0:
        return 0, 0, 0
    matrix = (half.inverse() @ in_cells @ Sim2(part[1].start, part[0].start) @ half).matrix[:2]
    there = cv2.warpAffine(
        target.classes,
        matrix,
        here.shape[::-1],
        flags=cv2.INTER_NEAREST | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=CELL_UNKNOWN,
    )
    counts = _pairs_of_classes(here, np.asarray(there, np.uint8))
    agree = counts[CELL_FREE, CELL_FREE] + counts[CELL_OCCUPIED, CELL_OCCUPIED]
    disagree = counts[CELL_FREE, CELL_OCCUPIED] + counts[CELL_OCCUPIED, CELL_FREE]
    is_known = np.arange(_CLASSES) != CELL_UNKNOWN
    known = counts[np.ix_(is_known, is_known)].sum()
    return int(agree), int(disagree), int(known)


def _pairs_of_classes(here: NDArray[np.uint8], there: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Count how often each class of one map lies on each of the other, shape (4, 4), a few rows at a time."""
    counts = np.zeros(_CLASSES**2, np.int64)
    rows = max(1, _BAND_CELLS // max(1, here.shape[1]))
    for top in range(0, len(here), rows):
        pairs = here[top : top + rows] * np.uint8(_CLASSES) + there[top : top + rows]
        found = cv2.calcHist([pairs], [0], None, [_CLASSES**2], [0, _CLASSES**2])
        counts += np.asarray(found, np.int64).reshape(-1)
    return counts.reshape(_CLASSES, _CLASSES)


def _where_both_are(
    source_from_target: Sim2, target_shape: tuple[int, ...], source_shape: tuple[int, ...]
) -> tuple[slice, slice]:
    """Return the rows and columns of the source, in cells, outside of which no cell of the target lies."""
    rows, cols = target_shape
    corners = source_from_target.apply(np.array([(0, 0), (cols, 0), (0, rows), (cols, rows)], np.float64))
    low = np.clip(np.floor(corners.min(axis=0)) - 1, 0, source_shape[::-1]).astype(int).tolist()
    high = np.clip(np.ceil(corners.max(axis=0)) + 1, 0, source_shape[::-1]).astype(int).tolist()
    return slice(low[1], high[1]), slice(low[0], high[0])
