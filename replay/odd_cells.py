"""Cells whose values no map has: they are taken as unknown, which is said once for each topic."""

from __future__ import annotations

from replay.messages import GridMessage, UpdateMessage
from replay.sources.base import RawMessage


class OddCells:
    """Tells of the first map, or update of one, on each topic that has such cells.

    Parameters
    ----------
    recording
        Its name.
    """

    def __init__(self, recording: str) -> None:
        self._recording = recording
        self._told: set[str] = set()

    def note(self, raw: RawMessage, content: object) -> str | None:
        """Return what is to be said of a message; None if nothing is."""
        if not isinstance(content, GridMessage | UpdateMessage) or not content.odd_cells or raw.topic in self._told:
            return None
        self._told.add(raw.topic)
        size = content.cells.size if isinstance(content, UpdateMessage) else content.grid.cells.size
        where = f"{self._recording}: {raw.topic} at {raw.log_time_ns} ns"
        share = _share(content.odd_cells, size)
        return f"{where}: {share} of the cells are outside −1 to 100: such cells are taken as unknown"


def _share(part: int, whole: int) -> str:
    percent = round(100 * part / whole)
    return f"{percent}%" if percent else "less than 1%"
