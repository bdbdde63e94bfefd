"""Fits the default method's confidence to observations: ``python -m benchmarks.calibrate OBSERVATIONS.jsonl``.

The observations come from `benchmarks.collect`. What is held out of the fit is what the result is stated on: the share
of accepted placements that are wrong, with its 95% bound, and a reliability diagram. With ``--write`` the fitted
curves replace those of `mapmerge.match.calibration`.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.fitting import KNOTS, Array, Models, fit_array, fitted, standings
from benchmarks.flags import file
from benchmarks.observations import Observation, groups, read
from benchmarks.reliability import binned, diagram, wilson
from mapmerge.config import MergeConfig
from mapmerge.match import calibration
from mapmerge.match.confidence import stated_confidence

_LINE = 120
_THRESHOLDS = (0.8, 0.9, 0.91, 0.92, 0.93, 0.95, 0.98, 0.99, 0.999)


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


@dataclass(frozen=True, slots=True, eq=False)
class Stated:
    """What the models say of observations.

    Parameters
    ----------
    sure
        Confidence of what is offered of each; 0 where nothing is, or where it shares or agrees too little.
    right
        Whether that is right.
    """

    sure: Array
    right: NDArray[np.bool_]


def stated(found: Sequence[Observation], models: Models) -> Stated:
    """Return the confidence of what is offered of each observation, and whether it is right."""
    values, there, _ = fit_array(found)
    offered, right = standings(found, np.where(there, models.odds.log_odds(values), -np.inf))
    additive = models.confidence.additive
    sure = [
        stated_confidence(additive.log_odds(item.contest), item.contest.crowd)
        if item.contest and item.is_enough
        else 0.0
        for item in offered
    ]
    return Stated(np.array(sure, np.float64), right)


def statement(found: Sequence[Observation], said: Stated, thresholds: Sequence[float]) -> list[str]:
    """Return what can be said of the placements that a confidence accepts, ambiguous pairs apart."""
    ambiguous = np.array([item.ambiguous for item in found])
    head = f"  {'least':<7} {'accepted':>8} {'wrong':>5}  {'95% bound':<10}  {'buildings with a wrong one':<32}"
    lines = [f"{head}  {'placed rightly by overlap':<42} ambiguous"]
    for least in thresholds:
        taken = (said.sure >= least) & ~ambiguous
        wrong = taken & ~said.right
        shares = " ".join(
            f"{lo:g}–{min(hi, 1.0):g}: {_share(found, taken & said.right, ~ambiguous, lo, hi)}"
            for lo, hi in ((0.1, 0.3), (0.3, 0.5), (0.5, 1.01))
        )
        both = (said.sure >= least) & ambiguous
        apart = f"{int((both & ~said.right).sum())} of {int(ambiguous.sum())} wrong"
        bound = f"{_bound(int(wrong.sum()), int(taken.sum())):.4f}"
        places = f"{_buildings(found, wrong)} of {_buildings(found, taken)}"
        places += f" (95% bound {_bound(_buildings(found, wrong), _buildings(found, taken)):.3f})"
        head = f"  {least:<7g} {int(taken.sum()):>8} {int(wrong.sum()):>5}  {bound:<10}  {places:<32}"
        lines.append(f"{head}  {shares:<42} {apart}")
    return lines


def _bound(wrong: int, count: int) -> float:
    """Return what share may be wrong, if each is for itself."""
    return 1.0 - wilson(count - wrong, count)[0]


def _buildings(found: Sequence[Observation], chosen: NDArray[np.bool_]) -> int:
    return len({item.building for item, is_chosen in zip(found, chosen.tolist(), strict=True) if is_chosen})


def recall(found: Sequence[Observation]) -> str:
    """Return how often the right placement is among those that were weighed."""
    clear = [item for item in found if item.related and not item.ambiguous]
    there = sum(item.right_one is not None for item in clear)
    return f"the right placement is among those weighed in {there} of {len(clear)}"


def by_group(found: Sequence[Observation], said: Stated, least: float) -> list[str]:
    """Return how many of each group are accepted, and how many of these are wrong, ambiguous pairs apart."""
    lines = []
    for name in groups(found):
        taken = np.array([item.group == name and not item.ambiguous for item in found]) & (said.sure >= least)
        lines.append(f"  {name:<10} {int(taken.sum()):>5} accepted, {int((taken & ~said.right).sum()):>3} wrong")
    return lines


def _share(
    found: Sequence[Observation], good: NDArray[np.bool_], counted: NDArray[np.bool_], lo: float, hi: float
) -> str:
    there = counted & np.array([item.related and lo <= item.overlap < hi for item in found])
    return f"{int((there & good).sum())}/{int(there.sum())}"


def main() -> None:
    """Fit, and say how well it holds."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else None)
    parser.add_argument("observations", type=file, help="what benchmarks.collect wrote")
    parser.add_argument("--write", action="store_true", help="replace mapmerge/match/calibration.py")
    options = parser.parse_args()
    try:
        everything = read(options.observations)
    except (ValueError, TypeError, KeyError) as error:
        parser.error(f"{options.observations}: these are no observations of benchmarks.collect: {error}")
    fit = [item for item in everything if not item.held_out]
    held_out = [item for item in everything if item.held_out]
    if not fit or not held_out:
        parser.error(f"{options.observations}: expected buildings that are held out, and others; collect more missions")
    models = fitted(fit)
    least = MergeConfig().verify.min_confidence
    for title, items in (("fitted on", fit), ("held out", held_out)):
        said = stated(items, models)
        print(f"\n{title}: {len(items)} pairs; {recall(items)} clear ones")
        print("\n".join(statement(items, said, sorted({*_THRESHOLDS, least}))))
        print("\n".join(by_group(items, said, least)))
        print("\n".join(diagram(binned(zip(said.sure.tolist(), said.right.tolist(), strict=True)))))
    if options.write:
        Path(str(calibration.__file__)).write_text(source_of(models), encoding="utf-8")


if __name__ == "__main__":
    main()
