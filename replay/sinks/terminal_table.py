"""The table at the end: what became of each robot's map."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from itertools import zip_longest
from typing import TYPE_CHECKING

from replay.console import open_console
from replay.events import Report
from replay.figures import area, degrees, fixed, percent, share
from replay.plain_text import plain

if TYPE_CHECKING:
    from rich.table import Table

_STYLES = {"reference": "bold", "merged": "green", "unmerged": "yellow", "no_map": "red"}
_LEAST_REASON_COLUMNS = 40
"""Where reasons would have a narrower column they stand below the table."""

_LONGEST_NAME = 12


def table_text(report: Report, colour: str = "auto") -> str:
    """Return a row for each robot: status, pose (its scale if that is free), agreement, confidence, reason.

    It is made for standard output, and not printed: of an error there, the library would end the program.
    """
    console = open_console(sys.stdout, colour)
    reasons = [plain(row["reason"]["message"]) for row in report["robots"].values()]
    width = console.measure(_table(report, [])).maximum
    beside = console.width - width >= _LEAST_REASON_COLUMNS
    with console.capture() as captured:
        console.print(_table(report, reasons if beside else []))
        if not beside:
            below = [f"{plain(robot)}: {reason}" for robot, reason in zip(report["robots"], reasons, strict=True)]
            console.print("", *below, sep="\n", markup=False)
    return "".join(f"{line.rstrip()}\n" for line in captured.get().splitlines())


def _table(report: Report, reasons: Sequence[str]) -> Table:
    """Return the table, with reasons if there are any."""
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, pad_edge=False, header_style="bold", collapse_padding=not reasons)
    # where figures have little room, they go before the end of a name, which stands with its reason as well
    table.add_column("robot", no_wrap=True, max_width=None if reasons else _LONGEST_NAME)
    table.add_column("status", no_wrap=True)
    scaled = report["settings"]["merge"]["scale"] == "free"
    pose = ("x / m", "y / m", "yaw / °", *(["scale"] if scaled else []))
    for name in (*pose, "acceptance", "overlap", "confidence"):
        table.add_column(name, justify="right", no_wrap=True)
    if reasons:
        table.add_column("reason", overflow="fold")
    for (robot, row), reason in zip_longest(report["robots"].items(), reasons):
        status = str(row["status"])
        table.add_row(
            Text(plain(robot)),
            Text(status, style=_STYLES[status]),
            *_pose(row["merged_from_map"])[: len(pose)],
            share(row["acceptance"], 3),
            area(row["overlap_m2"]),
            percent(row["confidence"]),
            *([Text(reason)] if reasons else []),
        )
    return table


def _pose(pose: dict[str, float] | None) -> tuple[str, ...]:
    if pose is None:
        return ("–",) * 4
    return fixed(pose["x_m"], 2), fixed(pose["y_m"], 2), degrees(pose["yaw_rad"]), fixed(pose["scale"], 3)
