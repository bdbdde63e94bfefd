"""The colours of robots, the same in all outputs: bright ones for dark grounds, inks for paper."""

from __future__ import annotations

from dataclasses import dataclass

Rgb = tuple[int, int, int]


@dataclass(frozen=True, slots=True)
class RobotColour:
    """One robot's colour.

    Parameters
    ----------
    name
        What it is called.
    bright
        On a dark ground.
    ink
        On paper.
    """

    name: str
    bright: Rgb
    ink: Rgb


# Told apart by those who see red and green alike. Green and red say whether maps agree, and grey is kept for limits.
ROBOT_COLOURS: tuple[RobotColour, ...] = (
    RobotColour("blue", (77, 163, 255), (31, 105, 190)),
    RobotColour("orange", (255, 159, 64), (222, 120, 10)),
    RobotColour("violet", (196, 132, 255), (135, 60, 200)),
    RobotColour("yellow", (240, 222, 90), (168, 145, 0)),
    RobotColour("cyan", (84, 222, 228), (0, 145, 160)),
    RobotColour("pink", (255, 128, 190), (214, 50, 140)),
    RobotColour("brown", (190, 140, 100), (125, 80, 45)),
    RobotColour("white", (235, 238, 242), (20, 20, 25)),
)


def robot_colour(index: int) -> RobotColour:
    """Return the colour of a robot by its place in the run, the reference being 0; they repeat when there are many."""
    return ROBOT_COLOURS[index % len(ROBOT_COLOURS)]


def as_hex(colour: Rgb) -> str:
    """Return a colour as CSS has it."""
    return "#{:02x}{:02x}{:02x}".format(*colour)
