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
_MOST_LOG_ODDS = 50.0
_FITS_WORSE, _FITS_AS_WELL = -0.03, -0.02

HIGHEST = 0.9999
"""No placement is called surer: what is seldomer than 1 in 10 000 was not measured."""


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
            total += rise * _ramp(value, low, high)
        return total


_CURVES = {cue: Curve(knots, rises) for cue, (knots, rises) in CURVES.items()}


def confidence(cues: Cues, tries: float = 1.0) -> float:
    """Return the calibrated probability that a placement with these cues is right.

    Parameters
    ----------
    cues
        What speaks for and against it.
    tries
        It is the best of so many independent searches, each of which might have found a wrong one.
    """
    log_odds = INTERCEPT + sum(curve.at(getattr(cues, cue)) for cue, curve in _CURVES.items())
    share = 1.0 / (1.0 + math.exp(-min(max(log_odds, -_MOST_LOG_ODDS), _MOST_LOG_ODDS)))
    return max(0.0, min(HIGHEST, 1.0 - tries * (1.0 - share))) / contenders(cues)


def contenders(cues: Cues) -> float:
    """Return among how many placements the choice is, from 1 to 2, which no sum of cues may outweigh.

    Of two placements that are as good only one is right. Nor can the better one be told where walls agree as well at
    the other over a good part of the length: so look the halves of a symmetric building, of which the one that lets the
    maps overlap more is not the likelier one.
    """
    as_good = _ramp(cues.likeness, _ALIKE, _AS_GOOD)
    fits_as_well = _ramp(cues.rival_agreement - cues.wall_agreement, _FITS_WORSE, _FITS_AS_WELL)
    return 1.0 + max(as_good, fits_as_well)


def _ramp(value: float, low: float, high: float) -> float:
    return min(1.0, max(0.0, (value - low) / (high - low)))
