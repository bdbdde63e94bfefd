"""The probability that a placement is right, from what speaks for and against it.

An additive logistic model: each cue contributes a piecewise linear curve that only rises, or only falls, as the cue
says more for the placement, and that is flat beyond what was seen in fitting. `mapmerge.match.calibration` holds what
``python -m benchmarks.calibrate`` fitted; docs/method.md says on what, and how well it holds on other buildings.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

from mapmerge.match.calibration import CURVES, INTERCEPT
from mapmerge.match.cues import Cues

_ALIKE, _AS_GOOD = 0.85, 0.98


@dataclass(frozen=True, slots=True)
class Curve:
    """What one cue contributes.

    Parameters
    ----------
    knots
        Values of the cue, ascending.
    rises
        What is added, in full, once the cue has passed from each knot to the next.
    """

    knots: tuple[float, ...]
    rises: tuple[float, ...]

    def at(self, value: float) -> float:
        """Return the contribution of a value."""
        total = 0.0
        for (low, high), rise in zip(pairwise(self.knots), self.rises, strict=True):
            total += rise * min(1.0, max(0.0, (value - low) / (high - low)))
        return total


_CURVES = {cue: Curve(knots, rises) for cue, (knots, rises) in CURVES.items()}


def confidence(cues: Cues) -> float:
    """Return the calibrated probability that a placement with these cues is right."""
    log_odds = INTERCEPT + sum(curve.at(getattr(cues, cue)) for cue, curve in _CURVES.items())
    return 1.0 / (1.0 + math.exp(-log_odds)) / contenders(cues.likeness)


def contenders(likeness: float) -> float:
    """Return among how many placements the choice is: from 1 to 2, where a rival is as good.

    Of two that are as good only one is right, which no sum of other cues may outweigh.
    """
    return 1.0 + min(1.0, max(0.0, (likeness - _ALIKE) / (_AS_GOOD - _ALIKE)))
