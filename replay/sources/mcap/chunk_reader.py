"""The messages at places of an MCAP file that are known, from the chunks that are held for them."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from itertools import chain

from replay.sources.chunks import ChunkCache
from replay.sources.mcap.chunk import chunk_content, cut_chunk_content
from replay.sources.mcap.index import NO_CHUNK, Entry
from replay.sources.mcap.record_file import RecordFile
from replay.sources.mcap.records import CHUNK, BadPart, message_data, message_header_at


class IndexLiesError(Exception):
    """An index says something else than is there."""


class ChunkReader:
    """The messages of a file, of which a few chunks are held at a time.

    Parameters
    ----------
    entries
        The messages that will be asked for, once each.
    begins_ns
        When the first message of each chunk was recorded, if only indexes say what is in the chunks; else None. What
        they claim is checked when a chunk is loaded. No message of a later time may be used before that, because a
        claim that is wrong may hide an earlier one.
    cut_chunk
        The chunk at which the file was cut off.
    """

    def __init__(
        self,
        file: RecordFile,
        entries: Collection[Entry],
        begins_ns: Mapping[int, int] | None = None,
        cut_chunk: int | None = None,
    ) -> None:
        self._file = file
        self._cut_chunk = cut_chunk
        self._bad: set[int] = set()
        self._claims: dict[int, list[Entry]] = {}
        for entry in () if begins_ns is None else entries:
            self._claims.setdefault(entry.block, []).append(entry)
        begins = ((begin_ns, block) for block, begin_ns in (begins_ns or {}).items() if block in self._claims)
        self._unchecked = sorted(begins, reverse=True)
        # a chunk is asked for once for each of its messages, and once to be checked
        inside = (entry.block for entry in entries if entry.inner != NO_CHUNK)
        uses = chain(inside, (block for _, block in self._unchecked))
        self._held = ChunkCache(self._loaded, uses, file.most_bytes)

    def begun(self, time_ns: int) -> Iterator[int]:
        """Yield the chunks that begin by this time, each once."""
        while self._unchecked and self._unchecked[-1][0] <= time_ns:
            yield self._unchecked.pop()[1]

    def check(self, block: int) -> None:
        """Hold what is claimed of a chunk against what is in it.

        Raises
        ------
        BadPart
            If it is found to be bad.
        IndexLiesError
            If it has not what is claimed of it.
        """
        if block not in self._bad:
            self._content(block)

    def data(self, entry: Entry) -> bytes | None:
        """Return the data of a message; None if it is in a chunk that is known to be bad.

        Raises
        ------
        BadPart
            If its chunk is found to be bad.
        IndexLiesError
            If its chunk has not what is claimed of it.
        """
        if entry.inner == NO_CHUNK:
            return self._checked(self._file.record_bytes(entry.block), 0)
        if entry.block in self._bad:
            return None
        return self._checked(self._content(entry.block), entry.inner)

    def _content(self, block: int) -> bytes:
        try:
            return self._held[block]
        except BadPart:
            self._bad.add(block)
            raise

    def _checked(self, container: bytes, start: int) -> bytes:
        """Return the data of the message that was found at a byte before."""
        data = message_data(container, start)
        if data is None:
            raise ValueError("it changed while it was read")
        return data

    def _loaded(self, start: int) -> bytes:
        """Return what is in a chunk."""
        if start == self._cut_chunk:
            return cut_chunk_content(self._file, start)
        claims = self._claims.get(start, ())
        record = self._file.record_at(start)
        if claims and (record is None or record.opcode != CHUNK):
            raise IndexLiesError
        content, _ = chunk_content(self._file, start)
        for entry in claims:
            header = message_header_at(content, entry.inner)
            if header is None or header.channel != entry.channel or header.log_time_ns != entry.log_time_ns:
                raise IndexLiesError
        return content
