"""What becomes of each robot over time in the Rerun recording: a strip for each, coloured by its status."""

from __future__ import annotations

from collections.abc import Sequence

import rerun as rr

from replay.events import Report
from replay.palette import Rgb
from replay.sinks.rerun_entities import RobotEntities
from replay.sinks.rerun_stream import RrdStream

_STATES: tuple[tuple[str, str, Rgb], ...] = (
    ("reference", "reference", (92, 112, 140)),
    ("merged", "merged", (46, 140, 82)),
    ("unmerged", "not merged", (190, 70, 60)),
    ("no_map", "no map yet", (80, 80, 80)),
)


class Statuses:
    """Logs what becomes of robots, when that changes.

    Parameters
    ----------
    stream
        The recording.
    robots
        The robots.
    """

    def __init__(self, stream: RrdStream, robots: Sequence[RobotEntities]) -> None:
        self._stream = stream
        self._robots = robots
        self._shown: dict[str, str] = {}
        values, labels, colours = zip(*_STATES, strict=True)
        style = rr.StateConfiguration(values=values, labels=labels, colors=colours)
        for entities in robots:
            stream.log(entities.status, style, static=True)

    def show(self, report: Report) -> None:
        """Log the statuses that differ from those before."""
        for entities in self._robots:
            status = report["robots"][entities.robot]["status"]
            if self._shown.get(entities.robot) != status:
                self._shown[entities.robot] = status
                self._stream.log(entities.status, rr.StateChange(state=status))
