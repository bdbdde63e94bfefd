"""Whether a file is a page that this program wrote, or began to, by what stands at its beginning."""

from __future__ import annotations

import stat
from pathlib import Path

_BEGIN = b"<!DOCTYPE html>"
_MARK = b'<meta name="generator" content="replay '
_HEAD_BYTES = 4096


def is_own_page(path: Path) -> bool:
    """Tell whether this is a report page of ours; a link is none, nor is what cannot be read."""
    head = _head(path)
    return head is not None and head.startswith(_BEGIN) and _MARK in head


def is_begun_page(path: Path) -> bool:
    """Tell whether this may be a report page of ours that was not finished: such a page, or an empty file."""
    return _head(path) == b"" or is_own_page(path)


def _head(path: Path) -> bytes | None:
    """Return how a file begins; None of a link, and of what cannot be read."""
    try:
        if not stat.S_ISREG(path.lstat().st_mode):
            return None
        with path.open("rb") as file:
            return file.read(_HEAD_BYTES)
    except OSError:
        return None
