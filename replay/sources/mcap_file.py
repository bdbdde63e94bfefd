"""MCAP files of ROS 1, ROS 2 or no profile: ``.mcap``."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from contextlib import ExitStack
from pathlib import Path

from replay.errors import InputError
from replay.sources.base import RawMessage, SourceInfo
from replay.sources.boundary import TEXT_MODE, Closing, translated
from replay.sources.chunks import ChunkCache
from replay.sources.losses import Losses
from replay.sources.mcap_index import NO_CHUNK, Entry, Scan, indexed_entries, read_summary, scan
from replay.sources.mcap_records import (
    MAGIC,
    Channel,
    RecordFile,
    damaged_chunk,
    foreign_errors,
    message_at,
)
from replay.sources.topics import ENCODINGS, topic_table
from replay.sources.zstd import decompressed_cdr

# What is left of the magic bytes after line endings were converted, or bytes that are no text were replaced.
_MAGIC_IN_TEXT_MODE = (b"\x89MCAP0\n", b"\x89MCAP0\r\r\n", b"\xef\xbf\xbdMCAP0")


class McapFile(Closing):
    """An MCAP file, whichever of chunks, compression, indexes and summary it has.

    Without a complete summary and message indexes the file is read twice: once to find the maps, once to read them.

    Parameters
    ----------
    copy_of
        The file of which ``path`` is a decompressed copy, to be named in errors.
    map_scan
        What the `map_scan` of this same file was when it was open before, so that its maps are not looked for again.

    Attributes
    ----------
    map_scan
        What a pass through the file found of its maps; None as long as no pass was needed.
    """

    def __init__(self, path: Path, copy_of: Path | None = None, map_scan: Scan | None = None) -> None:
        self.path = copy_of or path
        self.losses = Losses()
        with ExitStack() as stack, translated(self.path, foreign_errors()):
            file = stack.enter_context(path.open("rb"))
            if file.read(len(MAGIC)) != MAGIC:
                raise InputError(f"{self.path}: it begins like an MCAP file {TEXT_MODE}")
            self._file = RecordFile(self.path, file, path.stat().st_size)
            self._summary = read_summary(self._file)
            self.map_scan = map_scan
            self._contents = self._summary.contents if self._summary else self._scanned().contents
            self._resources = stack.pop_all()

    @classmethod
    def recognises(cls, path: Path, head: bytes) -> bool:
        """Tell whether this is an MCAP file, readable or not."""
        del path
        return head.startswith((MAGIC, *_MAGIC_IN_TEXT_MODE))

    @property
    def info(self) -> SourceInfo:
        """What the file holds."""
        contents = self._contents
        rows = ((each.topic, each.msgtype, contents.counts.get(key, 0)) for key, each in contents.channels.items())
        return SourceInfo("mcap", contents.start_ns, contents.stop_ns, topic_table(rows))

    def messages(self, topics: Collection[str]) -> Iterator[RawMessage]:
        """Yield the messages of these topics in order of log time, ties in the order in which they were written."""
        with translated(self.path, foreign_errors()):
            wanted = {key: each for key, each in self._contents.channels.items() if each.topic in topics}
            self._check_encodings(wanted)
            chunks = ChunkCache(self._file.chunk)
            entries = self._entries(wanted)
            left = Counter(entry.block for entry in entries)
            for entry in entries:
                channel = wanted[entry.channel]
                encoding = ENCODINGS[channel.encoding]
                data = self._data(entry, chunks)
                left[entry.block] -= 1
                if not left[entry.block]:
                    chunks.forget(entry.block)
                if encoding == "cdr":
                    data = decompressed_cdr(data)
                yield RawMessage(channel.topic, channel.msgtype, encoding, entry.log_time_ns, data)

    def close(self) -> None:
        """Close the file."""
        self._resources.close()

    def _check_encodings(self, wanted: Mapping[int, Channel]) -> None:
        for channel in wanted.values():
            if channel.encoding not in ENCODINGS:
                raise InputError(
                    f"{self.path}: topic {channel.topic} is encoded as '{channel.encoding}'; "
                    f"{' or '.join(ENCODINGS)} is read: convert the recording, or choose another topic"
                )

    def _entries(self, wanted: Mapping[int, Channel]) -> tuple[Entry, ...]:
        """Return where the messages of these channels are, sorted."""
        channels = set(wanted.values())
        only_maps = all(channel.is_map for channel in channels)
        if self._summary and not (only_maps and self.map_scan):
            found = indexed_entries(self._file, self._summary, wanted)
            if found is not None:
                return found
        if not only_maps:
            return scan(self._file, lambda channel: channel in channels).entries
        known = self._scanned()
        # By what the pass found, not by the keys of the summary, which may lack one: no message is left out in silence.
        return tuple(entry for entry in known.entries if known.contents.channels[entry.channel] in channels)

    def _scanned(self) -> Scan:
        """Return what a pass through the file finds of its maps. It is made once, whatever is asked for first."""
        if self.map_scan is None:
            self.map_scan = scan(self._file, lambda channel: channel.is_map)
        return self.map_scan

    def _data(self, entry: Entry, chunks: ChunkCache) -> bytes:
        """Return the data of a message, once its record proves to be the one looked for."""
        if entry.inner == NO_CHUNK:
            container, start = self._file.record_bytes(entry.block), 0
        else:
            container, start = chunks[entry.block], entry.inner
        message = message_at(container, start)
        if message is None or message[0].channel != entry.channel or message[0].log_time_ns != entry.log_time_ns:
            raise damaged_chunk(self.path, entry.block, "its index points to another message, or to none")
        return message[1]
