"""When a pair of maps is searched anew, and when it suffices to look whether its placement still holds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import StrEnum

from mapmerge.config import WatchConfig
from mapmerge.match import Match


class Trigger(StrEnum):
    """Why a pair was searched: a closed list."""

    FIRST = "first"
    """Both maps are there for the first time."""
    CHANGED = "changed"
    """A map changed, and the method cannot follow a placement."""
    OVERLAP_GREW = "overlap_grew"
    """The maps share much more than when they were searched last."""
    WEAKENED = "weakened"
    """The placement does not hold as well as it did."""
    RIVAL_GAINED = "rival_gained"
    """Another placement has come nearer to it."""
    MAP_JUMPED = "map_jumped"
    """A map disagrees with what it was before."""
    PRIOR_CHANGED = "prior_changed"
    """What is believed of the placement changed."""
    RETRY = "retry"
    """There was no placement yet, and the maps have grown or changed often enough since."""
    END = "end"
    """The last maps are there."""

    @property
    def words(self) -> str:
        """What to say of it, fit for "searched anew, as ..."."""
        return _WORDS[self]


_WORDS: Mapping[Trigger, str] = {
    Trigger.FIRST: "both maps are there for the first time",
    Trigger.CHANGED: "a map changed",
    Trigger.OVERLAP_GREW: "the maps share much more than before",
    Trigger.WEAKENED: "the placement did not hold as well any more",
    Trigger.RIVAL_GAINED: "another placement came nearer to it",
    Trigger.MAP_JUMPED: "a map jumped in its own frame",
    Trigger.PRIOR_CHANGED: "what is believed of it changed",
    Trigger.RETRY: "the maps have changed since the last try",
    Trigger.END: "these are the last maps",
}


@dataclass(frozen=True, slots=True)
class Watch:
    """What was known of two sets of maps when they were searched last, and what happened since.

    Parameters
    ----------
    areas_m2
        What either knew.
    overlap_m2, agreement, likeness
        Of the placement that was accepted then: what it shared, the share of the walls that agreed, and the score of
        the best rival over its own; 0 without a placement, or a rival.
    wait
        After how many updates without a placement the next search is due at the latest.
    waited
        Updates since.
    """

    areas_m2: tuple[float, float]
    overlap_m2: float = 0.0
    agreement: float = 0.0
    likeness: float = 0.0
    wait: int = 1
    waited: int = 0

    @staticmethod
    def of(match: Match, areas_m2: tuple[float, float], before: Watch | None, config: WatchConfig) -> Watch:
        """Return the watch over a pair that was just searched: without a placement, the next wait is twice as long."""
        if match.accepted and match.scores is not None:
            return Watch(areas_m2, match.scores.overlap_m2, match.scores.wall_agreement, match.likeness)
        return Watch(areas_m2, wait=1 if before is None else min(2 * before.wait, config.longest_wait))

    def updated(self) -> Watch:
        """Return the watch after an update of one of the maps, or of both."""
        return replace(self, waited=self.waited + 1)

    def is_retry_due(self, areas_m2: tuple[float, float], config: WatchConfig) -> bool:
        """Tell whether maps without a placement are due: they have grown, or changed so often that it may be enough."""
        grown = any(now > config.area_growth * then for now, then in zip(areas_m2, self.areas_m2, strict=True))
        return self.waited >= self.wait or (grown and self.waited > 0)

    def doubts(self, match: Match, config: WatchConfig) -> Trigger | None:
        """Return why a placement that was followed should be searched anew; None if it holds."""
        if not match.accepted or match.scores is None:
            return Trigger.WEAKENED
        if match.scores.wall_agreement < self.agreement - config.agreement_drop:
            return Trigger.WEAKENED
        if match.likeness > self.likeness + config.likeness_rise:
            return Trigger.RIVAL_GAINED
        if match.scores.overlap_m2 >= config.overlap_growth * self.overlap_m2:
            return Trigger.OVERLAP_GREW
        return None
