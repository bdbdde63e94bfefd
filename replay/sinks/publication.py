"""Final names for several files, such that at no moment new ones stand beside old ones unnoticed."""

from __future__ import annotations

import errno
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from replay.sinks.partial_file import output_errors, sync_folder


class Written(Protocol):
    """What was written and has its temporary name still."""

    def publish(self) -> None:
        """Give what was written its final name."""


def publish(written: Sequence[Written], paths: Sequence[Path]) -> None:
    """Give what was written its final name, in place of what an earlier run wrote.

    Several files cannot be renamed at once. So the others of an older set are removed, the last one first, before the
    first file is replaced; and the new ones are published in order. Whenever the last one, the report, is there, all
    are there and of the same run; where it is missing, the first one is whole, and nothing of another run beside it.

    Parameters
    ----------
    written
        In the order of the files.
    paths
        All final names that belong together, also those that are not written this time.
    """
    folder = paths[0].absolute().parent
    for path in paths:
        with output_errors(path):
            if path.is_dir():
                raise IsADirectoryError(errno.EISDIR, "a folder has this name")
    for path in reversed(paths[1:]):
        with output_errors(path):
            path.unlink(missing_ok=True)
    sync_folder(folder)
    *others, last = written
    for each in others:
        each.publish()
    sync_folder(folder)
    last.publish()
    sync_folder(folder)
