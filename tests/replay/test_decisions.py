"""What is said of placements that hang on another match in the end."""

from __future__ import annotations

from typing import Any

import pytest

from replay.decisions import linked_otherwise


def report(via: str | None, *history: tuple[str, str, str | None], status: str = "merged") -> dict[str, Any]:
    return {
        "robots": {"r1": {"status": "reference", "placed_via": None}, "r3": {"status": status, "placed_via": via}},
        "history": [{"robot": robot, "event": event, "placed_via": placed_via} for robot, event, placed_via in history],
    }


PLACED = ("r3", "placed", "r1")


@pytest.mark.parametrize(
    ("told", "said"),
    [
        (report("r1", PLACED), None),
        (report("r2", PLACED), "r3 on r2"),
        (report("r2", PLACED, ("r3", "moved", "r2")), None),
        (report("r2", PLACED, ("r3", "jumped", "r2")), "r3 on r2"),
        (report(None, PLACED, ("r3", "withdrawn", None), status="unmerged"), None),
        (report("r2"), None),
    ],
)
def test_who_hangs_on_another_robot_in_the_end_is_said(told: dict[str, Any], said: str | None) -> None:
    words = linked_otherwise(told)
    assert words == (
        None
        if said is None
        else f"placed by other matches in the end than when that was decided, at the same places: {said}"
    )
