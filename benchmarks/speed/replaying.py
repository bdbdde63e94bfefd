"""Whole replays in this process, to leave out how long a program takes to start."""

from __future__ import annotations

from collections import deque
from pathlib import Path
from time import process_time

from benchmarks.long_mission import Mission
from benchmarks.made_once import recorded
from replay.options import ImageChoice, OutputOptions, RunOptions
from replay.pipeline import drain, merge
from replay.runs import RunPath
from replay.sinks import open_sinks
from replay.sources import open_source
from replay.sources.base import GRID_TYPE, RawMessage


def replay_s(path: Path, output: Path, *, rrd: bool = False, images: ImageChoice = "none") -> float:
    """Replay a recording, write what came of it, and return the processor time in seconds."""
    options = RunOptions(runs=(RunPath(None, path),), images=images)
    begin = process_time()
    with open_sinks(OutputOptions(mcap=output, rrd=rrd, force=True)) as sinks:
        drain(merge(options), sinks)
    return process_time() - begin


def import_all(work: Path) -> None:
    """Replay a small mission with all outputs, so that whatever is imported when it is used is there."""
    replay_s(recorded(Mission(2, 2, 200), work), work / "small.mcap", rrd=True, images="all")


def map_topics(path: Path) -> dict[str, int]:
    """Return how many messages each map topic of a recording has."""
    with open_source(path) as source:
        return {item.name: item.message_count for item in source.info.topics if item.msgtype == GRID_TYPE}


def last_messages(path: Path, count: int) -> list[RawMessage]:
    """Return the last maps of a recording, undecoded."""
    with open_source(path) as source:
        return list(deque(source.messages(map_topics(path)), maxlen=count))


def mean_cells(path: Path) -> float:
    """Return how many cells the maps of a recording have, on average."""
    with open_source(path) as source:
        sizes = [len(raw.data) for raw in source.messages(map_topics(path))]
    return sum(sizes) / len(sizes)
