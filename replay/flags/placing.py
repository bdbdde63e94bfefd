"""How maps are placed."""

from __future__ import annotations

import argparse
import math
from typing import Any

from replay.errors import UsageError


def add(parser: argparse.ArgumentParser) -> None:
    """Add the flags of how maps are placed."""
    group = parser.add_argument_group("how maps are placed")
    group.add_argument(
        "--method",
        metavar="NAME",
        default="correlation",
        help="how two maps are matched: correlation, existing or paper (default: %(default)s)",
    )
    group.add_argument(
        "--scale",
        choices=("metadata", "free"),
        default="metadata",
        help="believe the maps' resolutions, or estimate how far their ratio is off, 0.4 to 2.5 times "
        "(default: %(default)s)",
    )
    group.add_argument(
        "--min-confidence",
        metavar="P",
        default="0.92",
        help="least probability that a placement is right (default: %(default)s; how many are wrong at each: "
        "docs/benchmarks.md); the methods existing and paper state none and ignore it",
    )
    group.add_argument(
        "--init-pose",
        action="append",
        default=[],
        metavar="R=X,Y,YAW[±SX,±SY,±SYAW]",
        help="where R's map frame lies in the reference's, metres and radians, or degrees with deg or °; the spread is "
        "a standard deviation, placements within 3 are searched; +- does for ± (default spread: 1 m, 1 m, 10°); "
        "may be repeated",
    )
    group.add_argument(
        "--use-tf",
        action="store_true",
        help="take such poses from transforms between map frames in /tf and /tf_static (spread: 0.5 m, 0.5 m, 5°)",
    )


def placing_options(options: argparse.Namespace) -> dict[str, Any]:
    """Return how maps are placed, as keywords of `RunOptions`."""
    from mapmerge.config import MergeConfig, VerifyConfig
    from mapmerge.errors import ConfigError
    from mapmerge.match import MATCHERS
    from replay.init_pose import InitPose

    if options.method not in MATCHERS:
        raise UsageError(f"--method {options.method}: there is no such method; expected {', '.join(MATCHERS)}")
    verify = VerifyConfig(min_confidence=_probability(options.min_confidence))
    try:
        merge = MergeConfig(method=options.method, scale=options.scale, verify=verify)
    except ConfigError as error:
        raise UsageError(f"--min-confidence {options.min_confidence}: {error}") from error
    return {
        "init_poses": tuple(InitPose.parse(text) for text in options.init_pose),
        "use_tf": options.use_tf,
        "merge": merge,
    }


def _probability(text: str) -> float:
    try:
        probability = float(text)
    except ValueError:
        probability = math.nan
    if not 0.0 < probability < 1.0:
        raise UsageError(f"--min-confidence {text}: expected a probability above 0 and below 1, such as 0.99")
    return probability
