"""Rollback journals of SQLite: pages as they were before a change that a recorder did not finish."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from replay.skip_cause import SkipCause
from replay.sources.lapses import AT_END
from replay.sources.losses import Loss, Losses
from replay.sources.sqlite3.log import PageLog, is_page_length

_HEAD = struct.Struct(">8sIIIII")
_MAGIC = b"\xd9\xd5\x05\xf9\x20\xa1\x63\xd7"
# of which the pages were not counted, as they were not to be written safely
_UNCOUNTED = 0xFFFFFFFF
_LOCK_BYTE = 0x40000000
_SAMPLED_EACH_BYTES = 200

_UNCLEAR = "an unfinished change cannot be undone, rows of it may be taken for messages"


@dataclass(frozen=True, slots=True)
class _Sizes:
    page_bytes: int
    sector_bytes: int
    file_bytes: int

    @property
    def record_bytes(self) -> int:
        """Length of a page with its number and checksum."""
        return self.page_bytes + 8


class _EndError(Exception):
    """The journal ends, or cannot be followed, before its end."""

    def __init__(self, cause: SkipCause, detail: str) -> None:
        super().__init__(detail)
        self.cause = cause


def read_journal(path: Path, name: str, losses: Losses) -> PageLog | None:
    """Return the pages before the change, and name it if it cannot be undone; None if there is none to undo.

    A journal may name another one, with which changes of several files are finished at once. That one is any file of
    the machine, and SQLite would delete it; no recorder has one, and here the name is not followed.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(_HEAD.size)
        if not any(head):
            # finished: some recorders keep the journal and erase its beginning
            return None
        sizes = _sizes(head, size)
        if sizes is None:
            losses.add(Loss(SkipCause.DAMAGED, name, f"it does not begin like a journal of SQLite: {_UNCLEAR}"))
            return PageLog(0, 0, is_whole=False)
        pages = _HEAD.unpack(head)[3]
        places: dict[int, int] = {}
        is_whole = True
        try:
            for number, start in _records(file, sizes):
                # of what the change added nothing is to be kept
                if number <= pages:
                    places.setdefault(number, start)
        except _EndError as error:
            is_whole = False
            losses.add(Loss(error.cause, name, f"{error}: {_UNCLEAR}"))
        if _names_another(file, size):
            detail = "it names another journal, which is not read: the change is undone, finished or not"
            losses.add(Loss(SkipCause.DAMAGED, name, detail, lapse=AT_END))
    return PageLog(sizes.page_bytes, pages, places, is_whole)


def _sizes(head: bytes, size: int) -> _Sizes | None:
    if len(head) < _HEAD.size or not head.startswith(_MAGIC):
        return None
    _, _, _, _, sector_bytes, page_bytes = _HEAD.unpack(head)
    is_sector = 32 <= sector_bytes <= 65536 and not sector_bytes & (sector_bytes - 1)
    return _Sizes(page_bytes, sector_bytes, size) if is_sector and is_page_length(page_bytes) else None


def _records(file: BinaryIO, sizes: _Sizes) -> Iterator[tuple[int, int]]:
    """Yield the number of each page, and where it begins."""
    start = 0
    while start + _HEAD.size <= sizes.file_bytes:
        file.seek(start)
        magic, count, nonce, *_ = _HEAD.unpack(file.read(_HEAD.size))
        if magic != _MAGIC:
            return
        start += sizes.sector_bytes
        left = max(0, sizes.file_bytes - start) // sizes.record_bytes
        for _ in range(left if count == _UNCOUNTED else min(count, left)):
            number = _checked(file, start, sizes, nonce)
            if number is None:
                return
            yield number, start + 4
            start += sizes.record_bytes
        if left < count != _UNCOUNTED:
            raise _EndError(SkipCause.ENDS_EARLY, f"the file ends early at byte {sizes.file_bytes}")
        # each header begins a sector
        start += -start % sizes.sector_bytes


def _checked(file: BinaryIO, start: int, sizes: _Sizes, nonce: int) -> int | None:
    """Return the number of the page at a place; None if the pages end there."""
    file.seek(start)
    (number,) = struct.unpack(">I", file.read(4))
    if number in {0, _LOCK_BYTE // sizes.page_bytes + 1}:
        return None
    page = file.read(sizes.page_bytes)
    (checksum,) = struct.unpack(">I", file.read(4))
    sampled = sum(page[at] for at in range(sizes.page_bytes - _SAMPLED_EACH_BYTES, 0, -_SAMPLED_EACH_BYTES))
    if (nonce + sampled) & 0xFFFFFFFF != checksum:
        raise _EndError(SkipCause.WRONG_CHECKSUM, f"the checksum of the page at byte {start} is wrong")
    return int(number)


def _names_another(file: BinaryIO, size: int) -> bool:
    file.seek(max(_HEAD.size, size - len(_MAGIC)))
    return file.read() == _MAGIC
