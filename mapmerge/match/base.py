"""What every matcher offers and returns."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Protocol, TypeVar

from mapmerge.config import MergeConfig
from mapmerge.evidence import Evidence
from mapmerge.grid import Grid
from mapmerge.match.cues import Cues, Fit
from mapmerge.prior import Prior
from mapmerge.reasons import Reason
from mapmerge.sim2 import Sim2
from mapmerge.verify import Scores

PreparedT = TypeVar("PreparedT")


@dataclass(frozen=True, slots=True)
class Rival:
    """Another placement of the same pair, distinct from the best one.

    Parameters
    ----------
    target_from_source
        Where it would put the source's map frame in the target's.
    score_m
        Its score, to be compared with `Scores.score_m` of the match.
    likelihood
        How many times as likely as the best placement it is by itself; None where the method states no confidence.
    fit
        The figures that its likelihood was computed from.
    """

    target_from_source: Sim2
    score_m: float
    likelihood: float | None = None
    fit: Fit | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Match:
    """The outcome for a pair of maps, refused or not.

    Parameters
    ----------
    target_from_source
        Best placement found, between the two map frames; None if there was none.
    scores
        Its figures; None if there was no placement.
    accepted
        Whether it passed every test.
    reason
        What decided.
    confidence
        Calibrated probability that the placement is right; None where the method states none.
    cues
        The figures that the confidence was computed from.
    weight
        How far the match is trusted against those of other pairs, where the method has a measure of its own; None:
        by its score.
    rivals
        Distinct placements of the same pair: the likeliest first, but those that share too little last; by their score
        where the method does not tell how likely they are.
    evidence
        What each step of the matcher saw, in order, if it cannot be told afterwards: see `Matcher.explain`.
    """

    target_from_source: Sim2 | None
    scores: Scores | None
    accepted: bool
    reason: Reason
    confidence: float | None = None
    cues: Cues | None = None
    weight: float | None = None
    rivals: tuple[Rival, ...] = ()
    evidence: tuple[Evidence, ...] = ()

    @property
    def trust(self) -> float:
        """What the placement of all robots weighs this match by."""
        if self.weight is not None:
            return self.weight
        return self.scores.score_m if self.scores is not None else 0.0

    @property
    def likeness(self) -> float:
        """Score of the best rival over that of the placement; 0 without a rival, more than 1 if it has a larger one."""
        if self.scores is None or self.scores.score_m <= 0.0:
            return math.inf
        best_m = max((rival.score_m for rival in self.rivals), default=0.0)
        return max(0.0, best_m / self.scores.score_m)

    def inverse(self) -> Match:
        """Return the match of the same maps, swapped; its evidence must be told afterwards."""
        pose = self.target_from_source
        return replace(
            self,
            target_from_source=None if pose is None else pose.inverse(),
            rivals=tuple(
                replace(rival, target_from_source=rival.target_from_source.inverse()) for rival in self.rivals
            ),
        )


class Matcher(Protocol[PreparedT]):
    """A method that finds where one map lies on another.

    A matcher has no state: what it computes for one map alone is returned by `prepare` and kept by the caller. One that
    can neither keep that up to date nor follow a placement inherits what is here.
    """

    def prepare(self, grid: Grid, resolution_m: float, config: MergeConfig) -> PreparedT:
        """Return all that depends on one map only, at a resolution that is not finer than the map's own."""
        ...

    def match(self, target: PreparedT, source: PreparedT, config: MergeConfig, prior: Prior | None = None) -> Match:
        """Return where the source's map lies in the target's map frame, or why that cannot be said.

        With a prior only placements within it are accepted.
        """
        ...

    def update(self, prepared: PreparedT, grid: Grid, resolution_m: float, config: MergeConfig) -> PreparedT:
        """Return what `prepare` or this returned for a map, brought up to date; what is given is used up."""
        del prepared
        return self.prepare(grid, resolution_m, config)

    def renewed(self, prepared: PreparedT) -> PreparedT:
        """Return what `prepare` would return for the map, up to rounding; what is given is used up."""
        return prepared

    def is_hopeful(self, target: PreparedT, source: PreparedT, config: MergeConfig) -> bool:
        """Tell whether a search of maps without a placement may find one now: cheaper than the search, and no proof."""
        del target, source, config
        return True

    def follow(
        self, target: PreparedT, source: PreparedT, known: Match, config: MergeConfig, prior: Prior | None = None
    ) -> Match | None:
        """Return how a placement that was accepted fits the maps as they are now; None if this cannot tell.

        It is cheap, looks nowhere else, and may find that the placement must be refused.
        """
        del target, source, known, config, prior
        return None

    def explain(self, target: PreparedT, source: PreparedT, match: Match, config: MergeConfig) -> tuple[Evidence, ...]:
        """Return what each step saw of a match of these maps, in order, for pictures of it."""
        del target, source, config
        return match.evidence
