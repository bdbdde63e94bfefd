"""The few decompressed chunks of a recording that are held in memory."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable

HELD_CHUNKS = 4


class ChunkCache:
    """Keeps the chunks used last.

    Messages are read in order of time, and chunks overlap in time where several robots were recorded, so that a few
    chunks are needed in turn.

    Parameters
    ----------
    load
        Returns the chunk at an offset of the file.
    """

    def __init__(self, load: Callable[[int], bytes]) -> None:
        self._load = load
        self._chunks: OrderedDict[int, bytes] = OrderedDict()

    def __len__(self) -> int:
        return len(self._chunks)

    def forget(self, offset: int) -> None:
        """Let go of a chunk that is not needed any more; of one that is not held, nothing."""
        self._chunks.pop(offset, None)

    def __getitem__(self, offset: int) -> bytes:
        chunk = self._chunks.get(offset)
        if chunk is None:
            while len(self._chunks) >= HELD_CHUNKS:
                self._chunks.popitem(last=False)
            chunk = self._chunks[offset] = self._load(offset)
        self._chunks.move_to_end(offset)
        return chunk
