"""Chunks without a checksum, of whose last message bytes may be missing.

If as many bytes of a chunk are missing as a message index has, the index behind it is taken for its end, and the next
record follows all the same. So what tells is whether all indexes are there that should be.
"""

from __future__ import annotations

from replay.sources.mcap.chunk import Inside
from replay.sources.mcap.record_file import RecordFile, indexes_behind
from replay.sources.mcap.records import Record
from replay.sources.mcap.walk import Walk


class ChunkEnds:
    """The ends of chunks that no checksum covers, as far as a pass through a file has come."""

    def __init__(self, file: RecordFile) -> None:
        self._file = file
        self._has_indexes = False
        # of chunks that have not all of their indexes: where the last record in them begins, and where in the file
        # those indexes end that there are
        self._without_index: dict[int, tuple[int, int]] = {}

    def add(self, record: Record, inside: Inside) -> None:
        """Take in a chunk, and whether it has all message indexes behind it."""
        indexed, end = indexes_behind(self._file, record.end)
        self._has_indexes |= bool(indexed)
        if indexed.keys() < inside.channels:
            self._without_index[record.start] = inside.last_record, end

    def doubtful(self, walk: Walk) -> dict[int, int]:
        """Return where the last message is of chunks that have not all indexes though there are some, by chunk.

        Where the file ends behind a chunk, indexes may be missing that were never written.
        """
        if not self._has_indexes:
            return {}
        ends = {walk.ends_early, self._file.size, self._file.written}
        return {block: inner for block, (inner, end) in self._without_index.items() if end not in ends}
