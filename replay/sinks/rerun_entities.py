"""Where things are in the Rerun recording, and in which colours.

::

    merged                          the merged frame
    ├── map                         the merged map, as of some time, green where maps share ground
    │   └── changes/<patch>         what changed in it since
    ├── contradictions              where they contradict each other
    ├── robots/<robot>              merged_from_map or, of a map that is not placed, where it is parked
    │   ├── map                     the robot's own map, as of some time
    │   │   └── changes/<patch>     what changed in it since
    │   ├── walls/<tile>            its occupied cells in the robot's colour
    │   ├── path/<piece>            where it drove, in pieces
    │   └── position                where it is
    └── labels/<robot>              its name; of a map that is not placed, also why
    summary                         what is merged, how sure that is and what went wrong, as of now
    legend                          what the colours of the map mean
    status/<robot>                  what becomes of it over time
    evidence/<robot>/<step>         pictures of the match that placed the robot, or of its best refused one
    evidence/<robot>/candidates     the placements that this match found, with their scores
    plots/<quantity>/placed|refused/<robot>
    plots/<quantity>/limit          the least that is accepted
    plots/pose/x|y|yaw/<robot>      where it is placed
    plots/step_ms/merge|render      wall time of each step
    decisions                       what jumped, was placed, moved, withdrawn or skipped, and why
    robots                          the table of robots as of now
    skipped                         messages and parts of recordings that were not used
    about                           inputs and settings
"""

from __future__ import annotations

from dataclasses import dataclass

from replay.palette import Rgb, robot_colour
from replay.plain_text import escaped, plain

EntityPath = list[str]

MERGED: EntityPath = ["merged"]
MERGED_MAP: EntityPath = ["merged", "map"]
CONTRADICTIONS: EntityPath = ["merged", "contradictions"]
SUMMARY: EntityPath = ["summary"]
LEGEND: EntityPath = ["legend"]
STATUS: EntityPath = ["status"]
EVIDENCE: EntityPath = ["evidence"]
PLOTS: EntityPath = ["plots"]
DECISIONS: EntityPath = ["decisions"]
ROBOTS: EntityPath = ["robots"]
SKIPPED: EntityPath = ["skipped"]
ABOUT: EntityPath = ["about"]

LIMIT_COLOUR: Rgb = (150, 150, 150)
GROUND: Rgb = (23, 23, 23)
"""What lies behind the maps, and of a map what it does not know."""


def changes(path: EntityPath, patch: int) -> EntityPath:
    """Return where a patch upon a map is."""
    return [*path, "changes", str(patch)]


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
        return robot_colour(self.index).bright

    @property
    def colour_name(self) -> str:
        """What the colour is called."""
        return robot_colour(self.index).name

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

    def path(self, piece: int) -> EntityPath:
        """Return where a piece of the way that it drove is."""
        return [*self.frame, "path", str(piece)]

    @property
    def position(self) -> EntityPath:
        """Where it is."""
        return [*self.frame, "position"]

    @property
    def label(self) -> EntityPath:
        """Its name."""
        return [*MERGED, "labels", self.part]

    @property
    def evidence(self) -> EntityPath:
        """Parent of its pictures."""
        return [*EVIDENCE, self.part]

    @property
    def candidates(self) -> EntityPath:
        """The placements that its match found."""
        return [*self.evidence, "candidates"]

    @property
    def status(self) -> EntityPath:
        """What becomes of it over time."""
        return [*STATUS, self.part]

    def plot(self, quantity: str, *, placed: bool) -> EntityPath:
        """Its line while it is placed, or the points of its best refused candidates."""
        return [*PLOTS, quantity, "placed" if placed else "refused", self.part]

    def pose_plot(self, part: str) -> EntityPath:
        """Its line of where it is placed: x, y or yaw."""
        return [*PLOTS, "pose", part, self.part]
