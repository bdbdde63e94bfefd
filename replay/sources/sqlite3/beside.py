"""What SQLite leaves beside a file of which a recorder was killed: its ``-wal`` or ``-journal``.

They are put into a copy of the file here, not by SQLite: it follows names in them, and deletes what they name.
"""

from __future__ import annotations

import shutil
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from replay.skip_cause import SkipCause
from replay.sources.lapses import AT_END, Lapse
from replay.sources.losses import Loss, Losses
from replay.sources.sqlite3.header import read_header
from replay.sources.sqlite3.journal import read_journal
from replay.sources.sqlite3.log import PageLog
from replay.sources.sqlite3.wal import read_wal
from replay.sources.temporary import temporary_folder

_WAL, _JOURNAL = "-wal", "-journal"
# in the order in which SQLite uses them
_READERS = {_JOURNAL: read_journal, _WAL: read_wal}


@dataclass(frozen=True, slots=True)
class Plain:
    """A file that needs nothing beside it.

    Parameters
    ----------
    pages
        How many pages it should have; None if nothing but its header says that.
    is_consistent
        Whether nothing that it needed was lost. If something was, some pages may be newer than others, which SQLite
        would not notice.
    """

    path: Path
    pages: int | None = None
    is_consistent: bool = True


def beside(path: Path) -> dict[str, Path]:
    """Return what is beside a file that SQLite would need, by suffix; what is empty is not needed."""
    found = {suffix: path.with_name(path.name + suffix) for suffix in _READERS}
    return {suffix: each for suffix, each in found.items() if each.is_file() and each.stat().st_size > 0}


def plain_file(path: Path, shown: Path, losses: Losses, stack: ExitStack) -> Plain:
    """Return a file, or a copy of it with what is beside it, that is there as long as the stack; name what is lost.

    Parameters
    ----------
    shown
        How the file is called.
    """
    plain = Plain(path)
    for suffix, left in beside(path).items():
        name = f"{shown.name}{suffix}"
        log = _READERS[suffix](left, name, losses)
        if log is not None and log.places and not _belongs(plain.path, log):
            detail = "it does not belong to the file: its pages have another length"
            lapse = AT_END if suffix == _WAL else Lapse()
            losses.add(Loss(SkipCause.DAMAGED, name, detail, lapse=lapse))
            log = PageLog(0, 0, is_whole=False)
        if log is not None:
            plain = _with(plain, log, left, stack)
    return plain


def _belongs(path: Path, log: PageLog) -> bool:
    with path.open("rb") as file:
        header = read_header(file)
    return header is None or header.page_bytes == log.page_bytes


def _with(plain: Plain, log: PageLog, log_path: Path, stack: ExitStack) -> Plain:
    is_consistent = plain.is_consistent and log.is_whole
    if not log.pages:
        return Plain(plain.path, plain.pages, is_consistent)
    folder = stack.enter_context(temporary_folder())
    copy = folder / plain.path.name
    shutil.copyfile(plain.path, copy)
    has_all = log.put_into(copy, log_path)
    return Plain(copy, log.pages, is_consistent and has_all)
