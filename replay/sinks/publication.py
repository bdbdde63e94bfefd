"""Final names for several files, such that at no moment new ones stand beside old ones unnoticed."""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Protocol

from replay.sinks.partial_file import DESCRIPTORS, PartialFile, output_errors, sync_folder

DEVICES = Path("/dev")


class Written(Protocol):
    """What was written and has its temporary name still."""

    def publish(self) -> None:
        """Give what was written its final name."""


def aside_name(path: Path) -> Path:
    """Return the name of what an earlier run wrote while it is being replaced: in the same folder, as `path` is."""
    return path.with_name(f"{path.name}.replaced")


def why_irreplaceable(path: Path) -> str | None:
    """Return why no output can take a name: what has it is no file, which a rename would destroy; None if it can.

    A link is not followed: the file would not be where whoever made the link looks for it, or the link be lost.
    """
    try:
        status = path.lstat()
    except (FileNotFoundError, NotADirectoryError):
        return None
    if stat.S_ISREG(status.st_mode):
        return None
    if stat.S_ISDIR(status.st_mode):
        return "a folder has this name; remove it, or give another name"
    if stat.S_ISLNK(status.st_mode) and not _is_stream(path):
        return "this is a link, which no output replaces; give the name of the file itself, or remove the link"
    return "this is a device, a pipe or the like; outputs are files: give the name of one, and print that afterwards"


def _is_stream(path: Path) -> bool:
    """Tell whether a link leads to what is no file, or may be standard output, though that be a file."""
    leads_elsewhere = path.exists() and not path.is_file() and not path.is_dir()
    return leads_elsewhere or path.absolute().parent in {DEVICES, DESCRIPTORS}


def publish(written: Sequence[Written], files: Sequence[PartialFile], paths: Sequence[Path]) -> None:
    """Give what was written its final name, in place of what an earlier run wrote, which stays if that fails.

    Several files cannot be renamed at once. So those of an older set are set aside, the last one first, before the
    first file is replaced, and are removed when all new ones have their names, in order. Whenever the last one, the
    report, is there, all are there and of the same run; where it is missing, the first one is whole, and nothing of
    another run beside it. If a file cannot have its name, those that were set aside get theirs back.

    Parameters
    ----------
    written, files
        What was written, and its files, all of which must be there still.
    paths
        All final names that belong together, also those that are not written this time, in the order of the files.
    """
    for path in paths:
        with output_errors(path):
            if why := why_irreplaceable(path):
                raise FileExistsError(errno.EEXIST, why)
    for file in files:
        with output_errors(file.path):
            file.check()
    older, new = _OlderFiles(paths), list[Path]()
    try:
        older.set_aside()
        for path in _published(written, files):
            new.append(path)
    except BaseException:
        older.put_back(new)
        raise
    older.remove()


def _published(written: Sequence[Written], files: Sequence[PartialFile]) -> Iterator[Path]:
    """Give each its final name; yield those that have it."""
    folders = dict.fromkeys(file.path.absolute().parent for file in files)
    _sync(folders)
    for each, file in zip(written, files, strict=True):
        if each is written[-1]:
            _sync(folders)
        each.publish()
        yield file.path
    _sync(folders)


def _sync(folders: Iterable[Path]) -> None:
    for folder in folders:
        sync_folder(folder)


class _OlderFiles:
    """What an earlier run wrote under the final names of this one.

    Its first file keeps its name while it is set aside, by a second one, so that it is never without one. Where there
    are no such links it is renamed as the others are.
    """

    def __init__(self, paths: Sequence[Path]) -> None:
        self._paths = paths
        self._aside: list[Path] = []

    def set_aside(self) -> None:
        first = self._paths[0]
        for path in reversed(self._paths):
            with output_errors(path), suppress(FileNotFoundError):
                if path != first or not _linked(path, aside_name(path)):
                    path.replace(aside_name(path))
                self._aside.append(path)

    def put_back(self, new: Sequence[Path]) -> None:
        """Undo all, the last step first: new files go before older ones have their names again.

        What cannot be undone ends it, so that no files of two runs are beside each other; they stay set aside then.
        """
        with suppress(OSError):
            for path in reversed(new):
                if path != self._paths[0] or path not in self._aside:
                    path.unlink()
            for path in reversed(self._aside):
                aside_name(path).replace(path)
                # between two names of one file, a rename does nothing
                aside_name(path).unlink(missing_ok=True)

    def remove(self) -> None:
        """Remove what was set aside; all new files have their names, so that this may fail."""
        if self._aside:
            for path in self._paths:
                with suppress(OSError):
                    aside_name(path).unlink(missing_ok=True)


def _linked(path: Path, name: Path) -> bool:
    """Give a file a second name; tell whether that is possible."""
    try:
        name.unlink(missing_ok=True)
        os.link(path, name, follow_symlinks=False)
    except FileNotFoundError:
        raise
    except (OSError, NotImplementedError):
        return False
    return True
