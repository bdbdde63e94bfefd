"""The bench's simulated pairs: which kinds, which seeds, how many.

Seeds from `FIRST_SEED` on are the bench's alone; whatever is tuned or calibrated uses lower ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

from samples.kinds import KINDS
from samples.pairs import STRANGERS, Pair, Related, pair, strangers

FIRST_SEED = 100_000
PAIRS_A_KIND = 32
STRANGERS_A_KIND = 5


@dataclass(frozen=True, slots=True)
class Case:
    """One pair to be made: a process makes it where it is needed."""

    kind: str
    seed: int
    related: Related

    def made(self) -> Pair:
        """Return the pair."""
        if self.related == "same place":
            return pair(self.kind, self.seed)
        return strangers(self.kind, self.seed, self.related)


def cases(share: float = 1.0) -> list[Case]:
    """Return the bench's cases, or a share of those of each kind: related pairs, then strangers."""
    related = [
        Case(kind, FIRST_SEED + number, "same place")
        for kind, number in product(KINDS, range(max(1, round(share * PAIRS_A_KIND))))
    ]
    unrelated = [
        Case(kind, FIRST_SEED + number, what)
        for kind, what, number in product(KINDS, STRANGERS, range(max(1, round(share * STRANGERS_A_KIND))))
    ]
    return related + unrelated
