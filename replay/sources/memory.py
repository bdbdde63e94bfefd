"""How much of a recording may be in memory at once: one chunk, or one message."""

from __future__ import annotations

MOST_BYTES = 1 << 30
"""The largest message, or decompressed chunk, that is read where nothing else is said."""


class TooLargeError(Exception):
    """A message has, or would decompress to, more than is read at once."""

    def __init__(self, most_bytes: int) -> None:
        super().__init__(over_memory(most_bytes))


MORE_ALLOWED = "; a larger --max-memory allows more"
"""What is said to those who can say how much is read at once."""


def over_memory(most_bytes: int) -> str:
    """Return what is said of a chunk or message that has, or would decompress to, more than this."""
    return f"it has more than {most_bytes} bytes, the most that is read at once{MORE_ALLOWED}"
