"""Where things are in the Rerun recording, and in which colours.

::

    merged                          the merged frame
    ├── map                         the merged map
    ├── robots/<robot>              merged_from_map or, of a map that is not placed, where it is parked
    │   ├── map                     the robot's own map
    │   ├── walls/<tile>            its occupied cells in the robot's colour
    │   └── outline                 the box of what it knows
    └── labels/<robot>              its name; of a map that is not placed, also why
    evidence/<robot>/<step>         pictures of the match that placed the robot, or of its best refused one
    plots/<quantity>/placed|refused/<robot>
    plots/acceptance/limit          least acceptance index
    plots/step_ms/merge|render      wall time of each step
    decisions                       what jumped, was placed, moved, withdrawn or skipped, and why
    robots                          the table of robots as of now
    about                           inputs and settings
"""

from __future__ import annotations

from dataclasses import dataclass

from replay.plain_text import escaped, plain

EntityPath = list[str]
Rgb = tuple[int, int, int]

MERGED: EntityPath = ["merged"]
MERGED_MAP: EntityPath = ["merged", "map"]
EVIDENCE: EntityPath = ["evidence"]
PLOTS: EntityPath = ["plots"]
DECISIONS: EntityPath = ["decisions"]
ROBOTS: EntityPath = ["robots"]
ABOUT: EntityPath = ["about"]

# Dark enough for white floors, bright enough for a dark screen; red and grey are kept for warnings and limits.
_PALETTE: tuple[Rgb, ...] = (
    (36, 113, 204),
    (240, 120, 10),
    (20, 155, 75),
    (165, 70, 200),
    (190, 140, 0),
    (0, 160, 175),
    (225, 75, 145),
    (125, 95, 60),
)
LIMIT_COLOUR: Rgb = (150, 150, 150)


@dataclass(frozen=True, slots=True)
class RobotEntities:
    """Paths of one robot's entities, and the robot's colour everywhere.

    Parameters
    ----------
    index
        Place among the robots, the reference being 0.
    """

    robot: str
    index: int

    @property
    def colour(self) -> Rgb:
        """Colour of the robot; the palette repeats when there are many."""
        return _PALETTE[self.index % len(_PALETTE)]

    @property
    def text_colour(self) -> Rgb:
        """The same, bright enough for text on a dark ground."""
        red, green, blue = ((part + 255) // 2 for part in self.colour)
        return red, green, blue

    @property
    def part(self) -> str:
        """Its name as a part of paths."""
        return escaped(self.robot)

    @property
    def label_text(self) -> str:
        """Its name to read."""
        return plain(self.robot)

    @property
    def frame(self) -> EntityPath:
        """The robot's map frame."""
        return [*MERGED, "robots", self.part]

    @property
    def map(self) -> EntityPath:
        """Its own map."""
        return [*self.frame, "map"]

    @property
    def walls(self) -> EntityPath:
        """Parent of its occupied cells, which are logged tile by tile."""
        return [*self.frame, "walls"]

    @property
    def outline(self) -> EntityPath:
        """The box of what it knows."""
        return [*self.frame, "outline"]

    @property
    def label(self) -> EntityPath:
        """Its name."""
        return [*MERGED, "labels", self.part]

    @property
    def evidence(self) -> EntityPath:
        """Parent of its pictures."""
        return [*EVIDENCE, self.part]

    def plot(self, quantity: str, *, placed: bool) -> EntityPath:
        """Its line while it is placed, or the points of its best refused candidates."""
        return [*PLOTS, quantity, "placed" if placed else "refused", self.part]
