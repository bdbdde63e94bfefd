"""Algorithm 2: walls redrawn as lines between interest points, parallel to an axis where the walls allow it.

The text of section 4.2.1 is followed where the algorithm as printed differs from it: the printed one swaps the axes,
asks for lines that are occupied throughout instead of a ratio, can loop for ever, and names a picture that does not
exist.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from mapmerge.paper.interest import Cells
from mapmerge.paper.pixels import Image

Point = tuple[int, int]
Direction = Literal["x", "y"]


@dataclass(frozen=True, slots=True)
class LineRule:
    """When a line between two points is one.

    Parameters
    ----------
    reach_px
        The distance L: points further apart (Manhattan) are not joined.
    min_share
        The ratio R_thres: a line is a wall if more than this share of its cells is occupied.
    """

    reach_px: int
    min_share: float


@dataclass(slots=True)
class _Walk:
    """Where the algorithm is.

    Parameters
    ----------
    points
        Interest points that are left, in the order of their distance from the origin.
    start
        The reference point: an interest point, or one that was moved.
    direction
        In which a target was last moved.
    failed
        Targets that this reference point cannot be joined with.
    halved
        Targets that were reached by an added point once; not again, so that the walk ends.
    """

    points: dict[Point, None]
    start: Point
    direction: Direction | None = None
    failed: set[Point] = field(default_factory=set)
    halved: set[Point] = field(default_factory=set)

    def go(self, start: Point, direction: Direction | None, *done: Point) -> None:
        """Continue from another reference point, without the points that are done with."""
        for point in done:
            self.points.pop(point, None)
        self.start, self.direction = start, direction
        self.failed = set()

    def begin_anew(self) -> None:
        """Give up the reference point and take the one nearest to the origin (equation 18)."""
        self.points.pop(self.start, None)
        if self.points:
            self.go(next(iter(self.points)), None)


def straightened(binary: Image, marks: Cells, rule: LineRule) -> Image:
    """Return the walls of a picture redrawn as lines between its interest points (Algorithm 2).

    Parameters
    ----------
    binary
        The picture after closing, M.
    marks
        Its interest points, M'.
    rule
        L and R_thres.
    """
    corrected = np.zeros_like(binary)
    ordered = sorted(((int(x), int(y)) for x, y in marks), key=lambda point: (point[0] + point[1], point))
    if not ordered:
        return corrected
    walk = _Walk(dict.fromkeys(ordered), ordered[0])
    while walk.points:
        target = nearest_target(walk.start, walk.points, walk.failed, rule.reach_px)
        if target is None:
            walk.begin_anew()
        elif line_share(binary, walk.start, target) <= rule.min_share:
            walk.failed.add(target)
        else:
            _join(walk, target, binary, corrected, rule)
    return corrected


def nearest_target(start: Point, points: dict[Point, None], failed: set[Point], reach_px: int) -> Point | None:
    """Return the interest point nearest to the reference (equation 19, Manhattan), within reach; None if none is."""
    best: tuple[int, Point] | None = None
    for point in points:
        distance = abs(point[0] - start[0]) + abs(point[1] - start[1])
        if point == start or distance > reach_px or point in failed:
            continue
        if best is None or distance < best[0]:
            best = distance, point
    return None if best is None else best[1]


def line_cells(start: Point, stop: Point) -> tuple[Cells, Cells]:
    """Return the columns and rows of the cells that the line between two cells meets, both ends included."""
    steps = max(abs(stop[0] - start[0]), abs(stop[1] - start[1]))
    cols = np.rint(np.linspace(start[0], stop[0], steps + 1)).astype(np.intp)
    rows = np.rint(np.linspace(start[1], stop[1], steps + 1)).astype(np.intp)
    return cols, rows


def line_share(binary: Image, start: Point, stop: Point) -> float:
    """Return R_it, the occupied share of the cells on a line (equation 20)."""
    cols, rows = line_cells(start, stop)
    return float(np.count_nonzero(binary[rows, cols])) / len(cols)


def moved_target(start: Point, target: Point, direction: Direction | None) -> tuple[Point, Direction] | None:
    """Return the target moved to be level with the reference, and in which direction it was (step 4, equation 21).

    It moves across the longer side of the vector between them; where both are equal, as the last one did. None if
    that is not known either.
    """
    across, along = abs(target[0] - start[0]), abs(target[1] - start[1])
    if across < along or (across == along and direction == "x"):
        return (start[0], target[1]), "x"
    if across > along or direction == "y":
        return (target[0], start[1]), "y"
    return None


def _join(walk: _Walk, target: Point, binary: Image, corrected: Image, rule: LineRule) -> None:
    """Draw the wall between the reference and a target, straight if the picture allows it, and walk on (step 5)."""
    start = walk.start
    moved = moved_target(start, target, walk.direction)
    diagonal = abs(target[0] - start[0]) == abs(target[1] - start[1])
    if moved is None or (diagonal and target in walk.halved):
        walk.begin_anew()
    elif line_share(binary, start, moved[0]) > rule.min_share:
        _draw(corrected, start, moved[0])
        if diagonal:  # a point was added: the target itself is the next one
            walk.halved.add(target)
            walk.go(*moved, start)
        else:
            walk.go(*moved, start, target)
    else:
        _draw(corrected, start, target)
        walk.go(target, None, start)


def _draw(corrected: Image, start: Point, stop: Point) -> None:
    cols, rows = line_cells(start, stop)
    corrected[rows, cols] = 255
