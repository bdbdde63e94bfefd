"""What a run will read: its inputs, robots, clocks and frames. `info` shows it, `merge` runs it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from replay.events import RobotInput
from replay.feeds import Feed, Tally, Window
from replay.sources.base import GRID_TYPE, UPDATE_TYPE, Source, SourceInfo

MERGED_FRAME = "merged"


@dataclass(frozen=True, slots=True)
class Plan:
    """A run that was understood and can begin.

    Parameters
    ----------
    infos
        What each input holds.
    robots
        The robots, the reference first.
    feeds
        What is read from each input.
    window
        Which times are used.
    map_frames
        Each robot's map frame as recorded, its leading slash stripped; None without a usable map.
    transform_feeds
        Which transforms are read; None if none are to be used.
    mapped
        The robots of which there is a map that can be used.
    feeds_of_transforms
        Returns what is read of the transforms of one input, opened once more, given its index: for who looks on.
    said_of
        Of each input, the robot that it was said to be of; None where that was not said.
    """

    infos: tuple[SourceInfo, ...]
    robots: tuple[RobotInput, ...]
    feeds: tuple[Feed, ...]
    window: Window
    map_frames: Mapping[str, str | None]
    transform_feeds: tuple[Feed, ...] | None
    mapped: frozenset[str]
    feeds_of_transforms: Callable[[int, Source], tuple[Feed, ...]]
    said_of: tuple[str | None, ...]

    def input_bytes(self, index: int) -> int:
        """Return how large an input is."""
        return _size_bytes(self.feeds[index].source.path)

    def files(self) -> list[Path]:
        """Return the files that are read."""
        return [path for feed in self.feeds for path in feed.source.files]

    def recordings_with_transforms(self) -> list[Source] | None:
        """Return the recordings whose transforms are read; None if none are to be used."""
        if self.transform_feeds is None:
            return None
        return list(dict.fromkeys(feed.source for feed in self.transform_feeds))

    def unused_topics(self) -> list[str]:
        """Return the map topics with messages that are no robot's in this run, in order of name.

        Updates of parts of maps are named where their map is not there; else its own name tells of them.
        """
        used = {topic for feed in self.feeds for topic in feed.robot_of}
        there = {item.name for info in self.infos for item in info.topics if item.msgtype == GRID_TYPE}
        updates = {item.name for info in self.infos for item in info.topics if item.msgtype == UPDATE_TYPE}
        there |= {name for name in updates if name.removesuffix("_updates") not in there}
        empty = {item.name for info in self.infos for item in info.topics if item.message_count == 0}
        return sorted(there - used - empty)

    def describe_inputs(self, tallies: tuple[Tally, ...] | None = None) -> tuple[Mapping[str, Any], ...]:
        """Return what is said of the inputs in reports; counts and digests only once all was read.

        Parameters
        ----------
        tallies
            Of the feeds and then of the feeds of transforms.
        """
        read = tallies or (None,) * (len(self.feeds) + len(self.transform_feeds or ()))
        transforms = list(zip(self.transform_feeds or (), read[len(self.feeds) :], strict=True))
        return tuple(
            {
                "name": feed.source.path.name,
                "format": info.format,
                "size_bytes": _size_bytes(feed.source.path),
                "said_of": said_of,
                "robots": sorted(set(feed.robot_of.values())),
                "clocks": dict(sorted(feed.clocks.items())),
                "offsets_ns": dict(sorted(feed.offsets_ns.items())),
                **_read(tally),
                "until_ns": tally.until_ns if tally else None,
                "late": tally.late if tally else None,
                "bad_stamps": tally.bad_stamps if tally else None,
                "transforms": {
                    topic: _read(taken)
                    for each, taken in transforms
                    if each.source is feed.source
                    for topic in each.robot_of
                },
            }
            for feed, info, said_of, tally in zip(
                self.feeds, self.infos, self.said_of, read[: len(self.feeds)], strict=True
            )
        )


def _read(tally: Tally | None) -> dict[str, Any]:
    return {
        "messages": tally.messages if tally else None,
        "sha256": tally.digest.hexdigest() if tally else None,
    }


def _size_bytes(path: Path) -> int:
    if path.is_dir():
        return sum(file.stat().st_size for file in path.iterdir() if file.is_file())
    return path.stat().st_size
