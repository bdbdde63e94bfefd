"""`replay evaluate`: how far a run is from known truth."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from replay.errors import UsageError
from replay.exit_status import EXIT_DIFFERS, EXIT_DONE
from replay.flags.numbers import at_least_0
from replay.plain_text import plain
from replay.standard_streams import printing, say

if TYPE_CHECKING:
    from replay.evaluation.truth import Truth
    from replay.evaluation.words import MapEvaluation

USAGE = "OUT --truth TRUTH.json [options]"
DESCRIPTION = """\
Hold a run against known truth: how far each robot's map is from where it truly lies, who was merged wrongly or
missed and, with --true-map, how alike the merged map and the true one are. OUT is OUT.json or OUT.mcap of a run.
"""
EPILOG = """\
TRUTH.json says where the robots' map frames truly lie in that of one of them:

  {"reference": "r1",
   "robots": {"r2": {"x_m": 28.16, "y_m": 0.91, "yaw_rad": 2.18, "overlap_centre_m": [5.3, 14.0]},
              "r3": {"same_place": false}}}

Positions are compared at overlap_centre_m, a point of the robot's map frame; at its origin if that is not said.
The true map's frame is the reference's, or lies in it at "reference_from_true_map": {"x_m": …, "y_m": …, "yaw_rad": …}.

examples:
  replay evaluate out/floor.json --truth floor.truth.json
  replay evaluate out/floor.mcap --truth floor.truth.json --true-map plan.yaml
  replay evaluate out/floor.json --truth floor.truth.json --max-error-m 0.1 --max-error-deg 1

exit status: 0 evaluated; 1 an error is larger than --max-error-m or --max-error-deg allow, or somebody was merged
wrongly or missed and either is given: the last lines say who; 2 bad usage, or an input that cannot be read; 3 what
was found could not be written, or a bug; 130 interrupted
"""


def add_flags(parser: argparse.ArgumentParser) -> None:
    """Add the run, the truth, and how large errors may be."""
    parser.add_argument("file", metavar="OUT", type=Path, help="OUT.json or OUT.mcap; with --true-map, OUT.mcap")
    parser.add_argument("--truth", metavar="TRUTH.json", type=Path, required=True, help="where the maps truly lie")
    parser.add_argument(
        "--true-map", metavar="MAP", type=Path, help="the true map: a saved one's .yaml, or a recording"
    )
    parser.add_argument(
        "--tolerance-m",
        metavar="METRES",
        default="0.1",
        help="how far apart a wall and its true place may be (default: %(default)s)",
    )
    limits = parser.add_argument_group(
        "limits, beyond which the exit status is 1", "of the two, one that is not given is 1 m, or 5°"
    )
    limits.add_argument("--max-error-m", metavar="METRES", help="largest error in position")
    limits.add_argument("--max-error-deg", metavar="DEGREES", help="largest error in direction")
    parser.add_argument("--json", action="store_true", help="print what is found as JSON")


def run(options: argparse.Namespace) -> int:
    """Evaluate, and print what is found."""
    from replay.evaluation.errors import Limits, pose_errors
    from replay.evaluation.truth import load_truth
    from replay.evaluation.words import json_text, lines
    from replay.report_file import read_report
    from replay.run_result import RunResult

    given = {"distance_m": _limit(options, "--max-error-m"), "angle_deg": _limit(options, "--max-error-deg")}
    said = {name: limit for name, limit in given.items() if limit is not None}
    limits = Limits(**said) if said else None
    result = RunResult.of(read_report(options.file), options.file)
    truth = load_truth(options.truth).seen_from(result.reference, options.truth)
    errors = pose_errors(result, truth)
    of_map = _map_evaluation(options, truth) if options.true_map is not None else None
    with printing():
        if options.json:
            sys.stdout.write(json_text(errors, of_map, limits))
        else:
            for line in lines(errors, of_map, limits):
                print(plain(line))
    return EXIT_DIFFERS if limits is not None and errors.beyond(limits) else EXIT_DONE


def _limit(options: argparse.Namespace, flag: str) -> float | None:
    text: str | None = getattr(options, flag.removeprefix("--").replace("-", "_"))
    return None if text is None else at_least_0(flag, text)


def _map_evaluation(options: argparse.Namespace, truth: Truth) -> MapEvaluation:
    tolerance_m = at_least_0("--tolerance-m", options.tolerance_m)

    from mapmerge.config import CellConfig
    from mapmerge.likeness import likeness
    from mapmerge.sim2 import IDENTITY
    from replay.evaluation.words import MapEvaluation
    from replay.export.maps import THE_MAP, one_map, told
    from replay.report_file import holds_mcap

    if not holds_mcap(options.file):
        raise UsageError(f"--true-map: {options.file} holds no merged map; give OUT.mcap")
    merged, true = (
        one_map(path, None, None, lambda event: say(f"replay: {told(event)}")).grids[THE_MAP]
        for path in (options.file, options.true_map)
    )
    merged_from_true = truth.reference_from_true_map or IDENTITY
    found = likeness(merged, true, merged_from_true, tolerance_m, CellConfig())
    return MapEvaluation(found, merged_from_true, tolerance_m)
