"""What SQLite leaves beside a file of which a recorder was killed: its ``-wal`` or ``-journal``.

Only SQLite can apply them, and it changes files when it does, so that it is given a copy.
"""

from __future__ import annotations

import shutil
import sqlite3
import struct
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from replay.errors import InputError
from replay.skip_cause import SkipCause
from replay.sources.lapses import AT_END
from replay.sources.losses import Loss, Losses
from replay.sources.sqlite3_salvage import read_header

WAL, JOURNAL = "-wal", "-journal"

_WAL_HEAD = struct.Struct(">IIIIIIII")
_FRAME_HEAD = struct.Struct(">IIIIII")
_WAL_MAGICS = {0x377F0682, 0x377F0683}
_JOURNAL_HEAD = struct.Struct(">8sIIIII")
_JOURNAL_MAGIC = b"\xd9\xd5\x05\xf9\x20\xa1\x63\xd7"
# as in a journal whose records were not counted yet
_UNCOUNTED = {0, 0xFFFFFFFF}


@dataclass(frozen=True, slots=True)
class Wal:
    """What a write-ahead log holds.

    Parameters
    ----------
    frames
        How many pages of whole changes it has.
    numbers
        The numbers of these pages.
    pages
        How many pages the file has with them.
    is_cut
        Whether it ends within a page.
    """

    frames: int
    numbers: frozenset[int]
    pages: int
    is_cut: bool


def beside(path: Path) -> dict[str, Path]:
    """Return what is beside a file that SQLite would need, by suffix; what is empty is not needed."""
    found = {suffix: path.with_name(path.name + suffix) for suffix in (WAL, JOURNAL)}
    return {suffix: each for suffix, each in found.items() if each.is_file() and each.stat().st_size > 0}


def copied(path: Path, found: dict[str, Path], stack: ExitStack) -> Path:
    """Return a copy of a file with what is beside it, that is there as long as the stack."""
    folder = Path(stack.enter_context(TemporaryDirectory(prefix="replay-")))
    for each in (path, *found.values()):
        shutil.copyfile(each, folder / each.name)
    return folder / path.name


def read_wal(path: Path) -> Wal | None:
    """Return what a write-ahead log holds as far as its frames say; None if it is none."""
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(_WAL_HEAD.size)
        if len(head) < _WAL_HEAD.size:
            return None
        magic, _, page_bytes, _, *salt, _, _ = _WAL_HEAD.unpack(head)
        if magic not in _WAL_MAGICS or not 512 <= page_bytes <= 65536:
            return None
        frame_bytes = _FRAME_HEAD.size + page_bytes
        met: list[int] = []
        frames = pages = 0
        start = _WAL_HEAD.size
        while start + frame_bytes <= size:
            file.seek(start)
            number, committed, *own_salt, _, _ = _FRAME_HEAD.unpack(file.read(_FRAME_HEAD.size))
            # what follows is of the time before SQLite began it anew
            if own_salt != salt:
                break
            met.append(number)
            if committed:
                frames, pages = len(met), committed
            start += frame_bytes
        is_cut = start < size < start + frame_bytes
    return Wal(frames, frozenset(met[:frames]), pages, is_cut)


def check_wal(path: Path, wal_path: Path, shown: Path, losses: Losses) -> Wal | None:
    """Return what a write-ahead log holds, and name what of it is lost.

    Raises
    ------
    InputError
        If the file lacks pages that the log has not.
    """
    wal, name = read_wal(wal_path), f"{shown.name}{WAL}"
    if wal is None:
        losses.add(Loss(SkipCause.DAMAGED, name, "it does not begin like a write-ahead log of SQLite", lapse=AT_END))
        return None
    if wal.is_cut:
        detail = f"the file ends early at byte {wal_path.stat().st_size}"
        losses.add(Loss(SkipCause.ENDS_EARLY, name, detail, lapse=AT_END))
    with path.open("rb") as file:
        header = read_header(file)
    there = path.stat().st_size // header.page_bytes if header else 0
    missing = set(range(there + 1, wal.pages + 1)) - wal.numbers
    if missing:
        raise InputError(
            f"{shown}: the file ends early at byte {path.stat().st_size}, and {name} beside it does not have all that "
            "is missing; copy both again from where they were made"
        )
    return wal


def check_applied(database: sqlite3.Connection, wal: Wal, shown: Path, losses: Losses) -> None:
    """Name it if SQLite did not take all whole changes of a write-ahead log, because a checksum is wrong."""
    _, applied, _ = database.execute("PRAGMA wal_checkpoint(PASSIVE)").fetchone()
    if applied < 0:
        losses.add(Loss(SkipCause.DAMAGED, f"{shown.name}{WAL}", "it does not belong to the file", lapse=AT_END))
    elif applied < wal.frames:
        detail = (
            f"the checksum of its page {applied + 1} is wrong: that one and the {wal.frames - applied - 1} after it"
        )
        losses.add(Loss(SkipCause.WRONG_CHECKSUM, f"{shown.name}{WAL}", f"{detail} are not used", lapse=AT_END))


def check_journal(path: Path, journal_path: Path, shown: Path, losses: Losses) -> None:
    """Name it if a change that was not finished cannot be undone.

    Raises
    ------
    InputError
        If the file has fewer pages than before the change.
    """
    size = journal_path.stat().st_size
    with journal_path.open("rb") as file:
        head = file.read(_JOURNAL_HEAD.size)
    if not any(head):
        # finished: some recorders keep the journal and erase its beginning
        return
    name = f"{shown.name}{JOURNAL}"
    unclear = "an unfinished change cannot be undone, rows of it may be taken for messages"
    magic = head[:8]
    if len(head) < _JOURNAL_HEAD.size or magic != _JOURNAL_MAGIC:
        losses.add(Loss(SkipCause.DAMAGED, name, f"it does not begin like a journal of SQLite: {unclear}"))
        return
    _, records, _, pages, sector_bytes, page_bytes = _JOURNAL_HEAD.unpack(head)
    if records not in _UNCOUNTED and size < sector_bytes + records * (page_bytes + 8):
        losses.add(Loss(SkipCause.ENDS_EARLY, name, f"the file ends early at byte {size}: {unclear}"))
    if path.stat().st_size < pages * page_bytes:
        raise InputError(
            f"{shown}: the file ends early at byte {path.stat().st_size}, and {name} beside it calls for "
            f"{pages * page_bytes}; copy both again from where they were made"
        )
