"""What became of each robot's map, and how that changed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

from mapmerge.config import MergeConfig
from mapmerge.fuse import Agreement, Fusion
from mapmerge.graph import Forest, Placement
from mapmerge.match import Match
from mapmerge.reasons import Reason, ReasonCode
from mapmerge.sim2 import IDENTITY, Sim2
from mapmerge.warp import Layer
from mapmerge.watch import Trigger

Pair = tuple[str, str]


class Status(StrEnum):
    """What became of a robot's map."""

    REFERENCE = "reference"
    MERGED = "merged"
    UNMERGED = "unmerged"
    NO_MAP = "no_map"


class ChangeKind(StrEnum):
    """How a robot's map or its placement changed."""

    PLACED = "placed"
    MOVED = "moved"
    WITHDRAWN = "withdrawn"
    JUMPED = "jumped"


@dataclass(frozen=True, slots=True)
class Change:
    """A robot's map jumped, or was placed, moved or withdrawn.

    Parameters
    ----------
    reason
        What is known of its placement now or, if its map jumped, how.
    trigger
        Why the pair was searched that placed it or, if it is withdrawn, that did so before; None if it was not, as when
        a placement is followed or hangs on that of another robot.
    """

    robot: str
    kind: ChangeKind
    reason: Reason
    trigger: Trigger | None = None


@dataclass(frozen=True, slots=True)
class Looked:
    """What was done in a step.

    Parameters
    ----------
    searched
        Which pairs were searched, and why.
    jumped
        Robots whose map jumped, and how.
    shown_before
        The pair that each robot was judged by before.
    """

    searched: Mapping[Pair, Trigger]
    jumped: Mapping[str, Reason]
    shown_before: Mapping[str, Pair | None]


@dataclass(frozen=True, slots=True)
class RobotOutcome:
    """What is known of one robot's map.

    Parameters
    ----------
    status, reason
        What became of it, and why.
    merged_from_map
        Where its map frame lies in the merged frame; None if it is not placed.
    agreement
        Of a placed map with all other placed maps; of one that is not placed, that of its best refused candidate.
    placement
        Its place in its component; None without a map.
    shown_pair
        The match that placed it or, if it is not placed, its best refused one.
    confidence
        Probability that it is placed rightly, through all matches that place it; of one that is not placed, that its
        best refused candidate is right. None where the method states none.
    """

    status: Status
    reason: Reason
    merged_from_map: Sim2 | None = None
    agreement: Agreement | None = None
    placement: Placement | None = None
    shown_pair: Pair | None = None
    confidence: float | None = None

    def __str__(self) -> str:
        """Return what became of it, where it lies, and why."""
        at = "" if self.merged_from_map is None else f" at {self.merged_from_map}"
        return f"{self.status}{at}: {self.reason.message}"


def outcomes_of(
    robots: Sequence[str],
    pairs: Mapping[Pair, Match],
    forest: Forest,
    layers: Mapping[str, Layer],
    fusion: Fusion | None,
) -> dict[str, RobotOutcome]:
    """Return what is known of each robot.

    Parameters
    ----------
    robots
        In order, the reference first.
    pairs
        All matches, target first.
    forest
        Placements of the robots that have a map.
    layers, fusion
        The maps that are linked to the reference, and what was fused of them; nothing and None until it has a map.
    """
    agreements = dict(zip(layers, fusion.agreements, strict=True)) if fusion else {}
    outcomes: dict[str, RobotOutcome] = {}
    for robot in robots:
        placement = forest.placements.get(robot)
        if placement is None:
            outcomes[robot] = RobotOutcome(Status.NO_MAP, Reason(ReasonCode.NO_MAP, "no map that shows anything yet"))
        elif robot in layers:
            confidence = _confidence(robot, forest, pairs)
            outcomes[robot] = _placed_outcome(robot, placement, pairs, agreements[robot], confidence)
        else:
            outcomes[robot] = _unplaced_outcome(robots[0], robot, placement, pairs, has_reference=bool(layers))
    return outcomes


def _placed_outcome(
    robot: str, placement: Placement, pairs: Mapping[Pair, Match], agreement: Agreement, confidence: float | None
) -> RobotOutcome:
    if placement.via is None:
        reason = Reason(ReasonCode.REFERENCE, "its map frame is the merged frame")
        return RobotOutcome(Status.REFERENCE, reason, IDENTITY, agreement, placement)
    pair = _pair_of(robot, placement.via, pairs)
    match = pairs[pair]
    reason = Reason(match.reason.code, f"placed on {placement.via}: {match.reason.message}")
    return RobotOutcome(Status.MERGED, reason, placement.component_from_map, agreement, placement, pair, confidence)


def _pair_of(robot: str, other: str, pairs: Mapping[Pair, Match]) -> Pair:
    return (robot, other) if (robot, other) in pairs else (other, robot)


def _confidence(robot: str, forest: Forest, pairs: Mapping[Pair, Match]) -> float | None:
    """Return how likely all matches are right that place a robot, one on the other, up to the reference.

    None for the reference itself, and if one of the matches states no confidence.
    """
    confidence: float | None = None
    via = forest.placements[robot].via
    while via is not None:
        link = pairs[_pair_of(robot, via, pairs)].confidence
        if link is None:
            return None
        confidence = link if confidence is None else confidence * link
        robot, via = via, forest.placements[via].via
    return confidence


def _unplaced_outcome(
    reference: str, robot: str, placement: Placement, pairs: Mapping[Pair, Match], *, has_reference: bool
) -> RobotOutcome:
    pair = _best_refused(reference, robot, pairs)
    match = pairs[pair] if pair else None
    scores = match.scores if match else None
    agreement = Agreement(scores.acceptance, scores.overlap_m2, scores.overlap_fraction) if scores else None
    if not has_reference:
        reason = Reason(ReasonCode.NO_REFERENCE_MAP, f"the reference {reference} has no map yet")
    elif any(match.accepted for pair, match in pairs.items() if robot in pair):
        message = f"its map fits that of {_partner(robot, pairs)}, but neither is linked to the reference {reference}"
        if pair is not None:
            message += f"; not placed on {pair[0] if pair[1] == robot else pair[1]}: {pairs[pair].reason.message}"
        reason = Reason(ReasonCode.OTHER_COMPONENT, message)
    elif match is None or pair is None:
        reason = Reason(ReasonCode.NO_CANDIDATE, "there is no other map to be placed on")
    else:
        other = pair[0] if pair[1] == robot else pair[1]
        reason = Reason(match.reason.code, f"not placed on {other}: {match.reason.message}")
    confidence = match.confidence if match else None
    return RobotOutcome(Status.UNMERGED, reason, None, agreement, placement, pair, confidence)


def _partner(robot: str, pairs: Mapping[Pair, Match]) -> str:
    return next(a if b == robot else b for (a, b), match in pairs.items() if match.accepted and robot in (a, b))


def _best_refused(reference: str, robot: str, pairs: Mapping[Pair, Match]) -> Pair | None:
    """Return the refused pair of this robot that says most.

    That is one whose maps contradict what was believed, for there somebody was wrong; else one whose maps have ground
    in common, the surest, the one with the highest score, the reference before others.
    """

    def rank(pair: Pair) -> tuple[bool, bool, float, float, bool]:
        match = pairs[pair]
        return (
            match.reason.code is ReasonCode.PRIOR_CONTRADICTED,
            match.scores is not None and match.reason.code is not ReasonCode.TOO_LITTLE_OVERLAP,
            round(match.confidence or 0.0, 2),
            match.scores.score_m if match.scores else float("-inf"),
            reference in pair,
        )

    refused = [pair for pair, match in pairs.items() if robot in pair and not match.accepted]
    return max(refused, key=rank, default=None)


def changes_of(
    outcomes: Mapping[str, RobotOutcome],
    reported: Mapping[str, Sim2],
    centres_m: Mapping[str, tuple[float, float]],
    looked: Looked,
    config: MergeConfig,
) -> tuple[tuple[Change, ...], dict[str, Sim2]]:
    """Compare the placements with those reported last.

    Returns
    -------
    changes, reported
        What jumped, or was placed, moved or withdrawn, and the placements as they are reported now.
    """
    changes: list[Change] = []
    now: dict[str, Sim2] = {}
    for robot, outcome in outcomes.items():
        if robot in looked.jumped:
            changes.append(Change(robot, ChangeKind.JUMPED, looked.jumped[robot]))
        pose, before = outcome.merged_from_map, reported.get(robot)
        if outcome.status is Status.REFERENCE:
            continue
        if pose is None:
            if before is not None:
                trigger = _trigger(looked, looked.shown_before.get(robot), outcome.shown_pair)
                changes.append(Change(robot, ChangeKind.WITHDRAWN, outcome.reason, trigger))
            continue
        now[robot] = pose
        trigger = _trigger(looked, outcome.shown_pair)
        if before is None:
            changes.append(Change(robot, ChangeKind.PLACED, outcome.reason, trigger))
        elif pose.is_close(before, distance_m=config.moved_m, angle_rad=config.moved_rad, at_m=centres_m[robot]):
            now[robot] = before
        else:
            changes.append(Change(robot, ChangeKind.MOVED, outcome.reason, trigger))
    return tuple(changes), now


def _trigger(looked: Looked, *pairs: Pair | None) -> Trigger | None:
    """Return why the first of some pairs that was searched was."""
    return next((looked.searched[pair] for pair in pairs if pair is not None and pair in looked.searched), None)
