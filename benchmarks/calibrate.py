"""Fits the default method's confidence to observations: ``python -m benchmarks.calibrate OBSERVATIONS.jsonl``.

The observations come from `benchmarks.collect`. What is held out of the fit is what the result is stated on: the share
of accepted placements that are wrong, with its 95 % bound, and a reliability diagram. With ``--write`` the fitted
curves replace those of `mapmerge.match.calibration`.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.observations import Observation, groups, read
from benchmarks.reliability import binned, diagram, wilson
from mapmerge.config import MergeConfig
from mapmerge.match import calibration
from mapmerge.match.confidence import contenders
from mapmerge.match.cues import Cues

Array = NDArray[np.float64]

AGAINST = {"far_share", "bend_m", "likeness"}
"""Cues that speak against a placement; all others speak for it."""
BY_RULE = "rival_agreement"
"""A cue that counts by a rule, see `mapmerge.match.confidence.contenders`, and is not fitted."""
_QUANTILES = (0.02, 0.15, 0.35, 0.6, 0.85, 0.98)
_KNOTS = {
    "matched_wall_m": (8, 11, 15, 20, 28, 40, 60, 90, 130, 200, 300),
    "wall_agreement": (0.5, 0.65, 0.72, 0.78, 0.82, 0.86, 0.9, 0.93, 0.96, 0.98, 1.0),
    "slack_agreement": (0.5, 0.65, 0.72, 0.78, 0.82, 0.86, 0.9, 0.93, 0.96, 0.98, 1.0),
    "far_share": (0.0, 0.005, 0.01, 0.02, 0.03, 0.05, 0.08, 0.12, 0.2),
    "likeness": (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.78, 0.85, 0.92, 1.0),
    "lead_m": (0, 2, 4, 7, 11, 16, 24, 35, 50, 80, 120, 200),
    "clearance": (-3.0, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0),
    "rival_agreement": (0.0, 0.6, 0.7, 0.78, 0.84, 0.88, 0.92, 0.95, 0.98, 1.0),
    "acceptance": (0.5, 0.7, 0.8, 0.85, 0.9, 0.93, 0.95, 0.97, 0.985, 1.0),
    "overlap_m2": (1, 5, 10, 14, 18, 24, 32, 45, 65, 100, 160, 250),
}
"""Where curves bend; those of other cues at quantiles of what was seen."""
_PENALTY = 3e-5
_STEPS = 9000
_LINE = 120


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """An additive logistic model with monotone curves.

    Parameters
    ----------
    knots
        Of each cue.
    rises
        Of each cue, between its knots.
    intercept
        Log odds where all cues are at or below their first knot.
    """

    knots: tuple[Array, ...]
    rises: tuple[Array, ...]
    intercept: float

    def confidence(self, cues: Array) -> Array:
        """Return the probability of each row of cues, shape (N, number of cues)."""
        log_odds = self.intercept + _ramps(cues, self.knots) @ np.concatenate(self.rises)
        shared = np.array([contenders(Cues(*row)) for row in cues.tolist()])
        return np.asarray(1.0 / (1.0 + np.exp(-log_odds)) / shared, np.float64)


def fitted(cues: Array, right: NDArray[np.bool_], weights: Array) -> Model:
    """Return the model of largest likelihood, with a small penalty on what it adds, found by projected descent."""
    knots = tuple(_knots(cue.name, cues[:, column]) for column, cue in enumerate(fields(Cues)))
    ramps = _ramps(cues, knots)
    signs = np.concatenate(
        [
            np.full(len(item) - 1, 0.0 if cue.name == BY_RULE else -1.0 if cue.name in AGAINST else 1.0)
            for cue, item in zip(fields(Cues), knots, strict=True)
        ]
    )
    columns = np.hstack([ramps * signs, np.ones((len(ramps), 1))])
    weights = weights / weights.sum()
    step = 4.0 / float(np.linalg.norm(columns * np.sqrt(weights)[:, None], 2) ** 2 + 4 * _PENALTY)
    point, ahead, momentum = np.zeros(columns.shape[1]), np.zeros(columns.shape[1]), 1.0
    for _ in range(_STEPS):
        gap = weights * (1.0 / (1.0 + np.exp(-columns @ ahead)) - right)
        slope = columns.T @ gap
        slope[:-1] += 2 * _PENALTY * ahead[:-1]
        after = ahead - step * slope
        after[:-1] = np.maximum(after[:-1], 0.0)
        grown = (1.0 + np.sqrt(1.0 + 4.0 * momentum**2)) / 2.0
        ahead = after + (momentum - 1.0) / grown * (after - point)
        point, momentum = after, grown
    splits = np.cumsum([len(item) - 1 for item in knots])[:-1]
    return Model(knots, tuple(np.split(point[:-1] * signs, splits)), float(point[-1]))


def cue_array(found: Sequence[Observation]) -> Array:
    """Return the cues of observations, shape (N, number of cues)."""
    return np.array([astuple(item.cues) for item in found], np.float64).reshape(len(found), len(fields(Cues)))


def balanced(found: Sequence[Observation]) -> Array:
    """Return weights by which recorded maps count as much as all simulated ones of one kind."""
    sizes = {name: len(items) for name, items in groups(found).items()}
    return np.array([1.0 / sizes[item.group] for item in found])


def _knots(cue: str, values: Array) -> Array:
    if cue in _KNOTS:
        return np.array(_KNOTS[cue], np.float64)
    knots = np.unique(np.quantile(values, _QUANTILES).round(4))
    return knots if len(knots) > 1 else np.array([knots[0], knots[0] + 1.0])


def _ramps(cues: Array, knots: Sequence[Array]) -> Array:
    parts = [
        np.clip((cues[:, column, None] - item[:-1]) / np.diff(item), 0.0, 1.0) for column, item in enumerate(knots)
    ]
    return np.hstack(parts)


def source_of(model: Model) -> str:
    """Return the text of `mapmerge.match.calibration`."""
    lines = ['"""What `mapmerge.match.confidence` is made of; written by ``python -m benchmarks.calibrate``."""', ""]
    lines += ["from __future__ import annotations", "", f"INTERCEPT = {model.intercept:.4f}", ""]
    lines += ["CURVES: dict[str, tuple[tuple[float, ...], tuple[float, ...]]] = {"]
    for cue, knots, rises in zip(fields(Cues), model.knots, model.rises, strict=True):
        at, up = (", ".join(f"{value:.4f}" for value in values) for values in (knots, rises))
        comma = "," if len(rises) == 1 else ""
        line = f'    "{cue.name}": (({at}), ({up}{comma})),'
        is_long = len(line) > _LINE
        lines += (
            [f'    "{cue.name}": (', f"        ({at}),", f"        ({up}{comma}),", "    ),"] if is_long else [line]
        )
    return "\n".join(
        [*lines, "}", '"""Knots of each cue, and what is added to the log odds from each to the next."""', ""]
    )


def statement(found: Sequence[Observation], stated: Array, least: float) -> list[str]:
    """Return what can be said of the placements that a confidence accepts."""
    lines = [f"accepted at {least:g} or more:"]
    everything = {**groups(found), "all": list(found)}
    for name, items in everything.items():
        chosen = np.array([name in (item.group, "all") for item in found])
        accepted = chosen & (stated >= least)
        right = np.array([item.right for item in found])
        wrong = int((accepted & ~right).sum())
        bound = 1.0 - wilson(int((accepted & right).sum()), int(accepted.sum()))[0]
        shares = " ".join(
            f"{lo:g}–{hi:g}: {_share(items, chosen, accepted & right, found, lo, hi)}"
            for lo, hi in ((0.1, 0.3), (0.3, 0.5), (0.5, 1.01))
        )
        lines.append(
            f"  {name:<10} {int(accepted.sum()):>5} accepted, {wrong:>3} wrong (95 % bound {bound:.4f}); "
            f"placed rightly by overlap {shares}"
        )
    return lines


def _share(
    items: Sequence[Observation],
    chosen: NDArray[np.bool_],
    good: NDArray[np.bool_],
    found: Sequence[Observation],
    lo: float,
    hi: float,
) -> str:
    there = chosen & np.array([item.related and lo <= item.overlap < hi for item in found])
    return f"{int((there & good).sum())}/{int(there.sum())}" if items else "–"


def main() -> None:
    """Fit, and say how well it holds."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else None)
    parser.add_argument("observations", type=Path)
    parser.add_argument("--write", action="store_true", help="replace mapmerge/match/calibration.py")
    options = parser.parse_args()
    clear = [item for item in read(options.observations) if not item.ambiguous]
    fit = [item for item in clear if not item.held_out]
    held_out = [item for item in clear if item.held_out]
    model = fitted(cue_array(fit), np.array([item.right for item in fit]), balanced(fit))
    least = MergeConfig().verify.min_confidence
    for title, items in (("fitted on", fit), ("held out", held_out)):
        stated = model.confidence(cue_array(items))
        print(f"\n{title}: {len(items)} pairs, {sum(item.right for item in items)} of them found rightly")
        print("\n".join(statement(items, stated, least)))
        print("\n".join(diagram(binned(zip(stated.tolist(), (item.right for item in items), strict=True)))))
    if options.write:
        Path(str(calibration.__file__)).write_text(source_of(model), encoding="utf-8")


if __name__ == "__main__":
    main()
