"""How the cost of an update grows: with the cells of the maps, and with the robots."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from benchmarks.long_mission import Mission
from benchmarks.made_once import recorded
from benchmarks.speed.options import Options
from benchmarks.speed.printed import Table, ratio, seconds
from benchmarks.speed.replaying import import_all, map_topics, mean_cells, replay_s

TABLE = Table(14, ("mission", "robots", "updates", "mean cells", "an update", "to the first", "cells to the first"))


def lines(options: Options) -> Iterator[str]:
    """Yield the lines of the section."""
    import_all(options.work)
    yield TABLE.header
    yield from compared([Mission(2, options.growth_updates, side) for side in options.growth_sides], options)
    yield ""
    side, updates = options.growth_side, options.growth_updates
    yield from compared([Mission(robots, updates, side) for robots in options.growth_robots], options)


def compared(missions: Sequence[Mission], options: Options) -> Iterator[str]:
    """Yield a line for each mission: processor time of its replay for each map, and the ratio to the first one's."""
    first: tuple[float, float] | None = None
    for mission in missions:
        path = recorded(mission, options.work)
        maps = sum(map_topics(path).values())
        update_s = replay_s(path, options.work / "replayed.mcap") / maps
        cells = mean_cells(path)
        first = first or (update_s, cells)
        yield TABLE.row(
            f"{mission.side_cells}²",
            str(mission.robots),
            str(maps),
            f"{cells:.0f}",
            seconds(update_s),
            ratio(update_s / first[0]),
            ratio(cells / first[1]),
        )
