"""Placements on real recordings against their truth: ``python -m benchmarks.real``.

Prints for each robot whether it was placed, how far off, since when, and how often a placement was wrong on the way.
Exits with 1 if a robot is not where it should be, or placed where it should not be.
"""

from __future__ import annotations

import argparse
import math
import sys
from dataclasses import dataclass
from pathlib import Path

from benchmarks.data import Truth, data_folder, read_truth
from mapmerge.sim2 import Sim2, wrap_angle
from replay.events import Finished, Merged, Report
from replay.options import RunOptions
from replay.pipeline import merge
from replay.runs import RunPath

MAX_ERROR_M = 0.20
MAX_ERROR_DEG = 1.0
WRONG_M = 1.0
WRONG_DEG = 5.0

RECORDINGS = (
    "intel_two.mcap",
    "intel_res.mcap",
    "intel_noise.mcap",
    "intel_three.bag",
    "fr101_two",
    "fr101_half.mcap",
    "fhw_two.mcap",
    "other_place.mcap",
    "odd_one_out.mcap",
)


@dataclass(slots=True)
class Row:
    """What became of one robot in one recording."""

    placed_ticks: int = 0
    wrong_ticks: int = 0
    first_s: float | None = None


def errors(pose: Sim2, truth: Truth) -> tuple[float, float]:
    """Return the error of a placement in metres, amid the overlap, and in degrees."""
    if truth.reference_from_map is None:
        return math.inf, math.inf
    x_m, y_m = pose.apply_point(*truth.centre_m)
    true_x_m, true_y_m = truth.reference_from_map.apply_point(*truth.centre_m)
    turn_rad = wrap_angle(pose.yaw_rad - truth.reference_from_map.yaw_rad)
    return math.hypot(x_m - true_x_m, y_m - true_y_m), abs(math.degrees(turn_rad))


def replayed(path: Path, truths: dict[str, Truth]) -> tuple[Report, dict[str, Row]]:
    """Replay a recording and note how each robot fared at each tick."""
    rows = {robot: Row() for robot in truths}
    first_ns: int | None = None
    for event in merge(RunOptions(runs=(RunPath(None, path),), images="none")):
        if isinstance(event, Finished):
            return event.report, rows
        if not isinstance(event, Merged):
            continue
        first_ns = event.stamp_ns if first_ns is None else first_ns
        for robot, row in rows.items():
            pose = event.result.robots[robot].merged_from_map
            if pose is None:
                continue
            row.placed_ticks += 1
            row.first_s = (event.stamp_ns - first_ns) / 1e9 if row.first_s is None else row.first_s
            error_m, error_deg = errors(pose, truths[robot])
            row.wrong_ticks += error_m > WRONG_M or error_deg > WRONG_DEG
    raise AssertionError("a run ends with Finished")


def judged(status: dict[str, object], truth: Truth) -> tuple[bool, str]:
    """Return whether a robot ended as it should, and its errors or its reason."""
    pose = status["merged_from_map"]
    if not isinstance(pose, dict):
        reason = status["reason"]
        return truth.reference_from_map is None, str(reason["code"]) if isinstance(reason, dict) else ""
    error_m, error_deg = errors(Sim2(pose["x_m"], pose["y_m"], pose["yaw_rad"], pose["scale"]), truth)
    right = error_m <= MAX_ERROR_M and error_deg <= MAX_ERROR_DEG
    return right, f"{error_m:.3f} m {error_deg:.2f}°"


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else None)
    parser.add_argument("recordings", nargs="*", default=RECORDINGS)
    options = parser.parse_args()
    folder = data_folder()
    if folder is None:
        sys.exit("the recordings are absent; set REPLAY_DATA to their folder")
    print(f"{'recording':<18}{'robot':<7}{'should be':<11}{'is':<10}{'error or reason':<24}{'ω':>7}{'overlap':>10}"
          f"{'first':>9}{'wrong ticks':>13}")  # fmt: skip
    all_right = True
    for name in options.recordings:
        path = folder / "real" / name
        truths = read_truth(folder / "real" / f"{path.name.partition('.')[0]}.truth.json")
        report, rows = replayed(path, truths)
        for robot, truth in truths.items():
            status, row = report["robots"][robot], rows[robot]
            right, what = judged(status, truth)
            all_right = all_right and right
            print(
                f"{path.name:<18}{robot:<7}{'merged' if truth.reference_from_map else 'unmerged':<11}"
                f"{status['status']:<10}{what:<24}{status['acceptance'] or 0:>7.3f}{status['overlap_m2'] or 0:>7.0f} m²"
                f"{'–' if row.first_s is None else f'{row.first_s:.0f} s':>9}{row.wrong_ticks:>6} of {row.placed_ticks}"
                f"{'' if right else '   NOT AS IT SHOULD BE'}"
            )
    print("all as they should be" if all_right else "not all as they should be")
    return 0 if all_right else 1


if __name__ == "__main__":
    sys.exit(main())
