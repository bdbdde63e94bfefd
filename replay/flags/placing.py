"""How maps are placed."""

from __future__ import annotations

import argparse
import math
from typing import TYPE_CHECKING, Any

from replay.errors import UsageError

if TYPE_CHECKING:
    from mapmerge.config import MergeConfig


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
    from mapmerge.match import MATCHERS
    from replay.arguments import none_of
    from replay.init_pose import InitPose

    if options.method not in MATCHERS:
        raise UsageError(f"--method: {none_of(options.method, list(MATCHERS))}")
    return {
        "init_poses": tuple(InitPose.parse(text) for text in options.init_pose),
        "use_tf": options.use_tf,
        "merge": _merge_config(options),
    }


def _merge_config(options: argparse.Namespace) -> MergeConfig:
    """Return the settings of the merger: those that are flags, and those that were said by their names."""
    from replay.settings import fields

    others: dict[str, tuple[Any, str]] = getattr(options, "merge_fields", {})
    flags = {
        "merge.method": options.method,
        "merge.scale": options.scale,
        "merge.verify.min_confidence": _probability(options.min_confidence),
    }
    try:
        return fields.put_together({**{key: value for key, (value, _) in others.items()}, **flags})
    except UsageError as error:
        section, _, what = str(error).partition(": ")
        if what.startswith("min_confidence"):
            raise UsageError(f"--min-confidence {options.min_confidence}: {what}") from error
        origins = {key.rpartition(".")[0]: origin.rpartition(".")[0] for key, (_, origin) in others.items()}
        raise UsageError(f"{origins.get(section, section)}: {what}") from error


def _probability(text: str) -> float:
    try:
        probability = float(text)
    except ValueError:
        probability = math.nan
    if not 0.0 < probability < 1.0:
        raise UsageError(f"--min-confidence {text}: expected a probability above 0 and below 1, such as 0.99")
    return probability
