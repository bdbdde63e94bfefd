"""The merged map of a run: as of a time, and who is not in it."""

from __future__ import annotations

import math
from pathlib import Path

from replay.errors import InputError
from replay.export.maps import Maps, NoMapYetError, Say, one_map
from replay.options import TimeBound
from replay.plain_text import listed, plain
from replay.report_file import read_report
from replay.run_result import RunResult


def merged_map(path: Path, at: TimeBound | None, say: Say) -> tuple[Maps, str | None]:
    """Return a run's merged map, and whose maps are not in it, in words: by itself it does not show that.

    Raises
    ------
    ReplayError
        If there is none, or was none by that time.
    """
    result = RunResult.of(read_report(path, at), path)
    try:
        found = one_map(path, None, at, say)
    except NoMapYetError as error:
        raise InputError(f"{path}: the first merged map is of {_since_begin(path, error.first_ns)}") from error
    left = listed([plain(robot) for robot, each in result.robots.items() if each.merged_from_map is None])
    if not left:
        return found, None
    if at is not None:
        return found, f"not in the merged map at that time: {left}"
    return found, f"not in the merged map: {left}; the report says why"


def _since_begin(path: Path, time_ns: int) -> str:
    """Return when something was, as seconds that ``--at`` takes."""
    first_ns = read_report(path).get("first_stamp_ns")
    if not isinstance(first_ns, int):
        return f"{time_ns}ns"
    # rounded up, so that it is there by then
    return f"{math.ceil((time_ns - first_ns) / 1e6) / 1e3:g} s after the first map"
