"""The decompressed chunks of a recording that are held in memory, because they are needed again."""

from __future__ import annotations

from collections import Counter, OrderedDict
from collections.abc import Callable, Iterable

FEW_CHUNKS = 4
"""So many are held, however large they are."""

MOST_HELD_BYTES = 1 << 27
"""More are held as long as they have no more than this together."""


class ChunkCache:
    """Holds chunks until the last message of each was asked for.

    Messages are read in order of time, and chunks overlap in time where several robots were recorded, so that a few
    chunks are needed in turn. If these are too large to be held, it is the one used last that is let go of: those used
    before it are needed sooner.

    Parameters
    ----------
    load
        Returns the chunk at an offset of the file.
    uses
        The offset of the chunk of each message that will be asked for.
    most_bytes
        How large the chunks are together, at most, of which more than a few are held.
    """

    def __init__(self, load: Callable[[int], bytes], uses: Iterable[int], most_bytes: int = MOST_HELD_BYTES) -> None:
        self._load = load
        self._left = Counter(uses)
        self._most_bytes = min(most_bytes, MOST_HELD_BYTES)
        self._chunks: OrderedDict[int, bytes] = OrderedDict()
        self._held_bytes = 0

    def __len__(self) -> int:
        return len(self._chunks)

    def __getitem__(self, offset: int) -> bytes:
        """Return the chunk at an offset, for one message."""
        chunk = self._chunks.pop(offset, None)
        if chunk is None:
            self._make_room()
            chunk = self._load(offset)
        else:
            self._held_bytes -= len(chunk)
        self._left[offset] -= 1
        if self._left[offset] > 0:
            self._chunks[offset] = chunk
            self._held_bytes += len(chunk)
        else:
            del self._left[offset]
        return chunk

    def _make_room(self) -> None:
        """Let go of chunks that are too many before another one is loaded."""
        while len(self._chunks) >= FEW_CHUNKS and self._held_bytes > self._most_bytes:
            _, chunk = self._chunks.popitem()
            self._held_bytes -= len(chunk)
