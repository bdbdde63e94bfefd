"""Additive models with monotone curves, fitted to observations: which placement is likeliest, and how sure it is."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, minimize

from benchmarks.observations import Observation, groups
from mapmerge.config import VerifyConfig
from mapmerge.match.confidence import Additive, Curve, contest
from mapmerge.match.cues import Contest, Fit
from mapmerge.match.weigh import likeliest_first, shares_too_little

Array = NDArray[np.float64]

AGAINST = {"far_share", "slack_far_share", "likeness"}
"""Cues that speak against a placement; all others speak for it."""
KNOTS: dict[str, tuple[float, ...]] = {
    "matched_wall_m": (4, 8, 11, 15, 20, 28, 40, 60, 90, 130, 200, 300),
    "far_share": (0, 0.005, 0.01, 0.02, 0.03, 0.05, 0.08, 0.12, 0.2),
    "slack_far_share": (0, 0.003, 0.006, 0.01, 0.015, 0.02, 0.03, 0.05, 0.08, 0.12),
    "slack_agreement": (0.5, 0.65, 0.72, 0.78, 0.82, 0.86, 0.9, 0.93, 0.96, 0.98, 1),
    "solidity": (-3, -1, -0.5, 0, 0.5, 1, 1.5, 2, 2.5, 3, 4, 5),
    "acceptance": (0.5, 0.7, 0.8, 0.85, 0.9, 0.93, 0.95, 0.97, 0.985, 1),
    "overlap_m2": (1, 5, 10, 14, 18, 24, 32, 45, 65, 100, 160, 250, 400),
    "overlap_fraction": (0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.7, 0.9),
    "aligned": (0, 0.3, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 1),
    "held_m": (0.5, 1, 2, 3, 4.5, 6, 9, 13, 18, 25, 40, 70),
    "log_odds": (-6, -4, -2, -1, 0, 1, 2, 3, 4, 5, 6, 8, 10),
    "lead_log_odds": (0, 0.5, 1, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10, 14),
    "share": (0, 0.02, 0.05, 0.1, 0.2, 0.35, 0.6, 0.8, 0.9, 0.95, 0.98, 0.99, 0.997, 1),
    "likeness": (0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.78, 0.85, 0.92, 1),
    "lead_m": (0, 2, 4, 7, 11, 16, 24, 35, 50, 80, 120, 200),
    "clearance": (-3, -1, -0.5, 0, 0.5, 1, 1.5, 2, 2.5, 3, 4),
}
"""Where curves bend."""
FIT = tuple(item.name for item in fields(Fit) if item.name in KNOTS)
"""Cues that placements are weighed by."""
CONTEST = tuple(item.name for item in fields(Contest) if item.name in KNOTS)
"""Cues that the confidence of the likeliest one is computed from."""
ODDS_PENALTY, CONFIDENCE_PENALTY = 1e-4, 3e-5
FOLDS = 5


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """An additive model with monotone curves.

    Parameters
    ----------
    cues
        Names.
    rises
        Of each cue, between its knots.
    intercept
        Log odds where all cues are at or below their first knot.
    """

    cues: tuple[str, ...]
    rises: tuple[Array, ...]
    intercept: float

    def log_odds(self, values: Array) -> Array:
        """Return the sum for rows of cues, shape (…, number of cues)."""
        return np.asarray(ramps(values, self.cues) @ np.concatenate(self.rises) + self.intercept, np.float64)

    @property
    def additive(self) -> Additive:
        """The model as the library has it."""
        pairs = zip(self.cues, self.rises, strict=True)
        return Additive(self.intercept, {cue: Curve(KNOTS[cue], tuple(rises.tolist())) for cue, rises in pairs})


@dataclass(frozen=True, slots=True, eq=False)
class Models:
    """What placements are weighed by, and how sure the likeliest one is."""

    odds: Model
    confidence: Model


@dataclass(frozen=True, slots=True)
class Standing:
    """What is offered of one pair.

    Parameters
    ----------
    row
        Which of its candidates; None if there is none.
    contest
        How that one stands.
    is_enough
        Whether it shares and agrees as much as an accepted one must, however sure it is.
    """

    row: int | None
    contest: Contest | None
    is_enough: bool


def ramps(values: Array, cues: Sequence[str]) -> Array:
    """Return how far each cue has passed from each of its knots to the next, shape (…, number of steps)."""
    parts = []
    for column, cue in enumerate(cues):
        knots = np.array(KNOTS[cue], np.float64)
        parts.append(np.clip((values[..., column, None] - knots[:-1]) / np.diff(knots), 0.0, 1.0))
    return np.concatenate(parts, axis=-1)


def fit_array(found: Sequence[Observation]) -> tuple[Array, NDArray[np.bool_], NDArray[np.bool_]]:
    """Return the cues of all candidates, shape (N, K, number of cues), which there are, and which are right, (N, K)."""
    most = max((len(item.candidates) for item in found), default=0)
    values = np.zeros((len(found), most, len(FIT)))
    there, right = (np.zeros((len(found), most), np.bool_) for _ in range(2))
    for row, item in enumerate(found):
        for column, candidate in enumerate(item.candidates):
            values[row, column] = [getattr(candidate.fit, cue) for cue in FIT]
            there[row, column], right[row, column] = True, item.right_one == column
    return values, there, right


def fitted_odds(
    values: Array, there: NDArray[np.bool_], right: NDArray[np.bool_], weights: Array, cues: Sequence[str] = FIT
) -> Model:
    """Return the model that makes the right candidates of all pairs likeliest, or none where none is right.

    A conditional logit: McFadden, *Conditional logit analysis of qualitative choice behavior*, 1974, with a small
    penalty and curves that go one way only.
    """
    passed = _signed(ramps(values, cues), cues)
    share = weights / weights.sum()
    none = ~right.any(axis=1)

    def loss(point: Array, /) -> tuple[float, Array]:
        log_odds = np.where(there, passed @ point[:-1] + point[-1], -np.inf)
        most = np.maximum(log_odds.max(axis=1), 0.0)
        likely, nothing = np.exp(log_odds - most[:, None]), np.exp(-most)
        total = likely.sum(axis=1) + nothing
        good = np.where(none, nothing, (likely * right).sum(axis=1))
        chosen = np.where(right, likely, 0.0) / np.maximum(np.where(none, 1.0, good), 1e-300)[:, None]
        gap = (likely / total[:, None] - chosen) * share[:, None]
        slope = np.append(np.einsum("nk,nkc->c", gap, passed), gap.sum())
        value = -float(share @ np.log(np.maximum(good / total, 1e-300)))
        return value + ODDS_PENALTY * float(point[:-1] @ point[:-1]), slope + 2 * ODDS_PENALTY * _ends(point)

    return _minimised(loss, cues)


def fitted_confidence(values: Array, right: NDArray[np.bool_], weights: Array, cues: Sequence[str] = CONTEST) -> Model:
    """Return the logistic model of largest likelihood, with a small penalty, of rows of cues that are right or not."""
    passed = _signed(ramps(values, cues), cues)
    share, sign = weights / weights.sum(), np.where(right, 1.0, -1.0)

    def loss(point: Array, /) -> tuple[float, Array]:
        margin = sign * (passed @ point[:-1] + point[-1])
        gap = -share * sign / (1.0 + np.exp(np.clip(margin, -500.0, 500.0)))
        slope = np.append(gap @ passed, gap.sum())
        value = float(share @ np.logaddexp(0.0, -margin))
        return value + CONFIDENCE_PENALTY * float(point[:-1] @ point[:-1]), slope + 2 * CONFIDENCE_PENALTY * _ends(
            point
        )

    return _minimised(loss, cues)


def standings(found: Sequence[Observation], log_odds: Array) -> tuple[list[Standing], NDArray[np.bool_]]:
    """Return what is offered of each pair, and whether it is right.

    Parameters
    ----------
    found
        Observations.
    log_odds
        Of their candidates, shape (N, K).
    """
    offered = [
        _standing(item, mine[: len(item.candidates)].tolist()) for item, mine in zip(found, log_odds, strict=True)
    ]
    right = [
        standing.row is not None and standing.row == item.right_one
        for standing, item in zip(offered, found, strict=True)
    ]
    return offered, np.array(right, np.bool_)


def _standing(item: Observation, log_odds: Sequence[float]) -> Standing:
    limits = VerifyConfig()
    fits = [candidate.fit for candidate in item.candidates]
    if not fits:
        return Standing(None, None, is_enough=False)
    order = likeliest_first(fits, log_odds, limits)
    best = fits[order[0]]
    is_enough = not shares_too_little(best, limits) and best.wall_agreement >= limits.least_agreement
    return Standing(order[0], contest([fits[row] for row in order], [log_odds[row] for row in order]), is_enough)


def contest_array(offered: Sequence[Standing]) -> Array:
    """Return the cues of standings, shape (N, number of cues)."""
    rows = [[getattr(item.contest, cue) for cue in CONTEST] for item in offered]
    return np.array(rows, np.float64).reshape(len(offered), len(CONTEST))


def fitted(found: Sequence[Observation]) -> Models:
    """Return both models; all groups of observations count as much.

    The second is fitted to what the first says of buildings that it was not fitted to: of those that it was fitted to
    it is too sure.
    """
    weights = balanced(found)
    values, there, right = fit_array(found)
    fold = folds(found)
    log_odds = np.full(there.shape, -np.inf)
    for number in range(FOLDS):
        mine, others = fold == number, fold != number
        model = fitted_odds(values[others], there[others], right[others], weights[others])
        log_odds[mine] = model.log_odds(values[mine])
    offered, is_right = standings(found, log_odds)
    seen = np.array([item.contest is not None for item in offered])
    cues = contest_array([item for item in offered if item.contest is not None])
    sure = fitted_confidence(cues, is_right[seen], weights[seen])
    return Models(fitted_odds(values, there, right, weights), sure)


def folds(found: Sequence[Observation]) -> NDArray[np.intp]:
    """Return in which of some parts each observation is: all of one building are in the same, each group is in all."""
    names = sorted({item.building for item in found})
    return np.array([names.index(item.building) % FOLDS for item in found], np.intp)


def balanced(found: Sequence[Observation]) -> Array:
    """Return weights by which recorded maps count as much as all simulated ones of one kind."""
    sizes = {name: len(items) for name, items in groups(found).items()}
    return np.array([1.0 / sizes[item.group] for item in found])


def _signed(passed: Array, cues: Sequence[str]) -> Array:
    """Return what rises where a cue says more for a placement: all that is fitted is then at least 0."""
    signs = np.concatenate([np.full(len(KNOTS[cue]) - 1, _sign(cue)) for cue in cues])
    return np.asarray(passed * signs, np.float64)


def _sign(cue: str) -> float:
    return -1.0 if cue in AGAINST else 1.0


def _ends(point: Array) -> Array:
    """Return what is penalised: all but the intercept."""
    return np.append(point[:-1], 0.0)


def _minimised(loss: Callable[[Array], tuple[float, Array]], cues: Sequence[str]) -> Model:
    sizes = [len(KNOTS[cue]) - 1 for cue in cues]
    start = np.append(np.zeros(sum(sizes)), 0.0)
    bounds = Bounds(np.append(np.zeros(sum(sizes)), -np.inf), np.full(sum(sizes) + 1, np.inf))
    # few pairs decide where few placements are wrong: what they ask for is small beside the sum
    found = minimize(
        loss,
        start,
        jac=True,
        bounds=bounds,
        method="L-BFGS-B",
        options={"maxiter": 20_000, "maxfun": 40_000, "ftol": 1e-14, "gtol": 1e-9, "maxcor": 30},
    )
    if not found.success:
        raise RuntimeError(f"the fit did not converge: {found.message}")
    parts = np.split(np.asarray(found.x[:-1], np.float64), np.cumsum(sizes)[:-1])
    rises = tuple(_sign(cue) * part for cue, part in zip(cues, parts, strict=True))
    return Model(tuple(cues), rises, float(found.x[-1]))
