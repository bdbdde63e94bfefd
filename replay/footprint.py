"""``--max-memory``: sizes in words, and maps that would need more."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from decimal import Decimal

from mapmerge.config import MergeConfig
from mapmerge.grid import Grid
from replay.errors import BadMessage, InputError, UsageError
from replay.plain_text import brief
from replay.skip_cause import SkipCause

_UNITS = {"": 1, "B": 1, **{f"{k}B": 1000**n for n, k in enumerate("kMGT", 1)}}
_UNITS |= {f"{k}iB": 1024**n for n, k in enumerate("KMGT", 1)}
# as people type them: 200M
_BY_NAME = {name.lower(): factor for name, factor in _UNITS.items()} | {k: 1000**n for n, k in enumerate("kmgt", 1)}
_SIZE = re.compile(r"(\d+(?:\.\d*)?) ?([A-Za-z]*)", re.ASCII)
_LEAST_BYTES = 1 << 20
_MOST_BYTES = 1 << 63


def size_to_bytes(text: str) -> int:
    """Read a size such as 2GiB, 500MB, 500M (the same) or a plain number of bytes.

    Raises
    ------
    UsageError
        If it is none, less than 1 MiB, or more than 8 EiB.
    """
    found = _SIZE.fullmatch(text)
    if found is None or found[2].lower() not in _BY_NAME:
        raise UsageError(f"{brief(repr(text))} is no size; expected one such as 2GiB, 500MB, or a number of bytes")
    size_bytes = int(Decimal(found[1]) * _BY_NAME[found[2].lower()])
    if size_bytes > _MOST_BYTES:
        raise UsageError(f"{brief(repr(text))} is more than any memory; expected a size such as 2GiB")
    if size_bytes < _LEAST_BYTES:
        raise UsageError(f"{text!r} is less than 1 MiB, in which there is no map; expected one such as 2GiB")
    return size_bytes


def in_words(size_bytes: int) -> str:
    """Return a size to read: 1.5 GB."""
    for unit in ("GB", "MB", "kB"):
        if size_bytes >= _UNITS[unit]:
            return f"{size_bytes / _UNITS[unit]:.1f} {unit}"
    return f"{size_bytes} bytes"


@dataclass(frozen=True, slots=True)
class MemoryLimit:
    """How much memory one map may need, when it is merged with these settings."""

    max_bytes: int
    merge: MergeConfig

    def refuse_over(self, grid: Grid) -> None:
        """Refuse a map that needs more: unknown margins take no more than their bytes, but those they do.

        Raises
        ------
        BadMessage
            With the cause ``over_memory``.
        """
        from mapmerge.footprint import may_need_bytes, needed_bytes

        if may_need_bytes(grid, self.merge) <= self.max_bytes:
            return
        known = grid.cropped_to_known()
        needed = needed_bytes(known, self.merge) + grid.cells.size - known.cells.size
        if needed > self.max_bytes:
            raise BadMessage(
                SkipCause.OVER_MEMORY,
                f"a map of {grid.cols} × {grid.rows} cells of {grid.resolution_m:g} m needs about {in_words(needed)}; "
                f"--max-memory allows {in_words(self.max_bytes)}",
            )

    @property
    def canvas_cells(self) -> int:
        """How many cells the merged map may have."""
        from mapmerge.footprint import CANVAS_CELL_BYTES

        return max(1, self.max_bytes // CANVAS_CELL_BYTES)


@contextmanager
def enough_memory(grids: Mapping[str, Grid], stamp_ns: int) -> Iterator[None]:
    """Say of which maps it was, if there is not enough memory to merge maps. Other errors of OpenCV are bugs and pass.

    Raises
    ------
    InputError
        Which names the robots whose maps these are, and what to do.
    """
    import cv2

    try:
        yield
    except MemoryError as error:
        raise InputError(_no_memory(grids, stamp_ns)) from error
    except cv2.error as error:
        if error.code != cv2.Error.StsNoMem:
            raise
        raise InputError(_no_memory(grids, stamp_ns)) from error


def _no_memory(grids: Mapping[str, Grid], stamp_ns: int) -> str:
    maps = ", ".join(f"{robot} ({grid.cols} × {grid.rows} cells)" for robot, grid in grids.items())
    return (
        f"the maps of {maps} at {stamp_ns} ns: there is not enough memory to merge them; leave out what needs too much "
        "with --max-memory SIZE, or name fewer robots with --robots"
    )
