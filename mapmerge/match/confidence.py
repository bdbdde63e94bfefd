"""The probability that a placement is right, from what speaks for and against it.

Two additive models, each a sum of piecewise linear curves that only rise, or only fall, as a cue says more for the
placement, and that are flat beyond their first and last knots. The first one, `log_odds_of`, weighs placements by
themselves: at most one of them is right, so that each takes its share of the likelihood (a conditional logit, with
"none of them" as one more choice). The second one, `confidence`, is of how the likeliest one stands among the others.
`mapmerge.match.calibration` holds what ``python -m benchmarks.calibrate`` fitted; docs/method.md says on what, and how
well it holds on other buildings.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

from mapmerge.config import HIGHEST_CONFIDENCE
from mapmerge.match.calibration import CONFIDENCE, ODDS
from mapmerge.match.cues import Contest, Fit, clearance

UNRIVALLED = 20.0
"""`Contest.lead_log_odds` where there is nothing else."""

_MOST_LOG_ODDS = 50.0
_TELLING = 2.0  # the fit's penalty understates how much likelier one placement is than another: ties alone shall be cut


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


@dataclass(frozen=True, slots=True)
class Additive:
    """A sum of curves.

    Parameters
    ----------
    intercept
        Log odds where all cues are at or below their first knot.
    curves
        By the name of their cue.
    """

    intercept: float
    curves: Mapping[str, Curve]

    def log_odds(self, cues: Fit | Contest) -> float:
        """Return the sum for cues."""
        return self.intercept + sum(curve.at(getattr(cues, name)) for name, curve in self.curves.items())


def additive(table: tuple[float, Mapping[str, tuple[tuple[float, ...], tuple[float, ...]]]]) -> Additive:
    """Return a model of `mapmerge.match.calibration`."""
    intercept, curves = table
    return Additive(intercept, {cue: Curve(*curve) for cue, curve in curves.items()})


_ODDS, _CONFIDENCE = additive(ODDS), additive(CONFIDENCE)


def log_odds_of(fit: Fit) -> float:
    """Return the log odds that a placement is right, by itself, against that none is."""
    return _ODDS.log_odds(fit)


def contest(fits: Sequence[Fit], log_odds: Sequence[float]) -> Contest:
    """Return how the first of some distinct placements stands among them.

    Parameters
    ----------
    fits
        Of each, at least one.
    log_odds
        `log_odds_of` each.
    """
    best, others = log_odds[0], log_odds[1:]
    most = max(0.0, *log_odds)
    total = math.exp(-most) + sum(math.exp(value - most) for value in log_odds)
    rival_m = max((fit.score_m for fit in fits[1:]), default=0.0)
    score_m = fits[0].score_m
    lead_m = max(0.0, score_m - max(0.0, rival_m))
    return Contest(
        log_odds=best,
        lead_log_odds=min(UNRIVALLED, best - max(others)) if others else UNRIVALLED,
        share=math.exp(best - most) / total,
        likeness=min(1.0, max(0.0, rival_m) / score_m) if score_m > 0.0 else 1.0,
        lead_m=lead_m,
        crowd=1.0 + sum(math.exp(min(_MOST_LOG_ODDS, _TELLING * (value - best))) for value in others),
        clearance=clearance(lead_m, fits[0].contradicted_m),
    )


def confidence(standing: Contest, tries: float = 1.0) -> float:
    """Return the calibrated probability that the likeliest placement, which stands like this among others, is right.

    Of some placements that are about as likely only one is right, whatever else is said of them.

    Parameters
    ----------
    standing
        Among all that were weighed.
    tries
        It is the best of so many independent searches, each of which might have found a wrong one.
    """
    return after_tries(stated_confidence(_CONFIDENCE.log_odds(standing), standing.crowd), tries)


def after_tries(confidence: float, tries: float) -> float:
    """Return a confidence once its odds are divided by the number of searches that it is the best of."""
    return confidence / (confidence + tries * (1.0 - confidence))


def stated_confidence(log_odds: float, crowd: float) -> float:
    """Return the probability of log odds, at most one in so many as the choice is among."""
    return min(HIGHEST_CONFIDENCE, logistic(log_odds), 1.0 / crowd)


def times_as_likely(log_odds: float) -> float:
    """Return how many times as likely one placement is as another, from the difference of their log odds."""
    return math.exp(min(max(log_odds, -_MOST_LOG_ODDS), _MOST_LOG_ODDS))


def logistic(log_odds: float) -> float:
    """Return the probability of log odds."""
    return 1.0 / (1.0 + math.exp(-min(max(log_odds, -_MOST_LOG_ODDS), _MOST_LOG_ODDS)))
