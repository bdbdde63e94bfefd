"""The decoded messages that the rest of the program works on, whatever recording they came from."""

from __future__ import annotations

from dataclasses import dataclass

from mapmerge.grid import Cells, Grid
from replay.pose3 import Pose3


@dataclass(frozen=True, slots=True, eq=False)
class GridMessage:
    """A ``nav_msgs/OccupancyGrid``.

    Parameters
    ----------
    stamp_ns
        ``header.stamp``; 0 if it was not set.
    frame_id
        ``header.frame_id`` as recorded.
    grid
        The map; its cells are a read-only view of the message where possible.
    odd_cells
        How many of them were outside −1 to 100, and became unknown.
    """

    stamp_ns: int
    frame_id: str
    grid: Grid
    odd_cells: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class UpdateMessage:
    """A ``map_msgs/OccupancyGridUpdate``: new cells for a rectangle of the last full grid.

    Parameters
    ----------
    col, row
        Cell of the full grid that the rectangle's cell (0, 0) replaces (``x`` and ``y`` of the message).
    cells
        Shape (rows, columns), int8, as in `Grid`.
    odd_cells
        As of a `GridMessage`.
    """

    stamp_ns: int
    frame_id: str
    col: int
    row: int
    cells: Cells
    odd_cells: int = 0


@dataclass(frozen=True, slots=True)
class FrameLink:
    """A transform between two frames, whose names have no leading slash."""

    parent: str
    child: str
    parent_from_child: Pose3


@dataclass(frozen=True, slots=True)
class TransformMessage:
    """A ``tf2_msgs/TFMessage``.

    Parameters
    ----------
    stamp_ns
        The newest stamp of its transforms; 0 if none was set.
    links
        The transforms that can be used.
    bad
        What is wrong with each of the others.
    """

    stamp_ns: int
    links: tuple[FrameLink, ...]
    bad: tuple[str, ...]
