"""Write-ahead logs of SQLite: pages that a recorder has finished and that are not in the file yet."""

from __future__ import annotations

import functools
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from replay.skip_cause import SkipCause
from replay.sources.boundary import COPY_AGAIN
from replay.sources.lapses import AT_END
from replay.sources.losses import Loss, Losses
from replay.sources.sqlite3.log import PageLog, is_page_length

_HEAD = struct.Struct(">IIIIIIII")
_FRAME_HEAD = struct.Struct(">IIIIII")
_SUMMED_BYTES = 24
# by how the numbers are stored of which checksums are made
_MAGICS = {0x377F0682: "<u4", 0x377F0683: ">u4"}
_VERSION = 3007000

_Sums = tuple[int, int]


@dataclass(frozen=True, slots=True)
class _Frame:
    """A page in the log; ``pages`` is how many the file has, if a change ends with it, else 0."""

    number: int
    pages: int
    salt: tuple[int, int]
    sums: _Sums


def read_wal(path: Path, name: str, losses: Losses) -> PageLog | None:
    """Return the pages of all changes that are whole, and name what is lost; None if it is no such log."""
    with path.open("rb") as file:
        head = file.read(_HEAD.size)
        order = _order(head)
        if order is None:
            detail = "it does not begin like a write-ahead log of SQLite"
            losses.add(Loss(SkipCause.DAMAGED, name, detail, lapse=AT_END))
            return None
        return _read(file, path.stat().st_size, head, order, name, losses)


def _order(head: bytes) -> str | None:
    """Return how the log stores numbers, if this is how one begins."""
    if len(head) < _HEAD.size:
        return None
    magic, version, page_bytes, *_, first, second = _HEAD.unpack(head)
    order = _MAGICS.get(magic)
    if order is None or version != _VERSION or not is_page_length(page_bytes):
        return None
    return order if _summed(head[:_SUMMED_BYTES], order, (0, 0)) == (first, second) else None


def _read(file: BinaryIO, size: int, head: bytes, order: str, name: str, losses: Losses) -> PageLog:
    _, _, page_bytes, _, first_salt, second_salt, *sums_read = _HEAD.unpack(head)
    sums: _Sums = (sums_read[0], sums_read[1])
    places: dict[int, int] = {}
    open_places: dict[int, int] = {}
    # pages, and those up to the last end of a change: by their checksums, and whatever these say
    met = used = written = pages = 0
    is_sound = True
    start, frame_bytes = _HEAD.size, _FRAME_HEAD.size + page_bytes
    while start + frame_bytes <= size:
        data = file.read(frame_bytes)
        frame = _frame(data)
        # what follows is of the time before SQLite began it anew
        if frame.salt != (first_salt, second_salt) or not frame.number:
            break
        met += 1
        sums = _summed(data[:8] + data[_FRAME_HEAD.size :], order, sums) if is_sound else sums
        is_sound = is_sound and sums == frame.sums
        open_places[frame.number] = start + _FRAME_HEAD.size
        if frame.pages:
            written = met
        if frame.pages and is_sound:
            used, pages = met, frame.pages
            places.update(open_places)
            open_places.clear()
        start += frame_bytes
    is_cut = start < size < start + frame_bytes
    if is_cut:
        losses.add(Loss(SkipCause.ENDS_EARLY, name, f"the file ends early at byte {size}; {COPY_AGAIN}", lapse=AT_END))
    if used < written:
        detail = f"the checksum of its page {used + 1} is wrong: that one and the {written - used - 1} after it"
        losses.add(Loss(SkipCause.WRONG_CHECKSUM, name, f"{detail} are not used", lapse=AT_END))
    return PageLog(page_bytes, pages, places, is_whole=not is_cut and used == written)


def _frame(data: bytes) -> _Frame:
    number, pages, first_salt, second_salt, first, second = _FRAME_HEAD.unpack_from(data)
    return _Frame(number, pages, (first_salt, second_salt), (first, second))


def _summed(data: bytes, order: str, sums: _Sums) -> _Sums:
    """Return the two checksums of SQLite of what came before and of this.

    Each number is added to the one sum, together with the other sum, and the next one to the other. Written out, a
    number counts by as many times as the Fibonacci numbers say, so that all are added at once.
    """
    words = np.frombuffer(data, order).astype(np.uint32)
    times = _fibonacci(len(words) + 2)
    before, after = times[len(words) - 1 :: -1], times[len(words) : 0 : -1]
    last = [int(each) for each in times[-3:]]
    first = int((words * before).sum(dtype=np.uint32)) + last[0] * sums[0] + last[1] * sums[1]
    second = int((words * after).sum(dtype=np.uint32)) + last[1] * sums[0] + last[2] * sums[1]
    return first & 0xFFFFFFFF, second & 0xFFFFFFFF


@functools.lru_cache(maxsize=4)
def _fibonacci(count: int) -> np.ndarray[tuple[int], np.dtype[np.uint32]]:
    numbers = [0, 1]
    while len(numbers) < count:
        numbers.append((numbers[-1] + numbers[-2]) & 0xFFFFFFFF)
    return np.array(numbers, np.uint32)
