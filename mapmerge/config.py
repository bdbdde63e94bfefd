"""Settings of the merger, validated, in the units of their names."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Annotated, Literal

from mapmerge.errors import ConfigError
from mapmerge.match_config import RefineConfig, SearchConfig, SlackConfig
from mapmerge.paper.config import ExistingConfig, PaperConfig, RansacConfig
from mapmerge.settings import Above, Settings, Within

__all__ = [
    "CellConfig",
    "ExistingConfig",
    "MergeConfig",
    "PaperConfig",
    "RansacConfig",
    "RefineConfig",
    "ScaleChoice",
    "SearchConfig",
    "SlackConfig",
    "VerifyConfig",
    "WatchConfig",
]

ScaleChoice = Literal["metadata", "free"]

HIGHEST_CONFIDENCE = 0.9999
"""No placement is called surer: what is seldomer than 1 in 10 000 was not measured."""


@dataclass(frozen=True, slots=True)
class CellConfig(Settings):
    """When a cell counts as occupied or free (paper, equation 1).

    Parameters
    ----------
    p_occupied
        Least probability of being occupied at which a cell is a wall.
    p_free
        Largest one at which it is free; what lies between is neither.
    """

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
class VerifyConfig(Settings):
    """What a placement must pass to be accepted.

    Parameters
    ----------
    tolerance_m
        A wall is matched by a wall at most this far away.
    near_m
        A wall that is not matched, in free space, but this near to a wall, may be bent or moved; one farther off is a
        contradiction.
    violation_weight, free_weight
        Score of a placement in metres: matched wall − `violation_weight` × metres of wall in the other's free space
        + `free_weight` × m² of agreeing free space.
    min_overlap_m2
        Least area that both maps know.
    min_matched_wall_m
        Least length of wall that both maps saw.
    min_acceptance
        Least acceptance index ω; of the methods that state no confidence.
    least_agreement
        Least share of the walls in the overlap that must agree, however sure a placement is otherwise.
    poor_agreement, rival_likelihood
        What is named as the reason where the confidence is too low: walls that disagree, if less than this share
        of them agrees; else ambiguity, if a rival is more than so many times as likely. A placement within a prior is
        refused if it is less than so many times as likely as one elsewhere.
    min_confidence
        Least calibrated probability that the placement is right, where the method states one.
    witness_confidence, nearly_sure_confidence
        Two matches that agree on a placement count together if the confidence of each is at least the first, and that
        of one of them the second.
    hopeful_confidence
        Merged maps of several robots are matched with another robot's if the confidence of any pair of them, which is
        too low by itself, is at least this.
    distinct_m, distinct_rad
        Placements that differ by more than one of these are rivals, not the same.
    """

    tolerance_m: Annotated[float, Within(0.0, 20.0)] = 0.15
    near_m: Annotated[float, Within(0.0, 20.0)] = 0.5
    violation_weight: float = 2.5
    free_weight: float = 0.15
    min_overlap_m2: float = 6.0
    min_matched_wall_m: float = 8.0
    min_acceptance: float = 0.95
    least_agreement: float = 0.7
    poor_agreement: float = 0.8
    rival_likelihood: float = 0.05
    min_confidence: Annotated[float, Above(0.0, 1.0)] = 0.92
    witness_confidence: float = 0.8
    nearly_sure_confidence: float = 0.9
    hopeful_confidence: float = 0.05
    distinct_m: float = 0.75
    distinct_rad: float = math.radians(5.0)


@dataclass(frozen=True, slots=True)
class WatchConfig(Settings):
    """When placements are searched anew, instead of being followed from one update to the next.

    Parameters
    ----------
    overlap_growth
        A placement is searched anew once its maps share so many times as much as at the last search.
    map_growth
        Or once one of them knows so many times as much, or after `longest_search_wait` updates.
    agreement_drop
        Or once the share of the walls that agree has fallen by this.
    likeness_rise
        Or once the score of its best rival, as a share of its own, has risen by this.
    glance_growth, longest_glance_wait
        Maps without a placement are glanced at, to tell whether a search may find one, once one of them knows so many
        times as much as at the last glance, or after 1, 2, 4, … updates, at most so many.
    search_growth, longest_search_wait
        They are searched, whatever a glance says, once one of them knows so many times as much as at the last search,
        or after so many updates.
    hopeful_odds
        A glance is hopeful if it finds a placement that is by itself at least so many times as likely as none.
    hold_cells
        A placement is kept as it is as long as aligning it anew moves the walls by no more, root mean square.
    jump_share
        A map jumped if more than this share of its walls, and `VerifyConfig.min_matched_wall_m`, contradict what it was
        before.
    least_kept_share
        Or if it still knows less than this share of what it knew before.
    """

    overlap_growth: float = 1.5
    map_growth: float = 1.5
    agreement_drop: float = 0.05
    likeness_rise: float = 0.1
    glance_growth: float = 1.15
    longest_glance_wait: int = 16
    search_growth: float = 3.0
    longest_search_wait: int = 100
    hopeful_odds: float = 0.05
    hold_cells: float = 0.5
    jump_share: float = 0.05
    least_kept_share: float = 0.5


@dataclass(frozen=True, slots=True)
class MergeConfig(Settings):
    """All settings of the merger.

    Parameters
    ----------
    method
        How two maps are matched: ``correlation``, ``existing`` or ``paper``; a name of `mapmerge.match.MATCHERS`.
    scale
        Whether the maps' resolutions are believed (``metadata``: placements are rigid) or the ratio of their true
        resolutions is estimated as well (``free``).
    scale_range
        Least and largest factor by which the ratio of resolutions may be wrong, with ``free``.
    max_canvas_cells
        A placement at which the merged map would have more cells is refused: maps of few cells may lie far apart, or
        have cells of very different sizes.
    moved_m, moved_rad
        A placement that changed by more than one of these since it was last reported has moved.
    """

    method: str = "correlation"
    scale: ScaleChoice = "metadata"
    scale_range: tuple[Annotated[float, Within(0.01, 100.0)], Annotated[float, Within(0.01, 100.0)]] = (0.4, 2.5)
    cells: CellConfig = field(default_factory=CellConfig)
    search: SearchConfig = field(default_factory=SearchConfig)
    refine: RefineConfig = field(default_factory=RefineConfig)
    slack: SlackConfig = field(default_factory=SlackConfig)
    verify: VerifyConfig = field(default_factory=VerifyConfig)
    watch: WatchConfig = field(default_factory=WatchConfig)
    paper: PaperConfig = field(default_factory=PaperConfig)
    existing: ExistingConfig = field(default_factory=ExistingConfig)
    max_canvas_cells: int = 1_000_000_000
    moved_m: float = 0.10
    moved_rad: float = math.radians(0.5)

    def __post_init__(self) -> None:
        super(MergeConfig, self).__post_init__()
        least, largest = self.scale_range
        if not least <= largest:
            raise ConfigError(f"scale_range is {self.scale_range}; expected the smaller factor first")
        most = HIGHEST_CONFIDENCE / (HIGHEST_CONFIDENCE + self.tries * (1.0 - HIGHEST_CONFIDENCE))
        if self.verify.min_confidence > most + 1e-9:
            limit = math.floor(most * 1e4 + 1e-6) / 1e4
            raise ConfigError(
                f"min_confidence is {self.verify.min_confidence}; expected at most {limit}: "
                f"where the scale is {self.scale}, no placement is called surer"
            )

    @property
    def tries(self) -> float:
        """Among how many independent searches a placement is the best: one, or one for each scale that differs."""
        least, largest = self.scale_range
        if self.scale == "metadata":
            return 1.0
        return 1.0 + math.log(largest / least) / self.search.distinct_scale
