"""What is in a chunk of a ROS 1 bag, held against the index that follows it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass, field

from replay.skip_cause import SkipCause
from replay.sources.lapses import Place
from replay.sources.losses import Loss
from replay.sources.rosbag1.chunks import ChunkPlace, Problem
from replay.sources.rosbag1.contents import Entry


@dataclass(slots=True)
class OpenChunk:
    """What was found in a chunk, and what its index says."""

    place: ChunkPlace
    problem: Problem | None
    entries: list[Entry] = field(default_factory=list)
    gaps: list[int] = field(default_factory=list)
    _contradicted: int = 0
    _indexed: Counter[int] = field(default_factory=Counter)
    _times_ns: dict[tuple[int, int], int] = field(default_factory=dict)

    def take_index(self, connection: int, rows: Collection[tuple[int, int]]) -> None:
        """Take in an index record of this chunk."""
        self._indexed[connection] += len(rows)
        for time_ns, inner in rows:
            self._times_ns[connection, inner] = time_ns

    def finished(self) -> Loss | None:
        """Leave out messages whose time the index contradicts; return what is lost of the chunk."""
        found = len(self.entries)
        self.entries = [each for each in self.entries if not self._is_contradicted(each)]
        contradicted = self._contradicted = found - len(self.entries)
        lost = max(self._indexed.total() - len(self.entries), contradicted)
        if self.problem is not None:
            messages = lost if self._indexed else None
            return Loss(self.problem.cause, self.place.name, self.problem.detail, messages)
        if lost:
            detail = f"its index lists {self._indexed.total()} messages, {len(self.entries)} can be told apart"
            if contradicted:
                detail = f"its index says another time than {contradicted} of its messages"
            return Loss(SkipCause.DAMAGED, self.place.name, detail, lost)
        if self.gaps:
            return Loss(SkipCause.DAMAGED, self.place.name, "not all of it can be told apart as messages")
        return None

    def lost_between(self) -> tuple[Place, Place]:
        """Return from where until before where messages of it are lost."""
        start, stop = (self.place.start, 0), (self.place.start + 1, 0)
        if self._contradicted or not (self.gaps or self.problem):
            return start, stop
        sound = min([*self.gaps, len(self.entries)])
        if sound:
            start = self.place.start, self.entries[sound - 1].inner + 1
        if self.problem is None and self.gaps[-1] < len(self.entries):
            stop = self.place.start, self.entries[self.gaps[-1]].inner
        return start, stop

    def _is_contradicted(self, entry: Entry) -> bool:
        return self._times_ns.get((entry.connection, entry.inner), entry.log_time_ns) != entry.log_time_ns
