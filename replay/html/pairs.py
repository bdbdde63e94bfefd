"""Each pair's maps on each other; and of what was refused, the best candidate beside its rivals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from mapmerge.config import VerifyConfig
from mapmerge.drawing import AGREE
from mapmerge.match import Match
from mapmerge.match.base import Rival
from mapmerge.match.verdict import lacking
from mapmerge.outcome import Pair
from mapmerge.reasons import ReasonCode
from mapmerge.rounding import rounded_down
from mapmerge.sim2 import IDENTITY, Sim2
from mapmerge.verify import Scores
from mapmerge.watch import Trigger
from replay.advice import ADVICE
from replay.figures import area, percent, seconds, share
from replay.html.pictures import CONTRADICT, Picture, overlay_picture
from replay.html.roster import Member
from replay.html.story import Story
from replay.palette import as_hex

MOST_PAIR_PICTURES = 30
_MOST_RIVALS, _MOST_RIVALS_OF_MANY, _MANY = 7, 3, 4
_PAIR_SIDE_PX = 800
_RIVAL_SIDE_PX = 560

Figure = tuple[str, str]
"""What it is, and how much."""


@dataclass(frozen=True, slots=True)
class PairShown:
    """One pair: both robots, the latest match in words and figures, and its picture unless there are too many."""

    target: Member
    source: Member
    accepted: bool
    reason: str
    confidence: str
    overlap: str
    figures: tuple[Figure, ...]
    searched: str
    picture: Picture | None


@dataclass(frozen=True, slots=True)
class Candidate:
    """A placement that was not chosen: its picture, where it is, and what speaks for and against it."""

    title: str
    pose: str
    against: str
    figures: tuple[Figure, ...]
    picture: Picture | None


@dataclass(frozen=True, slots=True)
class Refused:
    """A robot that is not merged, the pair it came nearest in, and the placements that were weighed."""

    member: Member
    target: Member | None
    source: Member | None
    reason: str
    advice: str
    candidates: tuple[Candidate, ...]
    more: int


def pairs(story: Story) -> list[PairShown]:
    """Return all pairs: those that are accepted first, then the surest; the first ones with a picture."""
    if story.result is None:
        return []
    matches = story.result.pairs
    said = {(item["a"], item["b"]): item for item in story.report["pairs"]}
    ordered = sorted(matches, key=lambda pair: (not matches[pair].accepted, -(matches[pair].confidence or 0.0)))
    found = []
    pictured = [pair for pair in ordered if matches[pair].target_from_source is not None][:MOST_PAIR_PICTURES]
    for pair in ordered:
        match, searched = matches[pair], said[pair]["searched"]
        pose = match.target_from_source if pair in pictured else None
        found.append(
            PairShown(
                story.member(pair[0]),
                story.member(pair[1]),
                match.accepted,
                match.reason.message,
                percent(match.confidence),
                area(match.scores.overlap_m2 if match.scores else None),
                _figures(match),
                "" if searched is None else _searched(searched["stamp_ns"] - story.first_ns, searched["trigger"]),
                None if pose is None else _overlay(story, pair, pose, _PAIR_SIDE_PX),
            )
        )
    return found


def refused(story: Story) -> list[Refused]:
    """Return the robots that are not merged, each with what was weighed."""
    if story.result is None:
        return []
    robots = [robot for robot, values in story.report["robots"].items() if values["merged_from_map"] is None]
    most = _MOST_RIVALS if len(robots) <= _MANY else _MOST_RIVALS_OF_MANY
    found = []
    for robot in robots:
        pair, reason = story.result.robots[robot].shown_pair, story.report["robots"][robot]["reason"]
        match = story.result.pairs.get(pair) if pair is not None else None
        candidates = _candidates(story, pair, match, most) if pair is not None and match is not None else []
        more = 0 if match is None else max(0, len(match.rivals) - most)
        target, source = (None, None) if pair is None else (story.member(pair[0]), story.member(pair[1]))
        advice = ADVICE[ReasonCode(reason["code"])]
        found.append(Refused(story.member(robot), target, source, reason["message"], advice, tuple(candidates), more))
    return found


def _candidates(story: Story, pair: Pair, match: Match, most: int) -> list[Candidate]:
    if match.target_from_source is None:
        return []
    is_believed = match.reason.code is ReasonCode.PRIOR_CONTRADICTED
    best = Candidate(
        "Best candidate where it was said to be" if is_believed else "Best candidate",
        str(match.target_from_source),
        match.reason.message,
        _figures(match),
        _overlay(story, pair, match.target_from_source, _RIVAL_SIDE_PX),
    )
    others = [
        Candidate(
            "Where the maps do fit" if is_believed and number == 1 else f"Rival {number}",
            str(rival.target_from_source),
            _against(story, rival),
            _rival_figures(rival),
            _overlay(story, pair, rival.target_from_source, _RIVAL_SIDE_PX),
        )
        for number, rival in enumerate(match.rivals[:most], start=1)
    ]
    return [best, *others]


def _overlay(story: Story, pair: Pair, pose: Sim2, side_px: int) -> Picture | None:
    target, source = story.layer(pair[0], IDENTITY), story.layer(pair[1], pose)
    if target is None or source is None:
        return None
    colours = story.member(pair[0]).rgb, story.member(pair[1]).rgb
    return overlay_picture(target, source, colours, story.cells, story.tolerance_m, side_px)


def _figures(match: Match) -> tuple[Figure, ...]:
    scores = match.scores
    figures: list[Figure] = []
    if match.confidence is not None:
        figures.append(("confidence", percent(match.confidence)))
    if scores is not None:
        figures += [
            ("acceptance", share(scores.acceptance)),
            ("overlap", area(scores.overlap_m2)),
            (
                "walls that agree",
                f"{rounded_down(scores.wall_agreement * 100, 0):.0f}%, {_metres(scores.matched_wall_m)}",
            ),
            ("walls in the other's free space", _metres(scores.violated_wall_m)),
            ("score", f"{scores.score_m:.1f}"),
        ]
    return tuple(figures)


def _rival_figures(rival: Rival) -> tuple[Figure, ...]:
    figures: list[Figure] = []
    if rival.likelihood is not None:
        figures.append(("likelihood", f"{_times(rival.likelihood)} × the best"))
    if rival.fit is not None:
        fit = rival.fit
        figures += [
            ("acceptance", share(fit.acceptance)),
            ("overlap", area(fit.overlap_m2)),
            ("walls that agree", f"{rounded_down(fit.wall_agreement * 100, 0):.0f}%, {_metres(fit.matched_wall_m)}"),
            ("walls that contradict it", _metres(fit.contradicted_m)),
        ]
    return (*figures, ("score", f"{rival.score_m:.1f}"))


def _against(story: Story, rival: Rival) -> str:
    """Return what speaks against a rival: what it lacks or, if it lacks nothing, that it is no likelier."""
    if rival.fit is not None:
        fit = rival.fit
        scores = Scores(
            fit.score_m,
            fit.acceptance,
            fit.overlap_m2,
            fit.overlap_fraction,
            fit.wall_agreement,
            fit.matched_wall_m,
            fit.contradicted_m,
        )
        poor = lacking(scores, VerifyConfig(**story.settings["merge"]["verify"]))
        if poor is not None:
            return poor.message
    if rival.likelihood is None:
        return ""
    return "it is likelier than the best candidate" if rival.likelihood > 1.0 else "it is no likelier than the best one"


def _times(likelihood: float) -> str:
    return "< 0.001" if likelihood < 0.001 else f"{likelihood:.3g}"


def _metres(length_m: float) -> str:
    return f"{rounded_down(length_m, 1):,.1f} m"


def _searched(since_ns: int, trigger: str) -> str:
    return f"searched at {seconds(since_ns)}, as {Trigger(trigger).words}"


def legend(target: Member, source: Member) -> Sequence[tuple[str, str]]:
    """Return what the colours of an overlay mean, in words."""
    return (
        (as_hex(AGREE), "walls that agree"),
        (as_hex(CONTRADICT), "wall in the other's free space"),
        (target.colour, f"walls of {target.name} alone"),
        (source.colour, f"walls of {source.name} alone"),
    )
