"""Where robots drove, as lines on a picture of maps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mapmerge.raster import Pixels
from mapmerge.sim2 import Sim2
from replay.html.roster import Member
from replay.html.story import Story
from replay.plain_text import listed
from replay.tracker import JUMP_M

PARTS = 4
"""So many units of the drawing are a pixel of the picture: coordinates are whole numbers of them."""

MOST_POINTS, MOST_POINTS_OF_ONE = 20_000, 3000
"""Of all lines together, and of one: a point takes about six bytes of the page."""

_LEAST_POINTS = 100
_BEND_PX = 0.4
_COARSEST = 16

_Strip = NDArray[np.float64]
"""Points of a line, shape (N, 2)."""


@dataclass(frozen=True, slots=True)
class Way:
    """Where one robot drove, as paths of SVG: the line, and a dot where the robot was last; "" where there is none."""

    member: Member
    line: str
    last: str


@dataclass(frozen=True, slots=True)
class Ways:
    """The ways of the robots of a picture.

    Parameters
    ----------
    ways
        Of those of whom it is known.
    robots
        How many robots there are in the picture.
    are_whole
        Whether all that was recorded of them could be read.
    pixels
        The pixels of the picture.
    """

    ways: tuple[Way, ...]
    robots: int
    are_whole: bool
    pixels: Pixels

    @property
    def view(self) -> str:
        """What the drawing shows, as SVG has it."""
        return f"0 0 {self.pixels.cols * PARTS} {self.pixels.rows * PARTS}"

    @property
    def names(self) -> str:
        """Whose they are."""
        return listed([way.member.name for way in self.ways])

    @property
    def caption(self) -> str:
        """What the lines are, in words."""
        if len(self.ways) == self.robots:
            whose = "The thin lines are where the robots drove"
        else:
            whose = f"The thin lines are where robots drove, as far as that is known: {self.names}"
        cut = "" if self.are_whole else " A recording could not be read to the end for them."
        return f"{whose}; a dot is where one was last.{cut}"


def ways(story: Story, placed: Sequence[tuple[Member, Sim2]], pixels: Pixels) -> Ways | None:
    """Return where robots drove, at the places where their maps lie; None where nothing is known of it.

    Parameters
    ----------
    placed
        The robots of the picture, and where their map frames lie in it.
    pixels
        The pixels of the picture.
    """
    known = [(member, pose) for member, pose in placed if member.robot in story.ways]
    most = max(_LEAST_POINTS, min(MOST_POINTS_OF_ONE, MOST_POINTS // max(1, len(known))))
    with np.errstate(over="ignore", invalid="ignore"):  # what is recorded may be anywhere
        found = [_way(member, pose.apply(story.ways[member.robot]), pixels, most) for member, pose in known]
    seen = tuple(way for way in found if way.line or way.last)
    return Ways(seen, len(placed), story.are_ways_whole, pixels) if seen else None


def _way(member: Member, points_m: _Strip, pixels: Pixels, most: int) -> Way:
    strips = list(_strips(points_m, pixels))
    line = "".join(map(_path, _thinned([strip for strip in strips if len(strip) > 1], most)))
    (x_m, y_m), (width_m, height_m) = points_m[-1] - (pixels.x_m, pixels.y_m), (pixels.width_m, pixels.height_m)
    is_seen = 0.0 <= x_m <= width_m and 0.0 <= y_m <= height_m
    return Way(member, line, f"{_path(strips[-1][-1:])}h0" if is_seen else "")


def _strips(points_m: _Strip, pixels: Pixels) -> Iterator[_Strip]:
    """Yield what is drawn without a break: within the picture, as far as the robot did not jump."""
    corner_m, size_m = np.array((pixels.x_m, pixels.y_m)), np.array((pixels.width_m, pixels.height_m))
    is_within = np.all((points_m >= corner_m) & (points_m <= corner_m + size_m), axis=1)
    edges = np.flatnonzero(is_within[1:] != is_within[:-1]) + 1
    for part, is_seen in zip(np.split(points_m, edges), np.split(is_within, edges), strict=True):
        if is_seen[0]:
            jumps = np.flatnonzero(np.hypot(*np.diff(part, axis=0).T) > JUMP_M) + 1
            # row 0 has the lowest y in a map, and is the top one in a picture
            places = np.array((0.0, pixels.rows)) + (part - corner_m) * (1.0, -1.0) / pixels.pixel_m
            yield from np.split(places, jumps)


def _thinned(strips: Sequence[_Strip], most: int) -> list[_Strip]:
    """Return lines of so few points, that cannot be told from those with all; of very many the longest."""
    kept = sorted(strips, key=len, reverse=True)[: most // 2]
    found = kept
    for doubled in range(_COARSEST):
        found = [_without_straight(strip, _BEND_PX * 2**doubled) for strip in kept]
        if sum(map(len, found)) <= most:
            break
    return found


def _without_straight(strip: _Strip, bend_px: float) -> _Strip:
    """Return a line without the points that lie no further from it than this."""
    import cv2

    return cv2.approxPolyDP(strip.astype(np.float32), bend_px, closed=False).reshape(-1, 2).astype(np.float64)


def _path(strip: _Strip) -> str:
    """Return a line as a path of SVG, of steps in units of the drawing."""
    places = np.rint(strip * PARTS).astype(int)
    steps = np.diff(places, axis=0).tolist()
    x, y = places[0]
    return f"M{x} {y}" + ("l" + " ".join(f"{dx} {dy}" for dx, dy in steps) if steps else "")
