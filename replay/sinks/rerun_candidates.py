"""The placements that a robot's match found, as a page of the Rerun recording."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mapmerge.outcome import Pair
from mapmerge.watch import Trigger
from replay.events import Report
from replay.figures import NO_FIGURE, area, degrees, fixed, percent, share
from replay.markdown import inline, table

_COLUMNS = ("", "x, m", "y, m", "yaw, °", "score, m", "as likely as the best")
_MOST = 12


def candidates(report: Report, pair: Pair) -> str:
    """Return in Markdown what the match of a pair came to: the best placement, and its rivals.

    Parameters
    ----------
    report
        As of now.
    pair
        Its robots, target first.
    """
    match = next(item for item in report["pairs"] if (item["a"], item["b"]) == pair)
    target, source = (inline(name) for name in pair)
    verdict = "accepted" if match["accepted"] else "**refused**"
    # either robot's page may show this pair, and its reason names the other one
    parts = [f"# {target} and {source}: {verdict}", inline(match["reason"]["message"])]
    parts.append(_figures(match["scores"], match["confidence"]))
    if match["a_from_b"] is None:
        return "\n\n".join([*parts, "No placement was found at all."]) + "\n"
    rows = [_row("best", match["a_from_b"], (match["scores"] or {}).get("score_m"), None)]
    rivals = match["rivals"]
    for index, rival in enumerate(rivals[:_MOST]):
        rows.append(_row(f"rival {index + 1}", rival["a_from_b"], rival["score_m"], rival["likelihood"]))
    parts.append(table(_COLUMNS, rows))
    if len(rivals) > _MOST:
        parts.append(f"and {len(rivals) - _MOST} more")
    where = f"Where the map frame of {source} lies in that of {target}"
    parts.append(f"{where}; a rival is another placement that was compared with the best one.")
    if match["searched"] is not None:
        parts.append(f"It was searched last as {Trigger(match['searched']['trigger']).words}.")
    return "\n\n".join(part for part in parts if part) + "\n"


def _figures(scores: Mapping[str, Any] | None, confidence: float | None) -> str:
    if scores is None:
        return ""
    said = [f"acceptance index **{share(scores['acceptance'])}**", f"overlap **{area(scores['overlap_m2'])}**"]
    if confidence is not None:
        said.insert(0, f"confidence **{percent(confidence)}**")
    return ", ".join(said)


def _row(name: str, pose: Mapping[str, float], score_m: float | None, likelihood: float | None) -> tuple[str, ...]:
    if name == "best":
        times = "1"
    elif likelihood is None:
        times = NO_FIGURE
    else:
        times = f"{likelihood:.3f}" if likelihood >= 0.001 else "< 0.001"
    score = NO_FIGURE if score_m is None else fixed(score_m, 1)
    return name, fixed(pose["x_m"], 2), fixed(pose["y_m"], 2), degrees(pose["yaw_rad"]), score, times
