"""Settings of the merger, validated, in the units of their names."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

from mapmerge.errors import ConfigError
from mapmerge.paper.config import ExistingConfig, PaperConfig, RansacConfig
from mapmerge.settings import Settings

__all__ = [
    "CellConfig",
    "ExistingConfig",
    "MergeConfig",
    "PaperConfig",
    "RansacConfig",
    "RefineConfig",
    "ScaleChoice",
    "SearchConfig",
    "VerifyConfig",
]

ScaleChoice = Literal["metadata", "free"]


@dataclass(frozen=True, slots=True)
class CellConfig(Settings):
    """When a cell counts as occupied or free (paper, equation 1)."""

    p_occupied: float = 0.65
    p_free: float = 0.25

    def __post_init__(self) -> None:
        super(CellConfig, self).__post_init__()
        if not self.p_free < self.p_occupied <= 1.0:
            raise ConfigError(
                f"p_free is {self.p_free} and p_occupied {self.p_occupied}; expected p_free < p_occupied ≤ 1"
            )

    @property
    def min_occupied_percent(self) -> int:
        """Smallest cell value that counts as occupied."""
        return math.ceil(self.p_occupied * 100 - 1e-9)

    @property
    def max_free_percent(self) -> int:
        """Largest cell value that counts as free."""
        return math.floor(self.p_free * 100 + 1e-9)


@dataclass(frozen=True, slots=True)
class SearchConfig(Settings):
    """How candidates for a placement are found.

    Parameters
    ----------
    wall_spacing_m
        Walls are thinned to one point per square of this side or, in coarser maps, per cell, which then stands for
        a cell of wall: a metre of wall weighs about the same in maps of any resolution.
    angle_step_rad
        Step of the orientation spectrum.
    rotations
        Rotations taken from the spectra's correlation; each is tried as it is and turned by 180°.
    cell_m
        Side of the cells of the coarse maps that are correlated; larger where the maps have larger cells, or would
        need more than `max_side_cells` of them.
    free_weight
        What a wall in the other map's free space costs, against 1 for a wall on a wall.
    shifts
        Peaks of the correlation surface that are taken for each rotation.
    peak_distance_m
        Least distance of two peaks of one surface.
    max_side_cells
        Most cells a side of the correlated maps.
    max_candidates
        Candidates of all rotations that are refined.
    working_cell_m
        Two maps are matched at the coarser of their resolutions, and never finer than this.
    """

    wall_spacing_m: float = 0.10
    angle_step_rad: float = math.radians(1.0)
    rotations: int = 4
    cell_m: float = 0.20
    free_weight: float = 0.25
    shifts: int = 8
    peak_distance_m: float = 0.8
    max_side_cells: int = 1500
    max_candidates: int = 48
    working_cell_m: float = 0.05


@dataclass(frozen=True, slots=True)
class RefineConfig(Settings):
    """How a candidate is aligned (ICP against a distance transform).

    Parameters
    ----------
    reject_m
        Pairs further apart than this are left out, in turn; the search narrows from the first to the last.
    iterations
        At most so many steps at each of these distances.
    max_points
        Wall points used, evenly thinned.
    max_polish_points
        Wall cells used in the last, finest alignment.
    blur_cells
        Standard deviation, in cells, by which walls are blurred there.
    """

    reject_m: tuple[float, ...] = (0.8, 0.4, 0.2)
    iterations: int = 12
    max_points: int = 1500
    max_polish_points: int = 3000
    blur_cells: float = 1.0


@dataclass(frozen=True, slots=True)
class VerifyConfig(Settings):
    """What a placement must pass to be accepted.

    Parameters
    ----------
    tolerance_m
        A wall is matched by a wall at most this far away.
    violation_weight, free_weight
        Score of a placement in metres: matched wall − `violation_weight` × metres of wall in the other's free space
        + `free_weight` × m² of agreeing free space.
    min_overlap_m2
        Least area that both maps know.
    min_matched_wall_m
        Least length of wall that both maps saw.
    min_acceptance
        Least acceptance index ω.
    min_wall_agreement
        Least share of the walls in the overlap that the other map has as well, in the worse of both directions.
    min_margin
        Least lead over the best distinct rival, as a share of the score.
    min_confidence
        Least calibrated probability that the placement is right, where the method states one.
    distinct_m, distinct_rad
        Placements that differ by more than one of these are rivals, not the same.
    """

    tolerance_m: float = 0.15
    violation_weight: float = 2.0
    free_weight: float = 0.5
    min_overlap_m2: float = 10.0
    min_matched_wall_m: float = 8.0
    min_acceptance: float = 0.95
    min_wall_agreement: float = 0.8
    min_margin: float = 0.4
    min_confidence: float = 0.999
    distinct_m: float = 0.75
    distinct_rad: float = math.radians(5.0)


@dataclass(frozen=True, slots=True)
class MergeConfig(Settings):
    """All settings of the merger.

    Parameters
    ----------
    method
        A name of `mapmerge.match.MATCHERS`.
    scale
        Whether the maps' resolutions are believed (``metadata``: placements are rigid) or the ratio of their true
        resolutions is estimated as well (``free``).
    scale_range
        Least and largest factor by which the ratio of resolutions may be wrong, with ``free``.
    moved_m, moved_rad
        A placement that changed by more than one of these since it was last reported has moved.
    """

    method: str = "correlation"
    scale: ScaleChoice = "metadata"
    scale_range: tuple[float, float] = (0.4, 2.5)
    cells: CellConfig = field(default_factory=CellConfig)
    search: SearchConfig = field(default_factory=SearchConfig)
    refine: RefineConfig = field(default_factory=RefineConfig)
    verify: VerifyConfig = field(default_factory=VerifyConfig)
    paper: PaperConfig = field(default_factory=PaperConfig)
    existing: ExistingConfig = field(default_factory=ExistingConfig)
    moved_m: float = 0.10
    moved_rad: float = math.radians(0.5)
