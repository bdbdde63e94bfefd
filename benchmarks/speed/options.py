"""What the sections are told."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class Options:
    """Sizes of what is measured.

    Parameters
    ----------
    work
        Folder for recordings that are made once, and for outputs.
    rounds
        How often things take turns; a first round more does not count.
    sides
        Cells a side of the maps that are matched from nothing.
    share
        Share of the pairs of `benchmarks.truth`.
    warm_sides
        Cells a side of the maps that one more map comes to.
    side, updates
        Of the mission that is replayed as a whole: cells a side, maps a robot.
    recordings
        Folder of recordings that are replayed as well; None for none.
    memory_side, memory_updates
        Of the missions whose memory is compared, which differ in updates alone.
    growth_sides, growth_robots, growth_side, growth_updates
        Of the missions whose costs are compared: cells a side of those of two robots; robots of those of one size; maps
        a robot.
    huge
        Whether the maps of 10 000² cells are measured.
    """

    work: Path
    rounds: int = 5
    sides: tuple[int, ...] = (400, 800, 1500, 3000)
    share: float = 1.0
    warm_sides: tuple[int, ...] = (400, 800, 2000)
    side: int = 2000
    updates: int = 300
    recordings: Path | None = None
    memory_side: int = 600
    memory_updates: tuple[int, ...] = (30, 300, 3000)
    growth_sides: tuple[int, ...] = (500, 1000, 2000)
    growth_robots: tuple[int, ...] = (2, 4, 8)
    growth_side: int = 600
    growth_updates: int = 40
    huge: bool = False
