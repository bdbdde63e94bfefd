"""Where the pages of a SQLite file are if some are missing in its middle, or are too many: not where their numbers say.

A row that is longer than a page goes on in pages that are written one after the other, each of which begins with the
number of the next one. So most pages say what their own number is.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import BinaryIO

# pages of tables and indexes begin with a number of their kind instead, the smallest of which is 2
_LARGEST_NUMBER = (2 << 24) - 1


@dataclass(frozen=True, slots=True)
class Places:
    """Where pages are, each place being the number that a page there should have.

    Parameters
    ----------
    there
        How many places the file has.
    kept
        Up to this number, pages are in their own places.
    shift
        How much larger the numbers of the pages at the end are than their places.
    resumed
        The first place at which that is so. What is at places between has an unknown number.
    is_displaced
        Whether the last page that says what its number is is not in its own place.
    """

    there: int
    kept: int
    shift: int
    resumed: int
    is_displaced: bool = False

    @property
    def count(self) -> int:
        """The largest number that a page of the file may have."""
        return max(self.kept, self.there + self.shift if self.resumed <= self.there else 0)

    def numbers(self) -> Iterator[int]:
        """Yield the numbers of all pages whose numbers are known, but that of the first one."""
        yield from range(2, self.kept + 1)
        yield from range(self.resumed + self.shift, self.there + self.shift + 1)

    def place(self, number: int, *, is_sure: bool = True) -> int | None:
        """Return where a page is; None if it is missing or that cannot be told.

        Parameters
        ----------
        is_sure
            False also for places that pages at the end may have: for what tells by itself whether it is that page.
        """
        if number <= self.kept:
            return number if number > 0 else None
        first = self.resumed if is_sure else min(self.resumed, self.kept + 1)
        place = number - self.shift
        return place if self.resumed <= self.there and first <= place <= self.there else None


def own_places(there: int) -> Places:
    """Return the places of a file that is whole, or of one that ends early."""
    return Places(there, there, 0, there + 1)


def told_places(file: BinaryIO, page_bytes: int, there: int, pages: int | None, sound: Iterable[int]) -> Places:
    """Return where pages are by what they say themselves.

    That a page is in its own place says so of all before it, but not of its own end, where bytes may be missing.

    Parameters
    ----------
    pages
        How many pages the file should have; None if that is not known, and nothing behind the damage can be used.
    sound
        Pages that are known to be in their own places.
    """
    first_shifted, last_own, resumed, is_displaced = there + 1, 1, there + 1, False
    expected = None if pages is None else pages - there
    for place, shift in _shifts(file, page_bytes, there, max(there, pages or 0)):
        is_displaced = shift != 0
        if not shift and first_shifted > there:
            last_own = place
        elif shift:
            first_shifted = min(first_shifted, place)
        if shift != expected or not shift:
            resumed = there + 1
        elif resumed > there:
            resumed = place
    last_own = max([last_own, *(each for each in sound if each < first_shifted)])
    return Places(there, last_own - 1, expected or 0, resumed, is_displaced)


def _shifts(file: BinaryIO, page_bytes: int, there: int, most: int) -> Iterator[tuple[int, int]]:
    """Yield places of pages of long rows, and how much larger their numbers are."""
    for place in range(2, there + 1):
        file.seek((place - 1) * page_bytes)
        (following,) = struct.unpack(">I", file.read(4))
        if 2 <= following <= min(most, _LARGEST_NUMBER):
            yield place, following - 1 - place
