"""The paper's tables on the authors' own maps: ``python -m benchmarks.paper [--pictures DIR] [--no-noise]``.

Prints the paper's tables 3, 4, 5 and 8 with what is found here beside them, what the literal readings of the paper
give, the placement of three maps, and a sweep over lidar noise. A transform is right if it is within 0.25 m and 2° of
the best one of an exhaustive alignment. With ``--pictures``, writes pictures like the paper's figures 14 to 21.
"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

from benchmarks import flags
from benchmarks.data import data_folder
from benchmarks.paper_cases import (
    MAX_ERROR_DEG,
    MAX_ERROR_M,
    SCENARIO_1,
    SCENARIO_2,
    STRANGERS,
    Case,
    Outcome,
    errors,
    load_case,
    load_map,
    run,
)
from benchmarks.paper_noise import sweep
from benchmarks.paper_pictures import write_global_map, write_pictures
from mapmerge.config import MergeConfig, PaperConfig, RansacConfig
from mapmerge.merger import Merger
from mapmerge.result import MergeResult

METHODS = ("existing", "paper", "correlation")
_LITERAL = PaperConfig(turn_tolerance_rad=0.0, max_models=1, ransac=RansacConfig(in_both=False))
LITERAL: tuple[tuple[str, MergeConfig], ...] = (
    ("scale unbounded", MergeConfig(method="paper", scale="free", scale_range=(0.01, 100.0), paper=_LITERAL)),
    ("turn unbounded", MergeConfig(method="paper", paper=_LITERAL)),
    ("ICP unbounded", MergeConfig(method="paper", paper=PaperConfig(max_models=1, icp_reject_m=(1000.0,)))),
    ("one model", MergeConfig(method="paper", paper=PaperConfig(max_models=1))),
    ("as it is here", MergeConfig(method="paper")),
)


def cell(outcome: Outcome) -> str:
    """Return a table's cell: acceptance index, whether the transform is right, whether it is accepted."""
    verdict = "right" if outcome.right else "WRONG"
    return f"{outcome.omega:.3f} {verdict} {'accepted' if outcome.match.accepted else 'refused '}"


def print_scenario(title: str, cases: list[Case], found: dict[tuple[str, str], Outcome]) -> None:
    """Print what all methods make of the sets of one scenario, beside the best alignment there is."""
    print(f"\n{title}\n{'set':<14}{'ω at truth':>11}" + "".join(f"{name:>26}" for name in METHODS))
    for case in cases:
        omega = case.truth_scores.acceptance if case.truth_scores else 0.0
        print(f"{case.label:<14}{omega:>11.3f}" + "".join(f"{cell(found[case.label, name]):>26}" for name in METHODS))


def print_paper_tables(tables: dict[str, Any], found: dict[tuple[str, str], Outcome]) -> None:
    """Print the paper's tables 3, 4, 5 and 8 with what is found here beside them."""
    print("\nTables 3, 4 and 5: acceptance indices of scenario 1, the paper's and ours")
    heads = f"{'3: existing':>12}{'ours':>8}{'':<8}{'4: proposed':>12}{'ours':>8}{'':<8}{'5: gain':>10}{'ours':>9}"
    print(f"{'set':<14}{heads}")
    for label, *_ in SCENARIO_1:
        paper = tables["scenario1"]["set" + label[4]]
        ours = [found[label, name] for name in ("existing", "paper")]
        gain = paper["proposed"] / paper["existing"] - 1.0
        our_gain = ours[1].omega / ours[0].omega - 1.0 if ours[0].omega else 0.0
        cells = [f"{'right' if each.right else 'WRONG':>8}" for each in ours]
        print(
            f"{label:<14}{paper['existing']:>12.3f}{ours[0].omega:>8.3f}{cells[0]}{paper['proposed']:>12.3f}"
            f"{ours[1].omega:>8.3f}{cells[1]}{gain:>+10.2%}{our_gain:>+9.2%}"
        )
    print("\nTable 8: acceptance indices of scenario 2 (the paper does not say which of its files is which map)")
    for number, (label, *_) in enumerate(SCENARIO_2):
        paper_omega = tables["scenario2"][f"set{number % 2 + 1}"]["proposed"]
        print(f"{label:<14}{paper_omega:>12.3f}{cell(found[label, 'paper']):>26}")


def print_literal(cases: list[Case]) -> None:
    """Print what becomes of the sets if the paper is read to the letter."""
    print("\nThe paper's method read to the letter, one reading at a time (ω, transform, scale)")
    print(f"{'reading':<18}" + "".join(f"{case.label:>22}" for case in cases))
    for name, config in LITERAL:
        cells = []
        for case in cases:
            outcome = run(case, config)
            pose = outcome.match.target_from_source
            scale = f"×{pose.scale:.2f}" if pose else "–"
            right = outcome.right and pose is not None and abs(pose.scale - 1.0) < 0.05
            cells.append(f"{outcome.omega:.3f} {'right' if right else 'WRONG'} {scale}")
        print(f"{name:<18}" + "".join(f"{each:>22}" for each in cells), flush=True)


def print_three(folder: Path, cases: list[Case], method: str, suffix: str) -> MergeResult:
    """Print where three maps of scenario 2 are placed in one frame; y1 on y2 directly would be a false merge."""
    names = [f"scenario2_{name}{suffix}" for name in ("y3", "y1", "y2")]
    grids = {name: load_map(folder, name) for name in names}
    result = Merger(names, MergeConfig(method=method)).step(grids)
    words = []
    for name in names[1:]:
        case = next(case for case in cases if case.target_name == names[0] and case.source_name == name)
        pose = result.robots[name].merged_from_map
        error_m, error_deg = errors(pose, case.truth, case.at_m)
        right = error_m <= MAX_ERROR_M and error_deg <= MAX_ERROR_DEG
        reason = "" if pose else f" ({result.robots[name].reason.code})"
        words.append(f"{name[10:]} {'right' if right else 'WRONG' if pose else 'not placed'}{reason}")
    direct = result.pairs[names[1], names[2]]
    print(f"{method:<12} with {names[0][10:]}: {', '.join(words)}; y1 on y2: {direct.reason.code}, "
          f"ω {direct.scores.acceptance if direct.scores else 0:.3f}")  # fmt: skip
    return result


def main() -> int:
    """Print all tables."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else None)
    parser.add_argument("--pictures", type=flags.folder, metavar="DIR", help="write pictures into this folder")
    parser.add_argument("--no-noise", action="store_true", help="leave the sweep over lidar noise out")
    options = parser.parse_args()
    root = data_folder()
    if root is None:
        sys.exit("the authors' maps are absent; set REPLAY_DATA to the folder that holds paper/")
    folder = root / "paper"
    tables = json.loads((folder / "paper_tables.json").read_text(encoding="utf-8"))
    first, second = ([load_case(folder, *each) for each in sets] for sets in (SCENARIO_1, SCENARIO_2))
    stranger = replace(load_case(folder, *STRANGERS), truth=None)
    cases = [*first, *second, stranger]
    found = {(case.label, name): run(case, MergeConfig(method=name)) for case in cases for name in METHODS}
    print(f"ω ≥ 0.95 is accepted; right: within {MAX_ERROR_M:g} m and {MAX_ERROR_DEG:g}° of an exhaustive alignment")
    print_scenario("Scenario 1", first, found)
    print_scenario("Scenario 2; y1 and y2 are not to be merged directly", [*second, stranger], found)
    seconds = [sum(found[case.label, name].seconds for case in cases) / len(cases) for name in METHODS]
    print("mean processor time " + ", ".join(f"{name} {s:.1f} s" for name, s in zip(METHODS, seconds, strict=True)))
    print_paper_tables(tables, found)
    print_literal(first[:3])
    print("\nThree maps in one frame (figure 21)")
    merged = {(name, suffix): print_three(folder, second, name, suffix) for suffix in ("", "_1") for name in METHODS}
    if options.pictures is not None:
        write_pictures(options.pictures, cases, found)
        write_global_map(options.pictures, merged["paper", ""])
        print(f"\npictures are in {options.pictures}")
    if not options.no_noise:
        print()
        sweep()
    return 0


if __name__ == "__main__":
    sys.exit(main())
