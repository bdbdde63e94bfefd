"""Which intermediate images are due: each is rendered once, for all outputs."""

from __future__ import annotations

from mapmerge.match import Match
from mapmerge.merger import MergeResult
from mapmerge.render import render
from replay.events import RobotPicture
from replay.options import ImageChoice


class Gallery:
    """Renders the evidence of the match that placed each robot or, if none did, of its best refused one.

    Parameters
    ----------
    choice
        ``changed``: when the match is a new one; ``all``: at each tick; ``none``: never.
    """

    def __init__(self, choice: ImageChoice) -> None:
        self._choice = choice
        self._shown: dict[str, Match] = {}

    def due(self, result: MergeResult) -> tuple[RobotPicture, ...]:
        """Return the images for this tick, robot by robot, step by step."""
        if self._choice == "none":
            return ()
        pictures: list[RobotPicture] = []
        for robot, outcome in result.robots.items():
            if outcome.shown_pair is None:
                continue
            match = result.pairs[outcome.shown_pair]
            if self._choice == "all" or self._shown.get(robot) is not match:
                self._shown[robot] = match
                pictures.extend(RobotPicture(robot, render(evidence)) for evidence in match.evidence)
        return tuple(pictures)
