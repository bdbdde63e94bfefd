"""Most memory at once: of missions that differ in the number of updates alone, and of huge maps."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

from benchmarks.huge_mission import HugeMission
from benchmarks.long_mission import Mission
from benchmarks.made_once import recorded
from benchmarks.speed.child import Ended, replay
from benchmarks.speed.options import Options
from benchmarks.speed.printed import Table, at_most, mebibytes, ratio, seconds

MOST_GROWTH = 1.1
MOST_HUGE_BYTES = 4 << 30
TABLE = Table(14, ("mission", "updates", "peak", "to the last", "wall"))


def lines(options: Options) -> Iterator[str]:
    """Yield the lines of the section."""
    yield TABLE.header
    peaks: list[int] = []
    for updates in options.memory_updates:
        mission = Mission(2, updates, options.memory_side, scans=max(options.memory_updates))
        ended = measured(recorded(mission, options.work), options)
        compared = ratio(ended.peak_bytes / peaks[-1]) if peaks else "–"
        peaks.append(ended.peak_bytes)
        yield TABLE.row(f"{options.memory_side}²", str(updates), mebibytes(peaks[-1]), compared, seconds(ended.wall_s))
    growth = max((later / earlier for earlier, later in pairwise(peaks)), default=1.0)
    yield at_most("peak memory, to that of a tenth of the updates", growth, MOST_GROWTH)
    if options.huge:
        yield from _huge(options)


def _huge(options: Options) -> Iterator[str]:
    mission = HugeMission()
    ended = measured(recorded(mission, options.work), options)
    yield TABLE.row(
        f"{mission.side_cells}²", str(mission.updates), mebibytes(ended.peak_bytes), "–", seconds(ended.wall_s)
    )
    yield at_most("GiB of huge maps", ended.peak_bytes / 2**30, MOST_HUGE_BYTES / 2**30)


def measured(path: Path, options: Options) -> Ended:
    """Replay a recording in a process of its own."""
    output = options.work / "replayed.mcap"
    return replay(["merge", str(path), "-o", str(output), "--no-rrd", "--images", "none", "--force"])
