"""Of a recording's transforms as many as are looked at: to decode them all is what takes time."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from pathlib import Path
from types import TracebackType
from typing import Self

from replay.sources.base import RawMessage, Source, SourceInfo
from replay.tracker import INTERVAL_NS

# Of a message: how many there are, a sequence number or what CDR begins with, a stamp, and then the first frame's name.
_FRAME_AT, _LENGTH = 16, 4
_LONGEST_FRAME = 256
_MOST_PUBLISHERS = 1000


class Thinned:
    """A recording of whose transforms ten a second of each publisher are read: decoding them is what takes time.

    Who published a message is told from its length and from the first two frames in it, which stand at the same place
    whatever recorded them.
    """

    def __init__(self, source: Source) -> None:
        self._source = source
        self._last_ns: dict[tuple[str, int, bytes], int] = {}
        self.path, self.losses = source.path, source.losses

    @property
    def files(self) -> tuple[Path, ...]:
        """Those of the recording."""
        return self._source.files

    @property
    def info(self) -> SourceInfo:
        """What the recording holds."""
        return self._source.info

    def close(self) -> None:
        """Close the recording."""
        self._source.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def messages(self, topics: Collection[str]) -> Iterator[RawMessage]:
        """Yield messages as the recording does, without those that follow too soon."""
        for raw in self._source.messages(topics):
            key = raw.topic, len(raw.data), _first_frames(raw.data, raw.encoding == "cdr")
            since_ns = raw.log_time_ns - self._last_ns.get(key, -INTERVAL_NS)
            if 0 <= since_ns < INTERVAL_NS:
                continue
            if len(self._last_ns) > _MOST_PUBLISHERS:
                self._last_ns.clear()
            self._last_ns[key] = raw.log_time_ns
            yield raw


def _first_frames(data: bytes | memoryview, is_cdr: bool) -> bytes:
    """Return the bytes of the first transform's frames in a message, whatever they are."""
    child_at = _FRAME_AT + _LENGTH + _length(data, _FRAME_AT)
    if is_cdr:
        child_at += -child_at % _LENGTH
    return bytes(data[_FRAME_AT : child_at + _LENGTH + _length(data, child_at)])


def _length(data: bytes | memoryview, at: int) -> int:
    return min(int.from_bytes(data[at : at + _LENGTH], "little"), _LONGEST_FRAME)
