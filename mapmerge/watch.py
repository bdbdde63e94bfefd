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
    """A map changed, or moved within merged maps, and the placement cannot be followed."""
    OVERLAP_GREW = "overlap_grew"
    """The maps share much more than when they were searched last."""
    MAPS_GREW = "maps_grew"
    """One of the maps knows much more than when they were searched last."""
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
    Trigger.MAPS_GREW: "one of the maps shows much more than before",
    Trigger.WEAKENED: "the placement did not hold as well any more",
    Trigger.RIVAL_GAINED: "another placement came nearer to it",
    Trigger.MAP_JUMPED: "a map jumped in its own frame",
    Trigger.PRIOR_CHANGED: "what is believed of it changed",
    Trigger.RETRY: "the maps have changed since the last try",
    Trigger.END: "these are the last maps",
}


@dataclass(frozen=True, slots=True)
class Since:
    """What two sets of maps knew when they were looked at, and how often they changed since.

    Parameters
    ----------
    areas_m2
        What either knew then.
    updates
        How often they have changed since.
    """

    areas_m2: tuple[float, float]
    updates: int = 0

    def is_due(self, areas_m2: tuple[float, float], growth: float, wait: int) -> bool:
        """Tell whether one of the maps has grown so many times since, or so many updates have come."""
        grown = any(now > growth * then for now, then in zip(areas_m2, self.areas_m2, strict=True))
        return self.updates >= wait or (grown and self.updates > 0)


@dataclass(frozen=True, slots=True)
class Watch:
    """What was known of two sets of maps when they were searched last, and what happened since.

    Parameters
    ----------
    searched, glanced
        When they were searched, and when that was last considered.
    wait
        After how many updates without a placement the next glance is due at the latest.
    overlap_m2, agreement, likeness
        Of the placement that was accepted then: what it shared, the share of the walls that agreed, and the score of
        the best rival over its own; 0 without a placement, or a rival.
    """

    searched: Since
    glanced: Since
    wait: int = 1
    overlap_m2: float = 0.0
    agreement: float = 0.0
    likeness: float = 0.0

    @staticmethod
    def of(match: Match, areas_m2: tuple[float, float], before: Watch | None, config: WatchConfig) -> Watch:
        """Return the watch over maps that were just searched, given the watch over them before that, if it goes on."""
        now = Since(areas_m2)
        if match.accepted and match.scores is not None:
            scores = match.scores
            return Watch(now, now, 1, scores.overlap_m2, scores.wall_agreement, match.likeness)
        was_placed = before is not None and before.overlap_m2 > 0.0
        return Watch(now, now, 1 if before is None or was_placed else before.next_wait(config))

    def next_wait(self, config: WatchConfig) -> int:
        """Return how long to wait after nothing was found once more: twice as long."""
        return min(2 * self.wait, config.longest_glance_wait)

    def updated(self) -> Watch:
        """Return the watch after an update of the maps."""
        searched, glanced = (replace(since, updates=since.updates + 1) for since in (self.searched, self.glanced))
        return replace(self, searched=searched, glanced=glanced)

    def after_glance(self, areas_m2: tuple[float, float], config: WatchConfig) -> Watch:
        """Return the watch after a glance that had no hope."""
        return replace(self, glanced=Since(areas_m2), wait=self.next_wait(config))

    def is_glance_due(self, areas_m2: tuple[float, float], config: WatchConfig) -> bool:
        """Tell whether maps without a placement have changed enough to be glanced at."""
        return self.glanced.is_due(areas_m2, config.glance_growth, self.wait)

    def is_search_due(self, areas_m2: tuple[float, float], config: WatchConfig) -> bool:
        """Tell whether maps without a placement have changed so much that they are searched whatever a glance says."""
        return self.searched.is_due(areas_m2, config.search_growth, config.longest_search_wait)

    def doubts(self, match: Match, areas_m2: tuple[float, float], config: WatchConfig) -> Trigger | None:
        """Return why a placement that was followed should be searched anew; None if it holds.

        What the maps show elsewhere may tell that they belong together there, though nothing changes where they are.
        """
        if not match.accepted or match.scores is None:
            return Trigger.WEAKENED
        if match.scores.wall_agreement < self.agreement - config.agreement_drop:
            return Trigger.WEAKENED
        if match.likeness > self.likeness + config.likeness_rise:
            return Trigger.RIVAL_GAINED
        if match.scores.overlap_m2 >= config.overlap_growth * self.overlap_m2:
            return Trigger.OVERLAP_GREW
        if self.searched.is_due(areas_m2, config.map_growth, config.longest_search_wait):
            return Trigger.MAPS_GREW
        return None
