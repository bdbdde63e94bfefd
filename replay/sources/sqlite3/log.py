"""What both logs of SQLite come to: pages that a file should have, and how they get into a copy of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path


@dataclass(frozen=True, slots=True)
class PageLog:
    """Pages that a log has of a file.

    Parameters
    ----------
    page_bytes
        Length of a page.
    pages
        How many pages the file has with them.
    places
        Where in the log each page begins, by its number.
    is_whole
        Whether all of the log that should be used can be.
    """

    page_bytes: int
    pages: int
    places: Mapping[int, int] = field(default_factory=dict)
    is_whole: bool = True

    def put_into(self, copy: Path, log: Path) -> bool:
        """Write the pages into a file, and tell whether it has all of its pages then.

        Of a file that ended early, what is behind the first page that neither of both has is left out: so it ends early
        still, at a later place.
        """
        there = min(self.pages, copy.stat().st_size // self.page_bytes)
        while there < self.pages and there + 1 in self.places:
            there += 1
        with copy.open("r+b") as target, log.open("rb") as source:
            for number, start in self.places.items():
                if number <= there:
                    source.seek(start)
                    target.seek((number - 1) * self.page_bytes)
                    target.write(source.read(self.page_bytes))
            if there == self.pages:
                target.truncate(there * self.page_bytes)
        return there == self.pages


def is_page_length(count: int) -> bool:
    """Tell whether pages may have this length."""
    return 512 <= count <= 65536 and not count & (count - 1)
