"""Where robots truly are, and how far off a report may be."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mapmerge.sim2 import Sim2
from tests.runs import is_right


def read_truth(path: Path) -> dict[str, dict[str, Any]]:
    """Return what a truth file says of each robot but the reference."""
    return json.loads(path.read_text(encoding="utf-8"))["robots"]


def check(robots: Mapping[str, Any], truth: Mapping[str, Any]) -> None:
    """Check that each robot of a report is where the truth says, within 0.20 m amid the overlap and 1°."""
    reference, *others = robots
    assert robots[reference]["status"] == "reference"
    assert set(others) == set(truth)
    for robot, known in truth.items():
        found = robots[robot]
        if known["same_place"]:
            assert found["status"] == "merged", found["reason"]
            true = Sim2(known["x_m"], known["y_m"], known["yaw_rad"])
            assert is_right(found["merged_from_map"], true, tuple(known["overlap_centre_m"])), robot
            assert found["acceptance"] > 0.95
        else:
            assert (found["status"], found["merged_from_map"]) == ("unmerged", None)
            assert found["reason"]["code"] not in {"no_map", "no_reference_map", "reference", "accepted"}
            assert found["reason"]["message"]
