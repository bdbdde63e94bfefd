"""What a pass through a ROS 1 bag finds, record by record: for bags without an index that can be trusted.

Chunks stay where they are and are decompressed one at a time. The index that follows each chunk is used as a witness:
it says how many messages there should be, and when each was recorded.
"""

from __future__ import annotations

from array import array
from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import replace

from replay.skip_cause import SkipCause
from replay.sources.base import DECODED_TYPES
from replay.sources.lapses import Place, Written
from replay.sources.losses import Loss, Losses
from replay.sources.rosbag1.chunk_places import SURE_OUTER, chunk_place, is_unfinished_at
from replay.sources.rosbag1.chunks import ChunkPlace, read_chunk, records_in
from replay.sources.rosbag1.contents import BagFile, Entry, Topic, normalised_topic
from replay.sources.rosbag1.open_chunk import OpenChunk
from replay.sources.rosbag1.records import (
    CHUNK,
    CHUNK_INFO,
    CONNECTION,
    INDEX,
    MESSAGE,
    Record,
    fields_of,
    find_of,
    index_rows,
    index_section,
    record_of,
)
from replay.sources.topics import normalised_type

_MOST_DEFINITION_BYTES = 1 << 24


class Scan:
    """What a pass through a bag found.

    Parameters
    ----------
    losses
        Takes what cannot be used.
    most_bytes
        How many bytes a chunk may have, decompressed.
    kept
        Connections whose messages are asked for, beside maps and transforms: of others it is not kept where they are.

    Attributes
    ----------
    is_cut
        Whether the file ends within a record.
    """

    def __init__(self, file: BagFile, losses: Losses, most_bytes: int, kept: Collection[int] = ()) -> None:
        self.topics: dict[int, Topic] = {}
        self.chunks: dict[int, ChunkPlace] = {}
        self.is_cut = file.size <= file.start
        # what is written when all chunks are
        self._has_all_chunks = 0 < file.index_pos <= file.size
        self._index_pos = file.index_pos
        self._cut_at = file.size
        self._size = file.size
        self._file = file.file
        self._losses = losses
        # what is lost from one place until before another; when it was recorded is known at the end
        self._lost: list[tuple[Loss, Place, Place]] = []
        self._most_bytes = most_bytes
        self._bag = file
        self._kept = frozenset(kept)
        # time, chunk and place in it of each message, in turn, by connection
        self._found: dict[int, array[int]] = {}
        self._counts: Counter[int] = Counter()
        self._times_ns: dict[int, tuple[int, int]] = {}
        self._contradictory: set[int] = set()
        self._open: OpenChunk | None = None
        self._listed_chunks: set[int] = set()
        self._pass(file.start)
        self._finish_chunk()
        # which the pass may have missed while it looked for the next record
        for record in index_section(file.file, file.index_pos if self._has_all_chunks else 0):
            if record.end <= file.size:
                self._take(record)
        self._name_losses()
        self._name_missing_chunks()
        self._drop_unknown()

    @property
    def lost_at_end(self) -> int | None:
        """How many messages are lost because the file ends early; None if that cannot be told."""
        return 0 if self._has_all_chunks and self._cut_at >= self._index_pos else None

    def counts(self) -> Mapping[int, int]:
        """Return how many messages each connection has."""
        return self._counts

    def times_ns(self) -> tuple[int, int] | None:
        """Return the times of the first and last message; None if there is none."""
        spans = self._times_ns.values()
        return (min(start for start, _ in spans), max(stop for _, stop in spans)) if spans else None

    def entries(self, connections: Collection[int]) -> list[Entry]:
        """Return where the messages of these connections are, sorted; of such as are not kept, by another pass."""
        asked = {key for key in connections if key in self._counts}
        missing = {key for key in asked if len(self._found.get(key, ())) // 3 != self._counts[key]}
        found = [
            Entry(rows[at], rows[at + 1], rows[at + 2], key)
            for key in asked - missing
            for rows in (self._found[key],)
            for at in range(0, len(rows), 3)
        ]
        if missing:
            found += Scan(self._bag, Losses(), self._most_bytes, missing).entries(missing)
        return sorted(found)

    def _pass(self, start: int) -> None:
        """Go through the records of the file."""
        while start < self._size:
            record = record_of(self._file, start)
            if record is not None and record.op == CHUNK:
                start = self._take_chunk(record)
            elif record is not None and record.op != MESSAGE and record.end <= self._size:
                self._take(record)
                start = record.end
            else:
                following = self._after_damage(start, record)
                if following is None:
                    return
                start = following

    def _after_damage(self, start: int, record: Record | None) -> int | None:
        """Return where the pass goes on after what is no record, or none that ends in the file; None if it is over."""
        following = find_of(self._file, start + 1, SURE_OUTER)
        is_cut = is_unfinished_at(self._file, self._size, start) if record is None else record.end > self._size
        # Bytes that were reserved for a recording and never written are zero.
        if following is None and (is_cut or not any(self._bytes(start, 64))):
            self.is_cut = True
            self._cut_at = start
        else:
            self._finish_chunk()
            until = "to the end of the file" if following is None else f"up to byte {following}"
            detail = f"there is no record of a bag {until}"
            stop = self._size if following is None else following
            self._lost.append((Loss(SkipCause.DAMAGED, f"byte {start}", detail), (start, 0), (stop, 0)))
        return following

    def _bytes(self, start: int, length: int) -> bytes:
        self._file.seek(start)
        return self._file.read(length)

    def _take(self, record: Record) -> None:
        """Take what a record says that is no chunk."""
        if record.op == INDEX and self._open is not None:
            rows = list(index_rows(self._bytes(record.data, record.end - record.data)))
            self._open.take_index(record.number(b"conn"), rows)
        elif record.op == CONNECTION and record.end - record.data <= _MOST_DEFINITION_BYTES:
            self._connect(record, self._bytes(record.data, record.end - record.data))
        elif record.op == CHUNK_INFO:
            self._listed_chunks.add(record.number(b"chunk_pos"))

    def _connect(self, record: Record, data: bytes) -> None:
        """Take in what a connection is; one that two records describe differently is not used."""
        fields = fields_of(data) or {}
        texts = [fields.get(name, b"").decode("utf-8", "replace") for name in (b"type", b"message_definition")]
        name = normalised_topic(record.fields[b"topic"].decode("utf-8", "replace"))
        topic = Topic(name, normalised_type(texts[0]), texts[1])
        key = record.number(b"conn")
        if self.topics.setdefault(key, topic) != topic:
            self._contradictory.add(key)

    def _take_chunk(self, record: Record) -> int:
        """Take the messages of a chunk; return where the pass goes on."""
        self._finish_chunk()
        place = chunk_place(self._file, self._size, record)
        self.chunks[place.start] = place
        self.is_cut = self.is_cut or (place.is_cut and place.end == self._size)
        chunk = read_chunk(self._file, place, self._most_bytes)
        found = self._open = OpenChunk(place, chunk.problem)
        for each in records_in(chunk.records, place):
            if each is None:
                found.gaps.append(len(found.entries))
            elif each.op == MESSAGE:
                found.entries.append(Entry(each.time_ns, place.start, each.start, each.number(b"conn")))
            else:
                self._connect(each, chunk.records[each.data : each.end])
        return place.end

    def _finish_chunk(self) -> None:
        """Keep what was found in a chunk, once all that its index says of it is known."""
        if self._open is None:
            return
        found, self._open = self._open, None
        loss = found.finished()
        if loss is not None:
            self._lost.append((loss, *found.lost_between()))
        for entry in found.entries:
            self._count(entry)

    def _count(self, entry: Entry) -> None:
        """Count a message, and keep where it is if that may be asked for."""
        time_ns, key = entry.log_time_ns, entry.connection
        first_ns, last_ns = self._times_ns.get(key, (time_ns, time_ns))
        self._times_ns[key] = min(first_ns, time_ns), max(last_ns, time_ns)
        self._counts[key] += 1
        topic = self.topics.get(key)
        # of a connection that is not known yet, it may be
        if topic is None or topic.msgtype in DECODED_TYPES or key in self._kept:
            self._found.setdefault(key, array("Q")).extend(entry[:3])

    def _name_losses(self) -> None:
        rows_of = self._found.values()
        places = (((rows[at + 1], rows[at + 2]), rows[at]) for rows in rows_of for at in range(0, len(rows), 3))
        written = Written(places) if self._lost else Written(())
        for loss, start, stop in self._lost:
            self._losses.add(replace(loss, lapse=written.between(start, stop)))

    def _name_missing_chunks(self) -> None:
        """Name chunks that the index lists and the pass did not meet, unless something else may have been these.

        Where bytes are missing in the file, one chunk may end where another one should, and that is whole to look at.
        """
        missing = len(self._listed_chunks) - len(self.chunks)
        if missing > 0 and all(loss.messages is not None for loss in self._losses.all):
            detail = f"it lists {len(self._listed_chunks)} chunks, {len(self.chunks)} were found"
            self._losses.add(Loss(SkipCause.DAMAGED, "the index", detail))

    def _drop_unknown(self) -> None:
        """Leave out the messages of which nothing, or nothing that can be trusted, says what they are."""
        for key, count in sorted(self.counts().items()):
            if key not in self.topics:
                detail = "no record says what these messages are"
            elif key in self._contradictory:
                detail = "two records say differently what these messages are"
            else:
                continue
            del self._counts[key], self._times_ns[key]
            self._found.pop(key, None)
            self._losses.add(Loss(SkipCause.DAMAGED, f"connection {key}", detail, count))
        for key in self._contradictory:
            del self.topics[key]
