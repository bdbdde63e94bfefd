"""What the header of a SQLite file says of its pages."""

from __future__ import annotations

import struct
from typing import BinaryIO, NamedTuple

HEADER_BYTES = 100
"""What the first page begins with, before its rows."""


class Header(NamedTuple):
    """What a file says of its pages; ``pages`` is None where that is not up to date."""

    page_bytes: int
    usable_bytes: int
    pages: int | None


def read_header(file: BinaryIO) -> Header | None:
    """Return what the header of a SQLite file says; None if it cannot be right."""
    file.seek(0)
    head = file.read(HEADER_BYTES)
    if len(head) < HEADER_BYTES:
        return None
    # The header stores 65536 as 1, and says at which change its count of pages was right.
    stored, reserved = struct.unpack_from(">H", head, 16)[0], head[20]
    changed, pages = struct.unpack_from(">II", head, 24)
    (valid_for,) = struct.unpack_from(">I", head, 92)
    page_bytes = 65536 if stored == 1 else stored
    if page_bytes < 512 or page_bytes & (page_bytes - 1) or page_bytes - reserved < 480:
        return None
    return Header(page_bytes, page_bytes - reserved, pages if changed == valid_for and pages else None)
