"""The colour of each robot, the same in all outputs."""

from __future__ import annotations

Rgb = tuple[int, int, int]

# Dark enough for white floors, bright enough for a dark screen; red and grey are kept for warnings and limits.
ROBOT_COLOURS: tuple[Rgb, ...] = (
    (36, 113, 204),
    (240, 120, 10),
    (20, 155, 75),
    (165, 70, 200),
    (190, 140, 0),
    (0, 160, 175),
    (225, 75, 145),
    (125, 95, 60),
)


def robot_colour(index: int) -> Rgb:
    """Return the colour of a robot, the reference being 0; the palette repeats when there are many."""
    return ROBOT_COLOURS[index % len(ROBOT_COLOURS)]


def as_hex(colour: Rgb) -> str:
    """Return a colour as CSS has it."""
    return "#{:02x}{:02x}{:02x}".format(*colour)
