"""Folders for temporary copies of recordings, gone with the run: those of a run that was killed, with the next one."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory

from replay.file_lock import try_lock

_PREFIX = "replay-"
_LOCK, _COPIES = "lock", "copies"
_ATTEMPTS = 100
_FLAGS = os.O_RDWR | getattr(os, "O_NOFOLLOW", 0)


@contextmanager
def temporary_folder() -> Iterator[Path]:
    """Make a folder that is there within this context.

    A file beside it is locked as long. The lock ends with the process, which tells a folder that a killed run left from
    one in use.
    """
    with ExitStack() as stack:
        folder = _claimed(stack)
        if _has_locks(folder):
            _remove_left_over(folder)
        copies = folder / _COPIES
        copies.mkdir()
        yield copies


def _claimed(stack: ExitStack) -> Path:
    """Make a folder with a locked file in it, and release both with the stack."""
    for _ in range(_ATTEMPTS):
        folder = Path(stack.enter_context(TemporaryDirectory(prefix=_PREFIX)))
        with suppress(FileNotFoundError):
            descriptor = os.open(folder / _LOCK, _FLAGS | os.O_CREAT | os.O_EXCL, 0o600)
            # Windows does not remove a file that is open
            stack.callback(os.close, descriptor)
            # another run may have taken it for left over before it was locked
            if try_lock(descriptor) and os.path.samestat((folder / _LOCK).lstat(), os.fstat(descriptor)):
                return folder
    raise OSError(errno.EAGAIN, os.strerror(errno.EAGAIN))


def _has_locks(folder: Path) -> bool:
    """Tell whether locks keep anybody out here: some file systems have none, and all folders would seem left over."""
    descriptor = os.open(folder / _LOCK, _FLAGS)
    try:
        return not try_lock(descriptor)
    finally:
        os.close(descriptor)


def _remove_left_over(own: Path) -> None:
    """Remove the folders beside ours that runs of the same user left; what cannot be removed stays."""
    for folder in sorted(own.parent.glob(f"{_PREFIX}*")):
        if folder == own:
            continue
        with suppress(OSError):
            descriptor = os.open(folder / _LOCK, _FLAGS)
            try:
                if _is_mine(descriptor) and try_lock(descriptor):
                    shutil.rmtree(folder, ignore_errors=True)
            finally:
                os.close(descriptor)


def _is_mine(descriptor: int) -> bool:
    return not hasattr(os, "getuid") or os.fstat(descriptor).st_uid == os.getuid()
