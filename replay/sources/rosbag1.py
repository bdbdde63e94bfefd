"""ROS 1 bags, version 2.0: ``.bag``."""

from __future__ import annotations

import functools
from collections.abc import Collection, Iterator
from contextlib import ExitStack
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, NamedTuple

from replay.errors import InputError
from replay.sources.base import RawMessage, SourceInfo
from replay.sources.boundary import COMMON, TEXT_MODE, Closing, translated
from replay.sources.chunks import ChunkCache
from replay.sources.losses import Losses
from replay.sources.topics import topic_table

if TYPE_CHECKING:
    from rosbags.rosbag1 import Reader

_MAGIC = b"#ROSBAG V"
_MAGIC_BEFORE_2_0 = b"#ROSRECORD V"
# So many CR bytes, each followed by LF by chance once in 256, come without a single CR LF in 2 of 100 files.
_TELLING_CR_COUNT = 1000


class _Entry(NamedTuple):
    """Where a message is; sorts by time, then as written."""

    log_time_ns: int
    chunk: int
    inner: int
    connection: int


@functools.cache
def _foreign() -> tuple[type[Exception], ...]:
    from rosbags.rosbag1 import ReaderError

    return (*COMMON, ReaderError)


class Rosbag1File(Closing):
    """A ROS 1 bag. rosbags reads its index; chunks are decompressed one by one, as their messages are asked for."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.losses = Losses()
        with ExitStack() as stack, translated(path, _foreign()):
            self._file = stack.enter_context(path.open("rb"))
            _check_header(path, self._file)
            self._reader = _indexed(path)
            stack.callback(self._reader.close)
            self._resources = stack.pop_all()

    @classmethod
    def recognises(cls, path: Path, head: bytes) -> bool:
        """Tell whether this is a ROS 1 bag, readable or not."""
        del path
        return head.startswith((_MAGIC, _MAGIC_BEFORE_2_0))

    @property
    def info(self) -> SourceInfo:
        """What the bag holds, from its index."""
        reader = self._reader
        empty = not any(reader.indexes.values())
        return SourceInfo(
            "rosbag1",
            None if empty else reader.start_time,
            None if empty else reader.end_time - 1,
            topic_table((each.topic, each.msgtype, each.msgcount) for each in reader.connections),
        )

    def messages(self, topics: Collection[str]) -> Iterator[RawMessage]:
        """Yield the messages of these topics in order of log time, ties in the order in which they were written."""
        with translated(self.path, _foreign()):
            wanted = {each.id: each for each in self._reader.connections if each.topic in topics}
            entries = sorted(
                _Entry(each.time, each.chunk_pos, each.offset, connection)
                for connection in wanted
                for each in self._reader.indexes[connection]
            )
            chunks = ChunkCache(self._chunk)
            for entry in entries:
                connection = wanted[entry.connection]
                data = self._data(chunks[entry.chunk], entry)
                yield RawMessage(connection.topic, connection.msgtype, "ros1", entry.log_time_ns, data)

    def close(self) -> None:
        """Close the file."""
        self._resources.close()

    def _chunk(self, offset: int) -> bytes:
        """Return a chunk's records."""
        from rosbags.rosbag1.reader import Header, RecordType

        with translated(self.path, _foreign(), part=f"the chunk at byte {offset}"):
            self._file.seek(offset)
            size = Header.read(self._file, RecordType.CHUNK).get_uint32("size")
            chunk = self._reader.chunks[offset]
            self._file.seek(chunk.datapos)
            records = chunk.decompressor(self._file.read(chunk.datasize))
        # The only check there is of a chunk that is not compressed, or was compressed without a checksum.
        if len(records) != size:
            raise InputError(
                f"{self.path}: the chunk at byte {offset} is damaged: it has {len(records)} bytes, not {size}; "
                "copy the recording again from where it was made"
            )
        return records

    def _data(self, chunk: bytes, entry: _Entry) -> bytes:
        """Return the data of the message record that the index points to."""
        from rosbags.rosbag1.reader import Header, RecordType, read_bytes, read_uint32

        with translated(self.path, _foreign(), part=f"a message in the chunk at byte {entry.chunk}"):
            records = BytesIO(chunk)
            records.seek(entry.inner)
            header = Header.read(records)
            # Some writers point to the connection record that precedes the first message of a connection.
            while header.get_uint8("op") == RecordType.CONNECTION:
                read_bytes(records, read_uint32(records))
                header = Header.read(records)
            found = (header.get_uint8("op"), header.get_uint32("conn"), header.get_time("time"))
            expected = (RecordType.MSGDATA, entry.connection, entry.log_time_ns)
            if found != expected:
                raise InputError(
                    f"{self.path}: the index does not fit the chunk at byte {entry.chunk}: found {found}, "
                    f"expected {(int(expected[0]), *expected[1:])} as (op, conn, time); "
                    "rebuild the index of a copy with `rosbag reindex`"
                )
            return read_bytes(records, read_uint32(records))


def _check_header(path: Path, file: BinaryIO) -> None:
    """Refuse what rosbags refuses, with the remedy."""
    from rosbags.rosbag1.reader import Header, RecordType

    magic = file.readline(32)
    version = magic.decode("ascii", "replace").strip()
    if magic.startswith(_MAGIC_BEFORE_2_0):
        raise InputError(
            f"{path}: this bag has the format '{version}' of before 2010; version 2.0 is read: "
            "convert it with the ROS 1 tools, `rosbag fix OLD.bag NEW.bag`"
        )
    if magic.endswith(b"\r\n"):
        raise InputError(f"{path}: its first line ends in CR LF, {TEXT_MODE}")
    if version != "#ROSBAG V2.0":
        raise InputError(f"{path}: this bag has the format '{version}'; version 2.0 is read: convert it with `rosbag`")
    index_pos = Header.read(file, RecordType.BAGHEADER).get_uint64("index_pos")
    size = path.stat().st_size
    if index_pos == 0:
        raise InputError(
            f"{path}: the bag has no index, because its recording was not ended properly; "
            "rebuild the index of a copy with `rosbag reindex`"
        )
    if index_pos > size:
        raise InputError(
            f"{path}: the file ends early at byte {size}: its index should begin at byte {index_pos}; "
            "copy it again, or rebuild the index of a copy with `rosbag reindex`"
        )


def _indexed(path: Path) -> Reader:
    """Return an open reader, which has read the index."""
    from rosbags.rosbag1 import Reader

    reader = Reader(path)
    try:
        reader.open()
    except _foreign() as error:
        if isinstance(error, OSError):
            raise
        found = " ".join(str(error).split()) or "an index record has not the size that its count calls for"
        cause = f"it holds not one CR LF, {TEXT_MODE}; else" if _lost_line_endings(path) else "copy it again, or"
        raise InputError(
            f"{path}: the index of this bag is damaged ({found}): {cause} rebuild the index of a copy with "
            "`rosbag reindex`"
        ) from error
    return reader


def _lost_line_endings(path: Path) -> bool:
    """Tell whether a file holds no CR LF although chance alone would have put some there."""
    cr_count, last = 0, b""
    with path.open("rb") as file:
        while block := file.read(1 << 20):
            if b"\r\n" in last + block:
                return False
            cr_count += block.count(b"\r")
            last = block[-1:]
    return cr_count >= _TELLING_CR_COUNT
