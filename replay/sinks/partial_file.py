"""A file that has its final name only once it is whole, and that one run writes at a time."""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO, Self

from replay.errors import OutputError
from replay.file_lock import try_lock
from replay.interrupts import put_off

# Windows neither renames nor removes a file that is open.
_CLOSED_FIRST = os.name == "nt"
DESCRIPTORS = Path("/dev/fd")
"""Where open files have paths, if the system has that."""
_ATTEMPTS = 100
_FLAGS = os.O_RDWR | getattr(os, "O_BINARY", 0) | getattr(os, "O_NOFOLLOW", 0)
_ELSEWHERE = "give another name"
_NO_SPACE = f"free space there, or {_ELSEWHERE}"
_NO_RIGHT = f"make the folder one that you may write to, or {_ELSEWHERE}"
_REMEDIES = {
    errno.ENOSPC: _NO_SPACE,
    errno.EDQUOT: _NO_SPACE,
    errno.EFBIG: f"raise the limit (`ulimit -f`), or {_ELSEWHERE}",
    errno.EACCES: _NO_RIGHT,
    errno.EPERM: _NO_RIGHT,
    errno.EROFS: _NO_RIGHT,
    errno.EISDIR: f"remove that folder, or {_ELSEWHERE}",
    errno.EMFILE: "raise the limit (`ulimit -n`)",
}
_NO_SYNC = {errno.EINVAL, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS}


def partial_name(path: Path) -> Path:
    """Return the temporary name of a file: in the same folder, so that renaming is atomic."""
    return path.with_name(f"{path.name}.partial")


def recovering_name(path: Path) -> Path:
    """Return the temporary name of a file that is made of what a run left under its own."""
    return path.with_name(f"{path.name}.recovering")


class PartialFile:
    """Names a file while it is written, and renames it when it is whole.

    The file is locked for as long as it has its temporary name. The lock ends with the process, so one that a killed
    run left is told from one that is being written. What has the temporary name is never written to: such a
    file is removed and a new one made, so that nothing else that is the same file, by whatever link, is changed.

    Parameters
    ----------
    path
        The final name.
    partial
        The temporary name; ``.partial`` behind the final one, if nothing is said.
    """

    def __init__(self, path: Path, partial: Path | None = None) -> None:
        self.path = path
        self.partial = partial or partial_name(path)
        self.replaced_bytes = 0
        """Size of what an earlier run left under the temporary name."""
        self._descriptor: int | None = None

    @classmethod
    def claimed(cls, path: Path) -> Self:
        """Return a file that is claimed at once."""
        file = cls(path)
        file.claim()
        return file

    def claim(self) -> None:
        """Make the file, empty and locked, under its temporary name; interrupts wait, so that it is known to be there.

        Raises
        ------
        OutputError
            If another run is writing it, or it cannot be made.
        """
        with put_off(), output_errors(self.path):
            for _ in range(_ATTEMPTS):
                self._remove_left_over()
                if self._make():
                    return
        raise self._in_use()

    def stream(self) -> BinaryIO:
        """Open the file for writing; who does closes it."""
        if self._descriptor is None:
            raise AssertionError("a file is claimed before it is written")
        return os.fdopen(os.dup(self._descriptor), "wb")

    def readable_path(self) -> Path:
        """Return a path to read the file by that is UTF-8, whatever its name is, where there is one."""
        try:
            str(self.partial).encode()
        except UnicodeEncodeError:
            return DESCRIPTORS / str(self._descriptor)
        return self.partial

    def sync(self) -> None:
        """Wait until what was written is on the disk."""
        with output_errors(self.path):
            if self._descriptor is not None:
                _sync(self._descriptor)

    def check(self) -> None:
        """See that the file is still there.

        Raises
        ------
        FileNotFoundError
            If somebody has removed or replaced it.
        """
        if not self._is_ours():
            raise FileNotFoundError(errno.ENOENT, f"{self.partial.name} was removed or replaced while it was written")

    def publish(self) -> None:
        """Give the file its final name, replacing what has it."""
        with output_errors(self.path):
            self.check()
            if _CLOSED_FIRST:
                self._close()
            self.partial.replace(self.path)
            self._close()

    def discard(self) -> None:
        """Remove the file if it still has its temporary name; leave what is another run's."""
        with suppress(OSError):
            if self._is_ours():
                if _CLOSED_FIRST:
                    self._close()
                self.partial.unlink()
        self._close()

    def _remove_left_over(self) -> None:
        """Remove what an earlier run left under the temporary name."""
        try:
            descriptor = os.open(self.partial, _FLAGS)
        except FileNotFoundError:
            return
        except OSError as error:
            if error.errno == errno.ELOOP:
                raise OSError(error.errno, f"{self.partial.name} is a link; remove it, or give another name") from error
            raise
        with os.fdopen(descriptor, "rb") as file:
            if not stat.S_ISREG(os.fstat(descriptor).st_mode):
                raise OSError(errno.EEXIST, f"{self.partial.name} is no file; remove it, or give another name")
            if not try_lock(descriptor):
                raise self._in_use()
            if not self._has_name(descriptor):
                return
            self.replaced_bytes = os.fstat(descriptor).st_size
            if _CLOSED_FIRST:
                file.close()
            self.partial.unlink(missing_ok=True)

    def _make(self) -> bool:
        """Make the file and lock it; tell whether nobody came in between."""
        try:
            descriptor = os.open(self.partial, _FLAGS | os.O_CREAT | os.O_EXCL, 0o666)
        except FileExistsError:
            return False
        self._descriptor = descriptor
        if try_lock(descriptor) and self._has_name(descriptor):
            return True
        self._close()
        return False

    def _is_ours(self) -> bool:
        return self._descriptor is not None and self._has_name(self._descriptor)

    def _has_name(self, descriptor: int) -> bool:
        """Tell whether an open file is the one that has the temporary name, and not one that had it before."""
        try:
            return os.path.samestat(self.partial.lstat(), os.fstat(descriptor))
        except FileNotFoundError:
            return False

    def _close(self) -> None:
        descriptor, self._descriptor = self._descriptor, None
        if descriptor is not None:
            os.close(descriptor)

    def _in_use(self) -> OutputError:
        return OutputError(
            f"{self.path}: another run is writing it now; wait until that has ended, or give another name"
        )


def sync_folder(folder: Path) -> None:
    """Wait until the names of a folder's files are on the disk; only where folders can be opened."""
    if _CLOSED_FIRST:
        return
    with output_errors(folder):
        try:
            descriptor = os.open(folder, os.O_RDONLY)
        except PermissionError:  # one that can be written, but not read
            return
        try:
            _sync(descriptor)
        finally:
            os.close(descriptor)


def _sync(descriptor: int) -> None:
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in _NO_SYNC:  # where there is nothing to wait for
            raise


@contextmanager
def output_errors(path: Path, *foreign: type[Exception]) -> Iterator[None]:
    """Translate errors of the file system, and those named, into an `OutputError` of one line that names the path."""
    try:
        yield
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {_with_remedy(error)}") from error
    except MemoryError as error:
        raise OutputError(f"{path}: cannot be written: there is not enough memory") from error
    except foreign as error:
        raise OutputError(f"{path}: cannot be written: {one_line(error)}") from error


def _with_remedy(error: OSError) -> str:
    """Return what the system says, and what to do; what we say ourselves says that already."""
    if error.errno is None or error.strerror != os.strerror(error.errno):
        return error.strerror or one_line(error)
    return f"{error.strerror}; {_REMEDIES.get(error.errno, _ELSEWHERE)}"


def one_line(error: BaseException) -> str:
    """Return what an exception says in one line; its name where it says nothing."""
    return " ".join(str(error).split()) or type(error).__name__
