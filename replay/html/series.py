"""Values of each robot over time, kept in bounded memory: of very many ticks, evenly chosen ones."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mapmerge.outcome import Status

MOST_NUMBERS = 120_000
"""About as many numbers as all plots together show."""
_LEAST_TICKS, _MOST_TICKS = 100, 1500


@dataclass(frozen=True, slots=True)
class Sample:
    """One robot at one tick; None where there is no such value.

    Parameters
    ----------
    status
        What became of its map.
    acceptance, confidence, overlap_m2
        Of a placed map; of one that is not, those of its best refused candidate.
    x_m, y_m, yaw_deg
        Where it is placed; None of the reference, which stays where it is.
    """

    status: str
    acceptance: float | None
    confidence: float | None
    overlap_m2: float | None
    x_m: float | None = None
    y_m: float | None = None
    yaw_deg: float | None = None

    @property
    def is_placed(self) -> bool:
        """Whether these are values of a map that is merged."""
        return self.status in (Status.REFERENCE, Status.MERGED)

    @staticmethod
    def of(values: Mapping[str, Any]) -> Sample:
        """Return what a report says of a robot."""
        figures = values["status"], values["acceptance"], values["confidence"], values["overlap_m2"]
        pose = values["merged_from_map"]
        if pose is None or values["status"] == Status.REFERENCE:
            return Sample(*figures)
        return Sample(*figures, pose["x_m"], pose["y_m"], math.degrees(pose["yaw_rad"]))


class Series:
    """Folds ticks into series.

    Parameters
    ----------
    robots
        The robots, in order.
    """

    def __init__(self, robots: Sequence[str]) -> None:
        quantities = 6
        most = MOST_NUMBERS // max(1, quantities * len(robots))
        self._most = max(_LEAST_TICKS, min(_MOST_TICKS, most))
        self._robots = tuple(robots)
        self._every = 1
        self._stamps_ns: list[int] = []
        self._rows: list[tuple[Sample, ...]] = []
        self._last: tuple[int, tuple[Sample, ...]] | None = None
        self.ticks = 0
        """How many ticks there were."""

    def take(self, stamp_ns: int, robots: Mapping[str, Mapping[str, Any]]) -> None:
        """Take in a tick; every second one that is kept is left out whenever there are too many."""
        row = tuple(Sample.of(robots[robot]) for robot in self._robots)
        self._last = stamp_ns, row
        if self.ticks % self._every == 0:
            self._stamps_ns.append(stamp_ns)
            self._rows.append(row)
            if len(self._rows) > 2 * self._most:
                del self._stamps_ns[1::2], self._rows[1::2]
                self._every *= 2
        self.ticks += 1

    @property
    def stamps_ns(self) -> list[int]:
        """Times of the ticks that are kept; the last one always is."""
        return [stamp_ns for stamp_ns, _ in self._kept()]

    def of(self, index: int) -> list[Sample]:
        """Return one robot's values at these times."""
        return [row[index] for _, row in self._kept()]

    def _kept(self) -> list[tuple[int, tuple[Sample, ...]]]:
        kept = list(zip(self._stamps_ns, self._rows, strict=True))
        if self._last is not None and kept[-1] != self._last:
            kept.append(self._last)
        return kept
