"""An evaluation, to read and as JSON."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

from mapmerge.likeness import Likeness
from mapmerge.sim2 import Sim2
from replay.columns import columns
from replay.evaluation.errors import Limits, PoseErrors, Verdict
from replay.plain_text import plain, plain_json

_DIGITS = 6
_SHARES = (
    ("walls_right", "walls of the merged map that have a true wall within {tolerance_m:g} m"),
    ("walls_found", "true walls, where the merged map knows, that it has within {tolerance_m:g} m"),
    ("cells_alike", "cells that both maps call occupied or free, and alike"),
    ("free_iou", "free area: intersection over union, where the true map knows"),
    ("free_covered", "truly free area that the merged map calls free"),
)


@dataclass(frozen=True, slots=True)
class MapEvaluation:
    """How alike the merged map and the true one are, and how that was measured."""

    likeness: Likeness
    merged_from_true: Sim2
    tolerance_m: float


def lines(errors: PoseErrors, of_map: MapEvaluation | None, limits: Limits | None) -> Iterator[str]:
    """Yield an evaluation as lines to read; what is beyond the limits comes last."""
    rows = [("robot", "verdict", "position", "turn", "reason")]
    for item in errors.robots:
        distance = "–" if item.error is None else f"{item.error.distance_m:.3f} m"
        turn = "–" if item.error is None else f"{item.error.angle_deg:.2f}°"
        rows.append((plain(item.robot), str(item.verdict), distance, turn, item.reason))
    yield from columns(rows, indent="")
    yield from (f"{plain(name)}: there is no truth of it" for name in errors.unknown)
    if errors.rmse_m is not None and errors.rmse_deg is not None:
        yield f"root mean square error: {errors.rmse_m:.3f} m, {errors.rmse_deg:.2f}°"
    yield ", ".join(f"{errors.count(verdict)} {verdict}" for verdict in Verdict if errors.count(verdict))
    if of_map is not None:
        yield from _map_lines(of_map)
    if limits is not None:
        yield from (f"beyond the limits: {plain(robot)}: {what}" for robot, what in errors.beyond(limits).items())


def _map_lines(of_map: MapEvaluation) -> Iterator[str]:
    pose, found = of_map.merged_from_true, of_map.likeness
    yield (
        f"merged map against the true one, whose frame lies at x {pose.x_m:.3f} m, y {pose.y_m:.3f} m, "
        f"yaw {pose.yaw_rad:.4f} rad:"
    )
    rows = []
    for name, what in _SHARES:
        value = getattr(found, name)
        rows.append(("–" if value is None else f"{100.0 * value:.1f}%", what.format(tolerance_m=of_map.tolerance_m)))
    if found.wall_error_m is not None and found.far_wall_error_m is not None:
        far = f"95% within {found.far_wall_error_m:.3f} m"
        rows.append((f"{found.wall_error_m:.3f} m", f"from a wall to the nearest true one: the median; {far}"))
    yield from columns(rows)


def json_text(errors: PoseErrors, of_map: MapEvaluation | None, limits: Limits | None) -> str:
    """Return an evaluation as JSON."""
    values: dict[str, Any] = {
        "robots": {
            item.robot: {
                "verdict": str(item.verdict),
                "distance_m": item.error.distance_m if item.error else None,
                "angle_deg": item.error.angle_deg if item.error else None,
                "reason": item.reason or None,
            }
            for item in errors.robots
        },
        "without_truth": list(errors.unknown),
        "rmse_m": errors.rmse_m,
        "rmse_deg": errors.rmse_deg,
        "counts": {str(verdict): errors.count(verdict) for verdict in Verdict},
        "beyond": None if limits is None else errors.beyond(limits),
        "map": None
        if of_map is None
        else {
            **asdict(of_map.likeness),
            "tolerance_m": of_map.tolerance_m,
            "merged_from_true_map": asdict(of_map.merged_from_true),
        },
    }
    return plain_json(json.dumps(_rounded(values), indent=2, ensure_ascii=False)) + "\n"


def _rounded(value: Any) -> Any:  # noqa: ANN401 - any JSON value
    if isinstance(value, dict):
        return {key: _rounded(item) for key, item in value.items()}
    return round(value, _DIGITS) + 0.0 if isinstance(value, float) else value
