"""What happens in a run, in order. Everything that is shown or written is a sink of these events."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from replay.skip_cause import SkipCause
from replay.words import moment

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from mapmerge.render import Picture
    from mapmerge.result import MergeResult

SCHEMA = "replay.report/1"
"""The form of reports, of which a program that reads them takes note."""

Report = Mapping[str, Any]
"""A report as JSON values, as ``docs/report.schema.json`` describes it."""

Clock = Literal["header", "log", "none"]


@dataclass(frozen=True, slots=True)
class RobotInput:
    """Where one robot's maps come from.

    Parameters
    ----------
    robot
        Its name.
    topic
        Its map topic.
    frame
        Its map frame in all outputs.
    clock
        What its times are taken from; ``none`` for saved maps.
    inputs
        Which of the run's inputs hold it, as indices.
    message_count
        Messages of its topics.
    recorded_frame
        What its map frame was called in the recording, its leading slash stripped; None where it has no name.
    """

    robot: str
    topic: str
    frame: str
    clock: Clock
    inputs: tuple[int, ...]
    message_count: int
    recorded_frame: str | None = None


@dataclass(frozen=True, slots=True)
class Started:
    """The run was understood and begins; the first robot is the reference."""

    robots: tuple[RobotInput, ...]
    settings: Mapping[str, Any]
    inputs: tuple[Mapping[str, Any], ...]


@dataclass(frozen=True, slots=True)
class Skipped:
    """A message could not be used, or not all of it; or a part of a recording could not.

    Parameters
    ----------
    robot
        Whose it is; "" for transforms, which are no robot's own, and for a part of a recording.
    topic
        Its topic; "" if that cannot be told, as of a part of a recording.
    log_time_ns
        When it was recorded; of a part of a recording, when what was read last was.
    input
        Name of the file or folder that it came from.
    place
        Where the part is in the recording; "" for a message, which its topic and time tell.
    messages
        How many messages are lost; None if that cannot be told.
    """

    robot: str
    topic: str
    log_time_ns: int
    cause: SkipCause
    detail: str
    input: str
    place: str = ""
    messages: int | None = 1

    @property
    def where(self) -> str:
        """Where it was, in words, without the input."""
        return self.place or f"{self.topic} at {moment(self.log_time_ns)}"


@dataclass(frozen=True, slots=True)
class Noted:
    """Something a reader should know of a robot, in words; nothing failed."""

    robot: str
    message: str


@dataclass(frozen=True, slots=True)
class Timing:
    """Seconds of wall time that one tick took; for people to look at, never part of a result."""

    merge_s: float
    render_s: float


@dataclass(frozen=True, slots=True, eq=False)
class RobotPicture:
    """A picture of one step of the method for one robot."""

    robot: str
    picture: Picture


@dataclass(frozen=True, slots=True, eq=False)
class Moved:
    """Where a robot was since the tick before, as recorded transforms say; thinned to steps that can be seen.

    Parameters
    ----------
    poses
        Shape (N, 3), at least one, in order of time: x and y in metres, yaw in radians, in the robot's map frame.
    """

    robot: str
    poses: NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Merged:
    """Messages with maps arrived at this time and were taken in.

    Parameters
    ----------
    stamp_ns
        Time of the tick, on the reference's clock; never decreases.
    result
        All that the merger knows now.
    report
        The report as of now, in the form that is written; of its history, what changed at this time.
    pictures
        Intermediate images that are due, rendered once for all sinks.
    done, total
        Messages read so far, and in all.
    moved
        Where robots were since the tick before, where that was recorded and is wanted.
    remarks
        What is to be said of ``moved``, for who looks on; never part of a report as values.
    """

    stamp_ns: int
    result: MergeResult
    report: Report
    pictures: tuple[RobotPicture, ...]
    timing: Timing
    done: int
    total: int
    moved: tuple[Moved, ...] = ()
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Finished:
    """All was read; ``report`` is the final one."""

    report: Report


Event = Started | Skipped | Noted | Merged | Finished
"""What may happen; a run begins with `Started` and ends with `Finished`."""
