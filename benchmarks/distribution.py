"""How the scores of simulated pairs at their true placement compare with those of real pairs."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.cases import Case
from benchmarks.published import MapSet, map_sets
from benchmarks.recordings import RECORDINGS, last_grids
from mapmerge.config import MergeConfig
from mapmerge.grid import Grid
from mapmerge.prepare import prepare
from mapmerge.sim2 import Sim2
from mapmerge.verify import Scores, verify
from replay.evaluation.truth import load_truth

_SHARES = (0.1, 0.25, 0.5, 0.75, 0.9)


@dataclass(frozen=True, slots=True)
class Scored:
    """The scores of one pair at its true placement."""

    group: str
    name: str
    scores: Scores


def scored(group: str, name: str, target: Grid, source: Grid, truth: Sim2) -> Scored:
    """Score a pair at its true placement."""
    config = MergeConfig()
    resolution_m = max(config.search.working_cell_m, target.resolution_m, source.resolution_m)
    maps = prepare(target, resolution_m, config), prepare(source, resolution_m, config)
    between_grids = maps[0].grid.map_from_grid.inverse() @ truth @ maps[1].grid.map_from_grid
    return Scored(group, name, verify(*maps, between_grids, config.verify))


def of_cases(cases: Iterable[Case]) -> Iterator[Scored]:
    """Yield the scores of the simulated pairs that belong together."""
    for case in cases:
        if case.related == "same place":
            pair = case.made()
            if pair.truth is not None:
                yield scored(f"simulated {case.kind}", pair.name, pair.target, pair.source, pair.truth)


def of_recordings(folder: Path) -> Iterator[Scored]:
    """Yield the scores of the last maps of the recordings, of all robots with the reference's."""
    for name in RECORDINGS:
        stem = name.partition(".")[0]
        grids = last_grids(folder / name)
        reference = next(iter(grids))
        for robot, truth in load_truth(folder / f"{stem}.truth.json").robots.items():
            if truth.reference_from_map is not None:
                pose = truth.reference_from_map
                yield scored("recordings", f"{stem} {robot}", grids[reference], grids[robot], pose)


def of_published(sets: Iterable[MapSet]) -> Iterator[Scored]:
    """Yield the scores of the published pairs."""
    for maps in sets:
        for (target, source), truth in maps.truth.items():
            yield scored(maps.name.split(",")[0], f"{target} {source}", maps.grids[target], maps.grids[source], truth)


def table(found: Iterable[Scored]) -> list[str]:
    """Return lines: for each group, quantiles of ω, wall agreement, and violated walls for each matched metre."""
    groups: dict[str, list[Scores]] = {}
    for item in found:
        groups.setdefault(item.group, []).append(item.scores)
    quantiles = " ".join(f"{share:>5.0%}" for share in _SHARES)
    lines = [f"{'':<24}{'pairs':>6}   {'ω':<31}   {'wall agreement':<31}", f"{'':<30}   {quantiles:<31}   {quantiles}"]
    return lines + [_line(name, scores) for name, scores in groups.items()]


def _line(name: str, scores: list[Scores]) -> str:
    columns: Mapping[str, list[float]] = {
        "ω": [item.acceptance for item in scores],
        "walls": [item.wall_agreement for item in scores],
    }
    texts = [" ".join(f"{value:>5.2f}" for value in np.quantile(values, _SHARES)) for values in columns.values()]
    return f"{name:<24}{len(scores):>6}   {texts[0]:<31}   {texts[1]}"


def distribution(cases: Iterable[Case], folder: Path | None) -> list[str]:
    """Return the lines of the whole comparison."""
    found = list(of_cases(cases))
    found += [Scored("simulated, all", item.name, item.scores) for item in found]
    if folder is not None:
        found += [*of_recordings(folder / "real"), *of_published(map_sets(folder))]
    return table(found)
