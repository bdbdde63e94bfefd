"""All that is known after a step of the merger."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from mapmerge.grid import Grid
from mapmerge.match import Match
from mapmerge.outcome import Change, Pair, RobotOutcome, Status
from mapmerge.prior import Prior
from mapmerge.reasons import Reason, ReasonCode
from mapmerge.sim2 import Sim2
from mapmerge.watch import Trigger


@dataclass(frozen=True, slots=True, eq=False)
class MergeResult:
    """All that is known after a step.

    Parameters
    ----------
    robots
        Outcome of each robot, in the order given, the reference first.
    grids
        Latest map of each robot that sent one.
    pairs
        Latest match of each pair of robots with maps, target first.
    priors
        What was believed of each of these pairs when it was matched; pairs of which nothing was are left out.
    searched
        Which pairs were searched in this step, and why; the placements of the others were followed, or kept.
    merged
        The fused map, in the merged frame, which is the reference's map frame; None until the reference has a map. The
        very same grid as in the last result if none of its cells changed.
    updated
        Robots whose map changed in this step.
    changes
        What jumped, or was placed, moved or withdrawn in this step.
    centres_m
        Of each robot with a map, the middle of the rectangle around what it knows, in its map frame.
    """

    robots: Mapping[str, RobotOutcome]
    grids: Mapping[str, Grid]
    pairs: Mapping[Pair, Match]
    priors: Mapping[Pair, Prior]
    searched: Mapping[Pair, Trigger]
    merged: Grid | None
    updated: tuple[str, ...]
    changes: tuple[Change, ...]
    centres_m: Mapping[str, tuple[float, float]]

    @property
    def poses(self) -> dict[str, Sim2]:
        """Where the map frame of each robot that is placed lies in the merged frame; the reference's is there, too."""
        placed = {robot: outcome.merged_from_map for robot, outcome in self.robots.items()}
        return {robot: pose for robot, pose in placed.items() if pose is not None}

    def __str__(self) -> str:
        """Return a line for each robot: what became of its map, where it lies, and why."""
        return "\n".join(f"{robot}: {outcome}" for robot, outcome in self.robots.items())

    def __repr__(self) -> str:
        """Return the robots and what became of them; the maps would fill the screen."""
        statuses = ", ".join(f"{robot}: {outcome.status}" for robot, outcome in self.robots.items())
        return f"<MergeResult {statuses}>"


def nothing_known(robots: Sequence[str]) -> MergeResult:
    """Return what is known of robots before any map came."""
    waiting = Reason(ReasonCode.NO_MAP, "no map that shows anything yet")
    outcomes = {robot: RobotOutcome(Status.NO_MAP, waiting) for robot in robots}
    return MergeResult(outcomes, {}, {}, {}, {}, None, (), (), {})
