"""Settings of the merger, validated, in the units of their names."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from typing import Literal

from mapmerge.errors import ConfigError

ScaleChoice = Literal["metadata", "free"]

_DIVISORS = {
    "scale_range",
    "wall_spacing_m",
    "angle_step_rad",
    "cell_m",
    "reject_m",
    "blur_cells",
    "radon_bin_m",
    "inlier_m",
    "icp_reject_m",
    "max_side_cells",
}


@dataclass(frozen=True, slots=True)
class _Settings:
    """Base of all settings: numbers must be finite and not negative."""

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            for number in value if isinstance(value, tuple) else (value,):
                if isinstance(number, (int, float)) and not (math.isfinite(number) and number >= 0):
                    raise ConfigError(f"{item.name} is {value}; expected finite numbers that are not negative")
            if item.name in _DIVISORS and not (min(value, default=1.0) if isinstance(value, tuple) else value) > 0:
                raise ConfigError(f"{item.name} is {value}; expected more than 0")


@dataclass(frozen=True, slots=True)
class CellConfig(_Settings):
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
class SearchConfig(_Settings):
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
class RefineConfig(_Settings):
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
class VerifyConfig(_Settings):
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
class RansacConfig(_Settings):
    """How a placement is drawn from pairs of features (paper, equations 5 to 11).

    Parameters
    ----------
    inlier_m
        The distance ε below which a pair conforms to a model.
    in_both
        Whether ε holds in both maps' metres, which matters where scale is free; the paper has it in the target's.
    draws
        Most models that are looked at.
    seed
        Of the order in which pairs are drawn.
    min_arm_m
        Least distance of the two features of one map in a draw.
    scale_tolerance
        A model's scale may differ from what the maps' resolutions say by this share, unless scale is free; what is
        returned has the scale that they say.
    """

    inlier_m: float = 0.2
    in_both: bool = True
    draws: int = 60_000
    seed: int = 0
    min_arm_m: float = 1.5
    scale_tolerance: float = 0.03


@dataclass(frozen=True, slots=True)
class PaperConfig(_Settings):
    """The paper's method (section 4.2), its lengths in metres rather than pixels.

    Parameters
    ----------
    binary_threshold
        Pixels darker than this are occupied (B_thres); a map has 0 occupied, 128 unknown, 255 free.
    angle_step_rad, radon_bin_m
        Step of the angle, and width of the lines, of the Radon transform.
    closing_m, interest_m
        Side of the square S of the closing, and of Algorithm 1.
    reach_m, min_line_share
        The distance L and the ratio R_thres of Algorithm 2.
    min_wall_m
        Corrected walls that are thinner are dilated by a square of this side.
    max_features
        Features used of each map, the strongest.
    turn_tolerance_rad
        Both maps being parallel to the axes, they are a multiple of 90° apart, to within this; 0 for any turn.
    max_models
        Distinct models of RANSAC that are aligned by ICP; the one of largest acceptance index is taken. The paper
        takes one.
    icp_reject_m
        Pairs further apart than this are left out of ICP, in turn.
    icp_iterations
        At most so many at each of these distances.
    max_side_cells
        Maps with more cells a side are worked on at a coarser resolution.
    """

    binary_threshold: float = 100.0
    angle_step_rad: float = math.radians(0.5)
    radon_bin_m: float = 0.1
    closing_m: float = 0.15
    interest_m: float = 0.45
    reach_m: float = 1.0
    min_line_share: float = 0.7
    min_wall_m: float = 0.15
    max_features: int = 300
    turn_tolerance_rad: float = math.radians(3.0)
    max_models: int = 12
    icp_reject_m: tuple[float, ...] = (0.6, 0.3)
    icp_iterations: int = 30
    max_side_cells: int = 1500
    ransac: RansacConfig = field(default_factory=RansacConfig)


@dataclass(frozen=True, slots=True)
class ExistingConfig(_Settings):
    """The method that the paper compares with (section 4.1): SIFT on the map as it is.

    Parameters
    ----------
    max_features
        Features used of each map, the strongest.
    max_side_cells
        Maps with more cells a side are worked on at a coarser resolution.
    """

    max_features: int = 1000
    max_side_cells: int = 1500
    ransac: RansacConfig = RansacConfig(inlier_m=0.1)


@dataclass(frozen=True, slots=True)
class MergeConfig(_Settings):
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
