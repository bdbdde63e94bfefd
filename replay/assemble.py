"""Full maps from full maps and updates of parts of them."""

from __future__ import annotations

from mapmerge.grid import Grid
from replay.errors import BadMessage
from replay.messages import GridMessage, UpdateMessage
from replay.skip_cause import SkipCause


def assemble(last: Grid | None, message: GridMessage | UpdateMessage) -> Grid:
    """Return a robot's map after a message.

    Parameters
    ----------
    last
        The map before it; None if there was none.
    message
        A full map, which replaces the last one, or new cells for a part of it.

    Raises
    ------
    BadMessage
        If a part comes before any full map or does not lie within it.
    """
    if isinstance(message, GridMessage):
        return message.grid
    rows, cols = message.cells.shape
    if last is None:
        detail = f"an update of {cols} × {rows} cells came before any full map, or after one that is lost"
        raise BadMessage(SkipCause.UPDATE_BEFORE_GRID, detail)
    if message.row < 0 or message.col < 0 or message.row + rows > last.rows or message.col + cols > last.cols:
        detail = (
            f"an update of {cols} × {rows} cells at ({message.col}, {message.row}) reaches outside the map of "
            f"{last.cols} × {last.rows} cells"
        )
        raise BadMessage(SkipCause.UPDATE_OUTSIDE_GRID, detail)
    cells = last.cells.copy()
    cells[message.row : message.row + rows, message.col : message.col + cols] = message.cells
    return Grid(cells, last.resolution_m, last.map_from_grid)
