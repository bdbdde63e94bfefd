"""Reading a recording's maps and writing the merged ones, and nothing else: what no replay can do without.

MCAP files are read and written with `mcap`, in chunks as `replay` writes them; other recordings are read with
`rosbags`.
"""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from time import process_time

from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from rosbags.highlevel import AnyReader

_CHUNK_BYTES = 4 << 20
MAP_TOPIC = "/merged/map"


def read_s(path: Path, topics: Collection[str]) -> float:
    """Read the messages of some topics, undecoded, and return the processor time in seconds."""
    read = _read_mcap if path.suffix == ".mcap" else _read_bag
    begin = process_time()
    read(path, topics)
    return process_time() - begin


def _read_mcap(path: Path, topics: Collection[str]) -> None:
    with path.open("rb") as stream:
        for _ in make_reader(stream).iter_messages(topics=list(topics)):
            pass


def _read_bag(path: Path, topics: Collection[str]) -> None:
    with AnyReader([path]) as reader:
        for _ in reader.messages([item for item in reader.connections if item.topic in topics]):
            pass


def write_s(merged: Path, path: Path) -> float:
    """Write the merged maps of an output to another file and return the processor time in seconds.

    They are read one after the other, which is not counted.
    """
    spent_s = 0.0
    with merged.open("rb") as source, path.open("wb") as target:
        writer = Writer(target, chunk_size=_CHUNK_BYTES, compression=CompressionType.ZSTD)
        writer.start(profile="ros2", library="")
        schema_id = writer.register_schema("nav_msgs/msg/OccupancyGrid", "ros2msg", b"")
        channel_id = writer.register_channel(MAP_TOPIC, "cdr", schema_id)
        for _, _, message in make_reader(source).iter_messages(topics=[MAP_TOPIC]):
            begin = process_time()
            writer.add_message(channel_id, message.log_time, message.data, message.log_time)
            spent_s += process_time() - begin
        begin = process_time()
        writer.finish()  # type: ignore[no-untyped-call]
    return spent_s + process_time() - begin
