"""Settings of the paper's method and of the one it compares with."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Annotated

from mapmerge.settings import Above, Settings, Within


@dataclass(frozen=True, slots=True)
class RansacConfig(Settings):
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

    inlier_m: Annotated[float, Above(0.0, 1000.0)] = 0.2
    in_both: bool = True
    draws: Annotated[int, Within(1, 1_000_000)] = 60_000
    seed: Annotated[int, Within(0, (1 << 63) - 1)] = 0
    min_arm_m: float = 1.5
    scale_tolerance: float = 0.03


@dataclass(frozen=True, slots=True)
class PaperConfig(Settings):
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
    angle_step_rad: Annotated[float, Within(0.001, 0.5)] = math.radians(0.5)
    radon_bin_m: Annotated[float, Above(0.0, 10.0)] = 0.1
    closing_m: Annotated[float, Within(0.0, 10.0)] = 0.15
    interest_m: Annotated[float, Within(0.0, 10.0)] = 0.45
    reach_m: Annotated[float, Within(0.0, 100.0)] = 1.0
    min_line_share: float = 0.7
    min_wall_m: Annotated[float, Within(0.0, 10.0)] = 0.15
    max_features: Annotated[int, Within(1, 10_000)] = 300
    turn_tolerance_rad: float = math.radians(3.0)
    max_models: Annotated[int, Within(1, 1_000)] = 12
    icp_reject_m: tuple[Annotated[float, Within(0.001, 1000.0)], ...] = (0.6, 0.3)
    icp_iterations: Annotated[int, Within(0, 10_000)] = 30
    max_side_cells: Annotated[int, Within(1, 10_000)] = 1500
    ransac: RansacConfig = field(default_factory=RansacConfig)


@dataclass(frozen=True, slots=True)
class ExistingConfig(Settings):
    """The method that the paper compares with (section 4.1): SIFT on the map as it is.

    Parameters
    ----------
    max_features
        Features used of each map, the strongest.
    max_side_cells
        Maps with more cells a side are worked on at a coarser resolution.
    """

    max_features: Annotated[int, Within(1, 10_000)] = 1000
    max_side_cells: Annotated[int, Within(1, 10_000)] = 1500
    ransac: RansacConfig = RansacConfig(inlier_m=0.1)
