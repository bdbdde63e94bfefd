"""Fits the default method's confidence to observations: ``python -m benchmarks.calibrate OBSERVATIONS.jsonl``.

The observations come from `benchmarks.collect`. What is held out of the fit is what the result is stated on: the share
of accepted placements that are wrong, with its 95 % bound, and a reliability diagram. With ``--write`` the fitted
curves replace those of `mapmerge.match.calibration`.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.fitting import KNOTS, Array, Models, fitted, reweighed
from benchmarks.observations import Observation, groups, read
from benchmarks.reliability import binned, diagram, wilson
from mapmerge.config import MergeConfig
from mapmerge.match import calibration
from mapmerge.match.confidence import stated_confidence

_LINE = 120
_THRESHOLDS = (0.8, 0.9, 0.95, 0.98, 0.99, 0.995, 0.999)


def source_of(models: Models) -> str:
    """Return the text of `mapmerge.match.calibration`."""
    lines = ['"""What `mapmerge.match.confidence` is made of; written by ``python -m benchmarks.calibrate``."""', ""]
    lines += ["from __future__ import annotations", ""]
    lines += ["Curves = dict[str, tuple[tuple[float, ...], tuple[float, ...]]]"]
    lines += ['"""Knots of each cue, and what is added to the log odds from each to the next."""', ""]
    for name, model, says in (
        ("ODDS", models.odds, "What placements are weighed by: an intercept and curves."),
        ("CONFIDENCE", models.confidence, "How sure the likeliest one is: an intercept and curves."),
    ):
        lines += [f"{name}: tuple[float, Curves] = (", f"    {model.intercept:.4f},", "    {"]
        lines += [line for cue, rises in zip(model.cues, model.rises, strict=True) for line in _row(cue, rises)]
        lines += ["    },", ")", f'"""{says}"""', ""]
    return "\n".join(lines)


def _row(cue: str, rises: Array) -> list[str]:
    at = ", ".join(f"{value:.4g}" for value in KNOTS[cue])
    up = ", ".join(f"{value + 0.0:.4f}" for value in rises)
    line = f'        "{cue}": (({at}), ({up})),'
    if len(line) <= _LINE:
        return [line]
    return [f'        "{cue}": (', f"            ({at}),", f"            ({up}),", "        ),"]


def stated(found: Sequence[Observation], models: Models) -> tuple[Array, NDArray[np.bool_]]:
    """Return the confidence of the likeliest candidate of each observation, and whether it is right."""
    cues, right = reweighed(found, models.odds)
    lead = cues[:, models.confidence.cues.index("lead_odds")]
    log_odds = models.confidence.log_odds(cues)
    return np.array([stated_confidence(*pair) for pair in zip(log_odds.tolist(), lead.tolist(), strict=True)]), right


def statement(
    found: Sequence[Observation], sure: Array, right: NDArray[np.bool_], thresholds: Sequence[float]
) -> list[str]:
    """Return what can be said of the placements that a confidence accepts, ambiguous pairs apart."""
    ambiguous = np.array([item.ambiguous for item in found])
    lines = [
        f"  {'least':<7} {'accepted':>8} {'wrong':>5}  {'95 % bound':<10}  {'placed rightly by overlap':<40} ambiguous"
    ]
    for least in thresholds:
        taken = (sure >= least) & ~ambiguous
        wrong = int((taken & ~right).sum())
        shares = " ".join(
            f"{lo:g}–{min(hi, 1.0):g}: {_share(found, taken & right, ~ambiguous, lo, hi)}"
            for lo, hi in ((0.1, 0.3), (0.3, 0.5), (0.5, 1.01))
        )
        both = (sure >= least) & ambiguous
        apart = f"{int((both & ~right).sum())} of {int(ambiguous.sum())} wrong"
        bound = 1.0 - wilson(int((taken & right).sum()), int(taken.sum()))[0]
        lines.append(f"  {least:<7g} {int(taken.sum()):>8} {wrong:>5}  {bound:<10.4f}  {shares:<40} {apart}")
    return lines


def by_group(found: Sequence[Observation], sure: Array, right: NDArray[np.bool_], least: float) -> list[str]:
    """Return how many of each group are accepted, and how many of these are wrong, ambiguous pairs apart."""
    lines = []
    for name in groups(found):
        taken = np.array([item.group == name and not item.ambiguous for item in found]) & (sure >= least)
        lines.append(f"  {name:<10} {int(taken.sum()):>5} accepted, {int((taken & ~right).sum()):>3} wrong")
    return lines


def _share(
    found: Sequence[Observation], good: NDArray[np.bool_], counted: NDArray[np.bool_], lo: float, hi: float
) -> str:
    there = counted & np.array([item.related and lo <= item.overlap < hi for item in found])
    return f"{int((there & good).sum())}/{int(there.sum())}"


def main() -> None:
    """Fit, and say how well it holds."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else None)
    parser.add_argument("observations", type=Path)
    parser.add_argument("--write", action="store_true", help="replace mapmerge/match/calibration.py")
    options = parser.parse_args()
    everything = read(options.observations)
    fit = [item for item in everything if not item.held_out]
    held_out = [item for item in everything if item.held_out]
    models = fitted(fit)
    least = MergeConfig().verify.min_confidence
    for title, items in (("fitted on", fit), ("held out", held_out)):
        sure, right = stated(items, models)
        print(f"\n{title}: {len(items)} pairs; of {int(right.sum())} the likeliest placement is right")
        print("\n".join(statement(items, sure, right, sorted({*_THRESHOLDS, least}))))
        print("\n".join(by_group(items, sure, right, least)))
        print("\n".join(diagram(binned(zip(sure.tolist(), right.tolist(), strict=True)))))
    if options.write:
        Path(str(calibration.__file__)).write_text(source_of(models), encoding="utf-8")


if __name__ == "__main__":
    main()
