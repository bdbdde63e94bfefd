"""Which variants are tried, each with a name by which it can be made again."""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import Path

import numpy as np

from benchmarks.faults.formats import FORMATS
from benchmarks.faults.table import FAULTS, Variant


@dataclass(frozen=True, slots=True, order=True)
class Case:
    """One variant: the same for the same seed."""

    format: str
    fault: str
    number: int
    seed: int = 0

    @property
    def name(self) -> str:
        """What ``--replay`` takes."""
        return f"{self.format}/{self.fault}/{self.number}"

    @staticmethod
    def named(name: str, seed: int) -> Case:
        """Return the case of a name.

        Raises
        ------
        ValueError
            If there is none.
        """
        kind, fault, number = [*name.split("/"), "", ""][:3]
        if kind not in FORMATS or fault not in FAULTS or not number.isdecimal():
            raise ValueError(f"{name!r} is no case; expected one such as mcap_zstd/truncated/17")
        return Case(kind, fault, int(number), seed)

    def variant(self) -> Variant | None:
        """Make the recording; None if this fault cannot be had in this format."""
        key = [self.seed, self.number, zlib.crc32(self.format.encode()), zlib.crc32(self.fault.encode())]
        return FAULTS[self.fault].change(self.format, np.random.default_rng(key))


@dataclass(frozen=True, slots=True)
class Task:
    """A case to run.

    Parameters
    ----------
    program
        Whether by the command line as well.
    folder
        Where to leave the recording; None for nowhere.
    """

    case: Case
    program: bool = False
    folder: Path | None = None


def cases(formats: Sequence[str], faults: Sequence[str], seed: int) -> Iterator[Case]:
    """Yield cases without end: one of each pair of format and fault, in a shuffled order, then the next of each."""
    pairs = [(kind, fault) for kind in formats for fault in faults if FAULTS[fault].fits(FORMATS[kind])]
    rng = np.random.default_rng([seed, 5])
    for number in count():
        for index in rng.permutation(len(pairs)):
            kind, fault = pairs[index]
            yield Case(kind, fault, number, seed)
        if not pairs:
            return
