"""One more map of a robot that goes on, once the maps are merged: decoded and merged again.

Against what can hardly be less: decoding the message, one warp and one distance transform of the map.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from statistics import median
from time import process_time

import cv2
import numpy as np

from benchmarks.long_mission import Mission
from benchmarks.made_once import recorded
from benchmarks.speed.merging import merger
from benchmarks.speed.options import Options
from benchmarks.speed.printed import Table, at_most, ratio, seconds
from benchmarks.speed.replaying import last_messages
from mapmerge.grid import Grid
from replay.codec import decode
from replay.messages import GridMessage
from replay.sources.base import RawMessage

MOST = 2.0
_FEWEST_UPDATES, _FIRST_ROUNDS = 40, 2
TABLE = Table(14, ("cells", "updates", "update", "floor", "ratio", "slowest", "merged"))


def lines(options: Options) -> Iterator[str]:
    """Yield the lines of the section."""
    yield TABLE.header
    ratios: list[float] = []
    for side in options.warm_sides:
        line, found = measured(mission_of(side, options), options)
        ratios.append(found)
        yield line
    yield at_most("a warm update of the largest maps, to its floor", ratios[-1], MOST)


def mission_of(side: int, options: Options) -> Mission:
    """Return the mission of this size in which a robot drives as far between two maps as in the largest one."""
    return Mission(2, max(_FEWEST_UPDATES, round(options.updates * (side / options.side) ** 2)), side)


def measured(mission: Mission, options: Options) -> tuple[str, float]:
    """Return the line of one size, and the median ratio: the robots take turns; the first maps do not count."""
    first = _FIRST_ROUNDS * mission.robots
    raws = last_messages(recorded(mission, options.work), first + options.rounds * mission.robots)
    take = merger(mission.robot_names)
    spent: list[tuple[float, float]] = []
    merged = 0
    for number, raw in enumerate(raws):
        begin = process_time()
        robot = raw.topic.split("/")[1]
        result = take({robot: _decoded(raw)})
        between = process_time()
        floor(raw)
        if number >= first:
            spent.append((between - begin, process_time() - between))
            merged += result.robots[mission.robot_names[1]].merged_from_map is not None
    return _line(_decoded(raws[-1]), spent, merged)


def floor(raw: RawMessage) -> None:
    """Do what can hardly be less."""
    cells = _decoded(raw).cells.view(np.uint8)
    rows, cols = cells.shape
    turn = cv2.getRotationMatrix2D((cols / 2, rows / 2), 20.0, 1.0)
    cv2.warpAffine(cells, turn, (cols, rows), flags=cv2.INTER_NEAREST)
    cv2.distanceTransform(cells, cv2.DIST_L2, 5)


def _decoded(raw: RawMessage) -> Grid:
    message = decode(raw)
    assert isinstance(message, GridMessage)  # noqa: S101 - the mission has no other messages
    return message.grid


def _line(last: Grid, spent: Sequence[tuple[float, float]], merged: int) -> tuple[str, float]:
    updates_s, floors_s = zip(*spent, strict=True)
    ratios = [update_s / floor_s for update_s, floor_s in spent]
    found = median(ratios)
    line = TABLE.row(
        f"{last.cols}×{last.rows}",
        str(len(spent)),
        seconds(median(updates_s)),
        seconds(median(floors_s)),
        ratio(found),
        ratio(max(ratios)),
        f"{merged} of {len(spent)}",
    )
    return line, found
