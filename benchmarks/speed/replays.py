"""Whole recordings replayed, against reading the same maps and writing the same merged ones alone."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from benchmarks.long_mission import Mission
from benchmarks.made_once import recorded
from benchmarks.recordings import RECORDINGS
from benchmarks.speed.alone import read_s, write_s
from benchmarks.speed.child import Ended, replay
from benchmarks.speed.options import Options
from benchmarks.speed.printed import Table, at_most, mebibytes, ratio, seconds
from benchmarks.speed.replaying import import_all, map_topics, replay_s

MOST = 3.0
_SECONDS, _SHORT_RUNS = 10.0, 3
TABLE = Table(
    26, ("recording", "maps", "wall", "processor", "peak", "in process", "read", "write", "ratio", "×.rrd", "×images")
)


@dataclass(frozen=True, slots=True)
class Measured:
    """What one recording takes: the program, and processor time in seconds in this process.

    Parameters
    ----------
    program
        The command, with no Rerun recording and no images.
    replay_s, rrd_s, images_s
        The same in this process; with a Rerun recording as well; with images of what changed as well.
    read_s, write_s
        Reading the maps alone, writing the merged ones alone.
    """

    maps: int
    program: Ended
    replay_s: float
    rrd_s: float
    images_s: float
    read_s: float
    write_s: float

    @property
    def ratio(self) -> float:
        """Time of the replay in those of reading and writing alone."""
        return self.replay_s / (self.read_s + self.write_s)


def lines(options: Options) -> Iterator[str]:
    """Yield the lines of the section."""
    import_all(options.work)
    yield TABLE.header
    for path in _real(options):
        yield row(path.name, measured(path, options))
    mission = recorded(Mission(2, options.updates, options.side), options.work)
    found = measured(mission, options)
    yield row(mission.stem, found)
    yield at_most("the synthetic mission, to reading and writing alone", found.ratio, MOST)


def _real(options: Options) -> list[Path]:
    if options.recordings is None:
        return []
    return [options.recordings / name for name in RECORDINGS]


def measured(path: Path, options: Options) -> Measured:
    """Return what a recording takes: the program once, then medians of what takes turns in this process.

    There are as many rounds as fit into some seconds, and one at least.
    """
    topics = map_topics(path)
    output, copy, other = (options.work / f"{name}.mcap" for name in ("replayed", "alone", "more"))
    program = replay(["merge", str(path), "-o", str(output), "--no-rrd", "--images", "none", "--force"])
    rounds: list[tuple[float, ...]] = []
    while not rounds or (len(rounds) < options.rounds and sum(map(sum, rounds)) < _SECONDS):
        rounds.append(
            (
                replay_s(path, output),
                replay_s(path, other, rrd=True),
                replay_s(path, other, images="changed"),
                median(read_s(path, topics) for _ in range(_SHORT_RUNS)),
                median(write_s(output, copy) for _ in range(_SHORT_RUNS)),
            )
        )
    return Measured(sum(topics.values()), program, *map(median, zip(*rounds, strict=True)))


def row(name: str, found: Measured) -> str:
    """Return one line of the table."""
    return TABLE.row(
        name,
        str(found.maps),
        seconds(found.program.wall_s),
        seconds(found.program.processor_s),
        mebibytes(found.program.peak_bytes),
        seconds(found.replay_s),
        seconds(found.read_s),
        seconds(found.write_s),
        ratio(found.ratio),
        ratio(found.rrd_s / found.replay_s),
        ratio(found.images_s / found.replay_s),
    )
