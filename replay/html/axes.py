"""Round numbers for axes."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Axis:
    """A range of values and where it is marked."""

    low: float
    high: float
    ticks: tuple[float, ...]

    def share(self, value: float) -> float:
        """Return where a value lies, from 0 to 1."""
        return (value - self.low) / (self.high - self.low)

    def label(self, tick: float) -> str:
        """Return a mark in words, with as many digits as tell it from the next."""
        step = self.ticks[1] - self.ticks[0] if len(self.ticks) > 1 else 1.0
        digits = max(0, -math.floor(math.log10(step) + 1e-9))
        return f"{round(tick, digits) + 0.0:,.{digits}f}"


def axis(low: float, high: float, marks: int = 4, *, least_step: float = 0.0, widen: bool = True) -> Axis:
    """Return an axis that holds two values.

    Parameters
    ----------
    low, high
        The values.
    marks
        About how many marks it has.
    least_step
        The marks are no closer than this.
    widen
        Whether it begins and ends at a mark, or at the values.
    """
    if high - low < 1e-9 * max(1.0, abs(high)):
        low, high = low - 0.5, high + 0.5
    step = max(_round_step((high - low) / marks), least_step)
    first, last = math.floor(low / step + 1e-9), math.ceil(high / step - 1e-9)
    if not widen:
        first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    ticks = tuple(number * step for number in range(first, last + 1))
    return Axis(first * step, last * step, ticks) if widen else Axis(low, high, ticks)


def _round_step(least: float) -> float:
    power = 10.0 ** math.floor(math.log10(least))
    return next(power * step for step in (1.0, 2.0, 5.0, 10.0) if power * step >= least * (1 - 1e-9))
