"""The robots of a report: what they are called there, and their colours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from replay.palette import Rgb, as_hex, robot_colour
from replay.plain_text import brief


@dataclass(frozen=True, slots=True)
class Member:
    """One robot.

    Parameters
    ----------
    robot
        Its name as it is in the recording, never shown as it is.
    index
        Its place among the robots, the reference being 0.
    """

    robot: str
    index: int

    @property
    def name(self) -> str:
        """Its name to read."""
        return brief(self.robot)

    @property
    def id(self) -> str:
        """What the page's own links call it: a name may hold anything."""
        return f"robot-{self.index}"

    @property
    def rgb(self) -> Rgb:
        """Its colour in pictures, which are on paper."""
        return robot_colour(self.index).ink

    @property
    def colour(self) -> str:
        """Its colour in pictures, as CSS has it."""
        return as_hex(self.rgb)

    @property
    def tone(self) -> str:
        """Its colour on the page, which is light or dark, as CSS has it."""
        return f"light-dark({self.colour}, {as_hex(robot_colour(self.index).bright)})"


def roster(robots: Sequence[str]) -> dict[str, Member]:
    """Return the robots by their names, in order."""
    return {robot: Member(robot, index) for index, robot in enumerate(robots)}
