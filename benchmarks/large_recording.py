"""Recordings that are larger than memory should be: how much `replay merge` takes, whole and cut off.

    python -m benchmarks.large_recording --work DIR

They are written into ``DIR`` one after the other and removed again, of two kinds: *others*, in which two robots' maps,
which grow, lie between point clouds, which make the bulk, and millions of small messages; and *maps*, which has nothing
else. Each is merged whole, and once more after the end of the file was cut off, and its index with it. What that takes
is compared with a recording of a tenth of the size.
"""

from __future__ import annotations

import argparse
import math
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal

import numpy as np

from benchmarks import flags
from benchmarks.huge_mission import HugeMission
from benchmarks.large_writers import WRITERS, Message
from benchmarks.long_mission import SECOND_NS, START_NS
from benchmarks.made_once import recorded
from benchmarks.speed.child import Ended, replay
from benchmarks.speed.printed import Table, at_most, mebibytes, ratio, seconds
from replay.codec import decode, encode_grid
from replay.messages import GridMessage
from replay.sources import open_source
from replay.sources.base import GRID_TYPE

Kind = Literal["others", "maps"]

SIDES: dict[Kind, int] = {"others": 800, "maps": 2000}
CLOUD_TYPE, IMU_TYPE = "sensor_msgs/msg/PointCloud2", "sensor_msgs/msg/Imu"
CLOUD_BYTES, IMU_BYTES = 1 << 20, 320
CUT_AT = 0.97
MOST_GROWTH = 1.2
_UPDATES = 5
TABLE = Table(24, ("recording", "size", "messages", "maps", "peak", "to a tenth", "wall"))


@dataclass(frozen=True, slots=True)
class Large:
    """What a large recording holds.

    Parameters
    ----------
    kind
        What makes the bulk.
    size_bytes
        About how large it is.
    small
        How many small messages of another topic there are, in *others*.
    """

    kind: Kind
    size_bytes: int
    small: int

    def messages(self, maps: Sequence[Message]) -> Iterator[Message]:
        """Yield its messages in order of time; each map as often as it takes."""
        maps_bytes = sum(len(each.data) for each in maps)
        if self.kind == "maps":
            times = self.size_bytes // maps_bytes + 1
            pairs = zip(maps[::2], maps[1::2], strict=True)
            yield from _in_time((each for pair in pairs for each in pair * times), SECOND_NS)
            return
        cloud = np.random.default_rng(3).bytes(CLOUD_BYTES)
        clouds = (self.size_bytes - maps_bytes - self.small * IMU_BYTES) // CLOUD_BYTES // len(maps) + 1
        yield from _in_time(
            (each for one in maps for each in _with_others(one, cloud, clouds, self.small // len(maps) // clouds)),
            SECOND_NS // 1000,
        )


def _with_others(one: Message, cloud: bytes, clouds: int, imus: int) -> Iterator[Message]:
    """Yield a map and what was recorded until the next one."""
    yield one
    imu = cloud[:IMU_BYTES]
    for _ in range(clouds):
        yield Message("/points", CLOUD_TYPE, 0, cloud)
        for _ in range(imus):
            yield Message("/imu", IMU_TYPE, 0, imu)


def _in_time(messages: Iterator[Message], period_ns: int) -> Iterator[Message]:
    """Give messages their times; each map says when it was made."""
    for number, each in enumerate(messages):
        log_ns = START_NS + number * period_ns
        yield each._replace(log_ns=log_ns, data=_stamped(each.data, log_ns) if each.msgtype == GRID_TYPE else each.data)


def _stamped(cdr: bytes, stamp_ns: int) -> bytes:
    """Return a message with another stamp, which is what it begins with after four bytes."""
    stamp = np.array(divmod(stamp_ns, SECOND_NS), "<u4").tobytes()
    return cdr[:4] + stamp + cdr[4 + len(stamp) :]


def growing_maps(side_cells: int, work: Path) -> list[Message]:
    """Return the maps of two robots, which grow, in turn."""
    with open_source(recorded(HugeMission(side_cells, _UPDATES), work)) as source:
        known = [(raw.topic, decode(raw)) for raw in source.messages([item.name for item in source.info.topics])]
    return [
        Message(topic, GRID_TYPE, 0, bytes(encode_grid(message.grid, f"{topic[1:3]}/map", 0)))
        for topic, message in known
        if isinstance(message, GridMessage)
    ]


def lines(kinds: Sequence[Kind], formats: Sequence[str], size_bytes: int, small: int, work: Path) -> Iterator[str]:
    """Yield the lines of the table and the target as they are measured."""
    yield TABLE.header
    worst = 0.0
    for kind in kinds:
        maps = growing_maps(SIDES[kind], work)
        for name in formats:
            for row in _measured(Large(kind, size_bytes, small), maps, name, work):
                yield row.line
                worst = max(worst, row.growth)
    yield at_most("peak memory, to that of a tenth", worst, MOST_GROWTH)


@dataclass(frozen=True, slots=True)
class _Row:
    """A line of the table, and how many times as much memory it took as a tenth."""

    line: str
    growth: float


def _measured(large: Large, maps: Sequence[Message], name: str, work: Path) -> Iterator[_Row]:
    """Write a recording, merge it whole and cut off, and remove it."""
    path, tenth = work / f"large.{name}", work / f"tenth.{name}"
    WRITERS[name](tenth, replace(large, size_bytes=large.size_bytes // 10, small=large.small // 10).messages(maps))
    base = merged(tenth, work)
    tenth.unlink()
    counted = _Counted()
    WRITERS[name](path, counted.through(large.messages(maps)))
    for state in ("whole", "cut off"):
        if state == "cut off":
            os.truncate(path, int(path.stat().st_size * CUT_AT))
        ended, title = merged(path, work), f"{large.kind}, {name}, {state}"
        if isinstance(ended, str) or isinstance(base, str):
            yield _Row(f"{title}: REFUSED: {ended if isinstance(ended, str) else base}", math.inf)
            continue
        growth = ended.peak_bytes / base.peak_bytes
        size = f"{path.stat().st_size / 2**30:.2f} GiB"
        found = mebibytes(ended.peak_bytes), ratio(growth), seconds(ended.wall_s)
        yield _Row(TABLE.row(title, size, str(counted.messages), str(counted.maps), *found), growth)
    path.unlink()


class _Counted:
    """Counts messages on their way."""

    def __init__(self) -> None:
        self.messages = 0
        self.maps = 0

    def through(self, messages: Iterator[Message]) -> Iterator[Message]:
        """Yield the messages."""
        for each in messages:
            self.messages += 1
            self.maps += each.msgtype == GRID_TYPE
            yield each


def merged(path: Path, work: Path) -> Ended | str:
    """Merge a recording in a process of its own; return what it took, or why it was refused."""
    output = work / "merged.mcap"
    try:
        return replay(["merge", str(path), "-o", str(output), "--no-rrd", "--images", "none", "--force"])
    except RuntimeError as error:
        return " ".join(str(error).partition("replay: error: ")[2].split()) or str(error)
    finally:
        output.unlink(missing_ok=True)


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--work", type=flags.folder, help="folder for the recordings; a temporary one by default")
    parser.add_argument("--kinds", nargs="+", choices=tuple(SIDES), default=tuple(SIDES))
    parser.add_argument("--formats", nargs="+", choices=tuple(WRITERS), default=tuple(WRITERS))
    parser.add_argument("--gib", type=flags.size, default=4.2, help="size of each recording (default: %(default)s)")
    parser.add_argument("--small", type=flags.count, default=2_000_000, help="small messages (default: %(default)s)")
    given = parser.parse_args(arguments)
    if given.work is not None:
        given.work.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(dir=given.work, prefix="large-") as folder:
        for line in lines(given.kinds, given.formats, int(given.gib * 2**30), given.small, Path(folder)):
            print(line, flush=True)


if __name__ == "__main__":
    main()
