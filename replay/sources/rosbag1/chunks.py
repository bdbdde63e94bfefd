"""Chunks of ROS 1 bags: as much of each as can be trusted, one in memory at a time."""

from __future__ import annotations

import bz2
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from typing import BinaryIO, Protocol

from replay.skip_cause import SkipCause
from replay.sources.memory import MOST_BYTES, over_memory
from replay.sources.rosbag1.records import CONNECTION, INDEX, MESSAGE, Record, find_in, is_unfinished, record_in

# What a decompressor is given and what it returns at once: a block of bz2 that takes 50 bytes may hold 46 MB.
_BZ2_BYTES = 1 << 12
_LZ4_BYTES = 1 << 16
_STEP_BYTES = 1 << 18
_MOST_HEADER_BYTES = 1 << 17
_INNER = (MESSAGE, CONNECTION)


@dataclass(frozen=True, slots=True)
class ChunkPlace:
    """Where the data of a chunk is in the file.

    Parameters
    ----------
    size
        How many bytes it has decompressed, as its header says; None if it was never said.
    is_cut
        Whether the file, or its part that is not damaged, ends before the chunk does.
    has_sure_end
        Whether what follows the chunk proves that it ends there.
    """

    start: int
    data: int
    end: int
    compression: str
    size: int | None
    is_cut: bool = False
    has_sure_end: bool = True

    @property
    def name(self) -> str:
        """How losses name it."""
        return f"the chunk at byte {self.start}"


@dataclass(frozen=True, slots=True)
class Problem:
    """Why not all of a chunk can be used."""

    cause: SkipCause
    detail: str


@dataclass(frozen=True, slots=True)
class Chunk:
    """The records of a chunk, as far as they can be trusted, and why there are no more of them."""

    records: bytes
    problem: Problem | None = None


class _Decompressor(Protocol):
    """What those of bz2 and lz4 have in common."""

    @property
    def eof(self) -> bool: ...

    @property
    def needs_input(self) -> bool: ...

    def decompress(self, data: bytes, max_length: int) -> bytes: ...


def read_chunk(file: BinaryIO, place: ChunkPlace, most_bytes: int = MOST_BYTES) -> Chunk:
    """Return the records of a chunk.

    bz2 has a checksum in each of its blocks, so that what precedes a damaged one is used. Of lz4 nothing is used unless
    all of it is sound, because its checksum, if there is one, is at the end; a chunk that the file cuts off is no
    reason to doubt what is there.
    """
    if place.compression == "none":
        return _plain(file, place, most_bytes)
    if place.compression not in {"bz2", "lz4"}:
        return _damaged(f"it is compressed with '{place.compression[:20]}'; none, bz2 and lz4 are read")
    output, error, is_ended = _decompressed(file, place, _limit(place, most_bytes))
    if len(output) > most_bytes:
        return _over_memory(most_bytes)
    problem = _problem(place, len(output), error, is_ended=is_ended)
    if problem is not None and place.compression == "lz4":
        return Chunk(b"", problem)
    return Chunk(output, problem)


def _plain(file: BinaryIO, place: ChunkPlace, most_bytes: int) -> Chunk:
    if place.end - place.data > most_bytes:
        return _over_memory(most_bytes)
    file.seek(place.data)
    records = file.read(place.end - place.data)
    if place.is_cut or len(records) == place.size:
        return Chunk(records)
    return Chunk(records, Problem(SkipCause.DAMAGED, f"it has {len(records)} bytes, not {place.size}"))


def _limit(place: ChunkPlace, most_bytes: int) -> int:
    """Return how many bytes are enough to see that there are too many."""
    return most_bytes if place.size is None else min(most_bytes, place.size)


def _decompressed(file: BinaryIO, place: ChunkPlace, limit: int) -> tuple[bytes, Exception | None, bool]:
    """Return what a decompressor yields, what stopped it, and whether it came to its end."""
    decompressor, piece_bytes = _decompressor(place.compression)
    output, checked = BytesIO(), 0
    for piece in _pieces(file, place, piece_bytes):
        before = output.tell()
        try:
            for step in _steps(decompressor, piece):
                output.write(step)
                if output.tell() > limit:
                    break
        # OSError is bz2's, RuntimeError lz4's
        except (OSError, RuntimeError, ValueError) as error:
            # The end of a block, where its checksum is, may not have been reached in what came last.
            output.truncate(checked)
            return output.getvalue(), error, False
        checked = before
        if decompressor.eof or output.tell() > limit:
            break
    return output.getvalue(), None, decompressor.eof


def _steps(decompressor: _Decompressor, piece: bytes) -> Iterator[bytes]:
    """Yield what a piece of the compressed data leads to, a little at a time."""
    step = decompressor.decompress(piece, _STEP_BYTES)
    yield step
    # That of bz2 may hold more though it says that it needs input.
    while not decompressor.eof and (len(step) == _STEP_BYTES or not decompressor.needs_input):
        step = decompressor.decompress(b"", _STEP_BYTES)
        yield step


def _decompressor(compression: str) -> tuple[_Decompressor, int]:
    if compression == "bz2":
        return bz2.BZ2Decompressor(), _BZ2_BYTES
    from lz4.frame import LZ4FrameDecompressor

    return LZ4FrameDecompressor(), _LZ4_BYTES


def _pieces(file: BinaryIO, place: ChunkPlace, piece_bytes: int) -> Iterator[bytes]:
    for start in range(place.data, place.end, piece_bytes):
        file.seek(start)
        yield file.read(min(piece_bytes, place.end - start))
    if place.compression == "bz2" and place.is_cut:
        # what of the last whole block is still held back
        yield b""


def _problem(place: ChunkPlace, length: int, error: Exception | None, *, is_ended: bool) -> Problem | None:
    if error is not None:
        text = " ".join(str(error).split())
        # bz2 says the same of a wrong checksum and of all else
        is_checksum = "hecksum" in text or place.compression == "bz2"
        cause = SkipCause.WRONG_CHECKSUM if is_checksum else SkipCause.DAMAGED
        return Problem(cause, f"it cannot be decompressed ({type(error).__name__}: {text})")
    if place.is_cut:
        return None
    if place.size is not None and length > place.size:
        return Problem(SkipCause.DAMAGED, f"it has more than its {place.size} bytes")
    if not is_ended or (place.size is not None and length != place.size):
        return Problem(SkipCause.DAMAGED, f"it has {length} bytes, not {place.size}")
    return None


def _damaged(detail: str) -> Chunk:
    return Chunk(b"", Problem(SkipCause.DAMAGED, detail))


def _over_memory(most_bytes: int) -> Chunk:
    return Chunk(b"", Problem(SkipCause.OVER_MEMORY, over_memory(most_bytes)))


def records_in(chunk: bytes, place: ChunkPlace) -> Iterator[Record | None]:
    """Yield the messages and connections of a chunk that can be trusted, and None where something else is.

    Nothing protects the length of a message, nor its bytes from being fewer than they were. So it counts only if what
    follows it is a record, or the end of the chunk; after anything else the next record is looked for.
    """
    start, held = 0, None
    while start < len(chunk):
        record = record_in(chunk, start)
        if record is not None and record.op in _INNER:
            if held is not None:
                yield held
            held = None
            if record.end <= len(chunk):
                held, start = record, record.end
                continue
            if place.is_cut:
                return
        elif place.is_cut and is_unfinished(chunk[start : start + _MOST_HEADER_BYTES]):
            break
        yield None
        found = find_in(chunk, held.data if held else start + 1, _INNER)
        start, held = len(chunk) if found is None else found, None
    if held is not None:
        # As many bytes as its index has may be missing: then that is in it, and a record follows all the same.
        is_all_its_own = find_in(chunk, held.data, (INDEX,)) is None
        yield held if is_all_its_own and (place.has_sure_end or place.is_cut) else None
