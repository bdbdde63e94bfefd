"""The report: what became of each robot's map and why, as plain JSON values.

Numbers are rounded to micrometres and nanoradians, far below what any map can tell, so that reports read well. A map
may lie thousands of kilometres from the origin of its frame, where a microradian is metres.
What is absent is None. Nothing in a report depends on the machine or on the time of day.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict
from typing import Any

from mapmerge.fuse import Agreement
from mapmerge.match import Match
from mapmerge.outcome import ChangeKind, Pair
from mapmerge.prior import Prior
from mapmerge.reasons import Reason, ReasonCode
from mapmerge.result import MergeResult
from mapmerge.sim2 import Sim2, wrap_angle
from replay.events import SCHEMA, Noted, Report, RobotInput, Skipped
from replay.sources.losses import Listing

_DIGITS = 6
_TURN_DIGITS = 9
_MAX_YAW_RAD = 3.141592653  # rounded up, π would lie outside (−π, π]

Json = dict[str, Any]


class ReportBuilder:
    """Folds a run into its report.

    Parameters
    ----------
    robots
        The run's robots, the reference first.
    settings
        Settings that affect results.
    version
        Of this program.
    """

    def __init__(self, robots: Sequence[RobotInput], settings: Mapping[str, Any], version: str) -> None:
        self._robots = robots
        self._settings = settings
        self._version = version
        self._updates: Counter[str] = Counter()
        self._skipped: Counter[str] = Counter()
        self._places: dict[tuple[str, str, str, str], Json] = {}
        self._listing = Listing()
        self._first_merged_ns: dict[str, int] = {}
        self._history: list[Json] = []
        self._told = 0
        self._notes: list[Json] = []
        self._priors: Mapping[str, Prior] = {}
        self._searched: dict[Pair, Json] = {}
        self._refused: dict[str, Counter[str]] = {}
        self._damaged: set[str] = set()
        self._first_ns: int | None = None

    def skip(self, event: Skipped) -> None:
        """Count a message, or a part of a recording, that was not used."""
        self._blame(event)
        self._skipped[event.cause] += _at_least(event)
        topic, place = self._listing.at((event.cause, event.input), event.topic, event.place)
        key = str(event.cause), event.input, topic, place
        there = self._places.setdefault(
            key,
            {
                "cause": key[0],
                "input": event.input,
                "topic": topic,
                "place": place,
                "messages": 0,
                "first_log_time_ns": event.log_time_ns,
                "detail": event.detail,
            },
        )
        known = there["messages"] is not None and event.messages is not None
        there["messages"] = there["messages"] + event.messages if known else None

    def note(self, event: Noted) -> None:
        """Keep what a reader should know."""
        self._notes.append({"robot": event.robot, "message": event.message})

    def take(self, stamp_ns: int, result: MergeResult, priors: Mapping[str, Prior] | None = None) -> None:
        """Take in what a tick brought, and what was believed of the robots' places before it."""
        self._first_ns = stamp_ns if self._first_ns is None else self._first_ns
        self._priors = priors or {}
        self._told = len(self._history)
        self._updates.update(result.updated)
        for change in result.changes:
            outcome = result.robots[change.robot]
            if change.kind is ChangeKind.PLACED:
                self._first_merged_ns.setdefault(change.robot, stamp_ns)
            self._history.append(
                {
                    "stamp_ns": stamp_ns,
                    "robot": change.robot,
                    "event": str(change.kind),
                    "reason": _reason(change.reason),
                    "trigger": None if change.trigger is None else str(change.trigger),
                    "placed_via": outcome.placement.via if outcome.placement else None,
                    "merged_from_map": _pose(outcome.merged_from_map),
                }
            )
        for pair, trigger in result.searched.items():
            self._searched[pair] = {"stamp_ns": stamp_ns, "trigger": str(trigger)}

    def build(
        self, stamp_ns: int | None, result: MergeResult, inputs: Sequence[Mapping[str, Any]], *, is_last: bool = False
    ) -> Report:
        """Return the report as of now.

        Its history is that of the last tick, for with all of it the reports of a run would grow with the square of its
        ticks; with ``is_last`` it is all of it.
        """
        names = [str(item["name"]) for item in inputs]
        told = 0 if is_last else self._told
        return {
            "schema": SCHEMA,
            "version": self._version,
            "first_stamp_ns": self._first_ns,
            "stamp_ns": stamp_ns,
            "reference": self._robots[0].robot,
            "robots": {
                item.robot: self._robot(item, result, [names[index] for index in item.inputs]) for item in self._robots
            },
            "pairs": [
                {**_pair(pair, match, result.priors.get(pair)), "searched": self._searched.get(pair)}
                for pair, match in result.pairs.items()
            ],
            "history": self._history[told:],
            "history_before": told,
            "notes": list(self._notes),
            "updates": self._updates.total(),
            "skipped": dict(sorted((+self._skipped).items())),
            "skipped_at": [dict(item) for item in self._places.values()],
            "inputs": [dict(item) for item in inputs],
            "settings": dict(self._settings),
        }

    def _blame(self, event: Skipped) -> None:
        """Keep what may be why a robot has no map."""
        if event.messages == 0:
            return
        if event.robot:
            self._refused.setdefault(event.robot, Counter())[event.cause] += _at_least(event)
        elif event.place and not event.topic:
            self._damaged.add(event.input)

    def _why(self, robot: str, reason: Reason, recordings: Collection[str]) -> Reason:
        """Return the reason; of a robot without a map, with what became of its messages, which no merger knows."""
        if reason.code is not ReasonCode.NO_MAP:
            return reason
        if robot in self._refused:
            causes = ", ".join(f"{count} {cause}" for cause, count in sorted(self._refused[robot].items()))
            return Reason(reason.code, f"no map that can be used yet, and messages are skipped: {causes}")
        if self._damaged & set(recordings):
            return Reason(reason.code, "no map that can be used yet, and parts of the recording are lost")
        return reason

    def _robot(self, item: RobotInput, result: MergeResult, recordings: Collection[str]) -> Json:
        outcome, centre_m = result.robots[item.robot], result.centres_m.get(item.robot)
        placement = outcome.placement
        return {
            "status": str(outcome.status),
            "reason": _reason(self._why(item.robot, outcome.reason, recordings)),
            "merged_from_map": _pose(outcome.merged_from_map),
            **_agreement(outcome.agreement),
            "confidence": _share(outcome.confidence),
            "prior": _prior(self._priors.get(item.robot)),
            "component": placement.component if placement else None,
            "component_from_map": _pose(placement.component_from_map) if placement else None,
            "placed_via": placement.via if placement else None,
            "centre_m": None if centre_m is None else [_round(value) for value in centre_m],
            "map_frame": item.frame,
            "recorded_frame": item.recorded_frame,
            "map_topic": item.topic,
            "first_merged_stamp_ns": self._first_merged_ns.get(item.robot),
            "updates": self._updates[item.robot],
        }


def _at_least(event: Skipped) -> int:
    """Return how many messages were lost; one if that cannot be told."""
    return 1 if event.messages is None else event.messages


def _reason(reason: Reason) -> Json:
    return {"code": str(reason.code), "message": reason.message}


def _pose(pose: Sim2 | None) -> Json | None:
    if pose is None:
        return None
    return {
        "x_m": _round(pose.x_m),
        "y_m": _round(pose.y_m),
        "yaw_rad": max(-_MAX_YAW_RAD, min(_MAX_YAW_RAD, _round(wrap_angle(pose.yaw_rad), _TURN_DIGITS))),
        "scale": _round(pose.scale, _TURN_DIGITS),
    }


def _prior(prior: Prior | None) -> Json | None:
    if prior is None:
        return None
    return {
        "pose": _pose(prior.target_from_source),
        "sigma": {
            "x_m": _round(prior.sigma_x_m),
            "y_m": _round(prior.sigma_y_m),
            "yaw_rad": _round(prior.sigma_yaw_rad),
        },
        "origin": prior.origin,
    }


def _agreement(agreement: Agreement | None) -> Json:
    if agreement is None:
        return {"acceptance": None, "overlap_m2": None, "overlap_fraction": None}
    return {
        "acceptance": _round(agreement.acceptance) if agreement.overlap_m2 > 0 else None,
        "overlap_m2": _round(agreement.overlap_m2),
        "overlap_fraction": _round(agreement.overlap_fraction),
    }


def _pair(pair: Pair, match: Match, prior: Prior | None) -> Json:
    scores = match.scores
    return {
        "a": pair[0],
        "b": pair[1],
        "a_from_b": _pose(match.target_from_source),
        "scores": {name: _round(value) for name, value in asdict(scores).items()} if scores else None,
        "accepted": match.accepted,
        "confidence": _share(match.confidence),
        "reason": _reason(match.reason),
        "prior": _prior(prior),
        "rivals": [
            {
                "a_from_b": _pose(rival.target_from_source),
                "score_m": _round(rival.score_m),
                "likelihood": None if rival.likelihood is None else _round(rival.likelihood),
            }
            for rival in match.rivals
        ],
    }


def _share(value: float | None) -> float | None:
    return None if value is None else _round(value)


def _round(value: float, digits: int = _DIGITS) -> float:
    """Round, and turn −0.0 into 0.0 so that equal values are written alike."""
    return round(value, digits) + 0.0
