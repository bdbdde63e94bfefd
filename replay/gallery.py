"""Which intermediate images are due: each is rendered once, for all outputs."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from mapmerge.evidence import Evidence
from mapmerge.outcome import Pair
from mapmerge.render import Label, Named, render
from mapmerge.result import MergeResult
from replay.events import RobotPicture
from replay.options import ImageChoice
from replay.palette import robot_colour
from replay.plain_text import brief


class Gallery:
    """Renders the evidence of the match that placed each robot or, if none did, of its best refused one.

    Parameters
    ----------
    choice
        ``changed``: when a robot's pair was searched, or is another one; ``all``: at each tick; ``none``: never.
    explain
        Returns what the matcher saw of a pair.
    """

    def __init__(self, choice: ImageChoice, explain: Callable[[Pair], Iterable[Evidence]]) -> None:
        self._choice = choice
        self._explain = explain
        self._shown: dict[str, Pair] = {}

    def due(self, result: MergeResult) -> tuple[RobotPicture, ...]:
        """Return the images for this tick, robot by robot, step by step."""
        if self._choice == "none":
            return ()
        pictures: list[RobotPicture] = []
        labels = {robot: Label(brief(robot), robot_colour(index).ink) for index, robot in enumerate(result.robots)}
        for robot, outcome in result.robots.items():
            pair = outcome.shown_pair
            if pair is None:
                continue
            if self._choice == "all" or pair in result.searched or self._shown.get(robot) != pair:
                self._shown[robot] = pair
                named = Named(*(labels[name] for name in pair))
                pictures.extend(RobotPicture(robot, render(evidence, named)) for evidence in self._explain(pair))
        return tuple(pictures)
