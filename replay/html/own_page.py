"""Whether a file is a page that this program wrote, by what stands at its beginning."""

from __future__ import annotations

import stat
from pathlib import Path

_BEGIN = b"<!DOCTYPE html>"
_MARK = b'<meta name="generator" content="replay '
_HEAD_BYTES = 4096


def is_own_page(path: Path) -> bool:
    """Tell whether this is a report page of ours; a link is none, nor is what cannot be read."""
    try:
        if not stat.S_ISREG(path.lstat().st_mode):
            return False
        with path.open("rb") as file:
            head = file.read(_HEAD_BYTES)
    except OSError:
        return False
    return head.startswith(_BEGIN) and _MARK in head
