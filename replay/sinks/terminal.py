"""What a person at the terminal sees: a progress bar on long work, and a table at the end."""

from __future__ import annotations

import math
import sys
from collections import Counter
from collections.abc import Sequence
from time import perf_counter
from typing import IO, TYPE_CHECKING

from replay.decisions import decisions
from replay.events import Event, Merged, Noted, Report, Skipped, Started
from replay.figures import area, share
from replay.options import NS_PER_S
from replay.plain_text import plain
from replay.skip_cause import SkipCause
from replay.sources.losses import part_of
from replay.standard_streams import quiet_stderr
from replay.words import counted, intention, lost, recovered, unused

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress, TaskID

_WIDTH_WHERE_NO_TERMINAL = 400
_SKIPPED_NAMED = 5
_STYLES = {"reference": "bold", "merged": "green", "unmerged": "yellow", "no_map": "red"}


class ProgressSink:
    """Shows how far the run is; on a terminal only."""

    def __init__(self, console: Console) -> None:
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

        self._progress: Progress = Progress(
            TextColumn("merging"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("maps"),
            TimeRemainingColumn(),
            console=console,
            transient=True,
            disable=not console.is_terminal,
        )
        self._task: TaskID | None = None

    def take(self, event: Event) -> None:
        """Move the bar."""
        if isinstance(event, Started):
            self._progress.start()
            total = sum(item.message_count for item in event.robots)
            self._task = self._progress.add_task("merging", total=total)
        elif isinstance(event, Merged) and self._task is not None:
            self._progress.update(self._task, completed=event.done)

    def finish(self) -> None:
        """Take the bar away."""
        self._progress.stop()

    def publish(self) -> None:
        """Do nothing: there is no file."""

    def discard(self) -> None:
        """Take the bar away."""
        self._progress.stop()


class Narrator:
    """Says which robots are merged, what was skipped, and at the end where the time went.

    Parameters
    ----------
    announce
        Whether to say which robots were chosen.
    """

    def __init__(self, console: Console, *, announce: bool) -> None:
        self.unused_topics: Sequence[str] = ()
        """Map topics that are no robot's."""
        self.is_published = False
        """Whether all files of the run have their final names."""
        self._console = console
        self._announce = announce
        self._begin_s = perf_counter()
        self._merge_s = 0.0
        self._render_s = 0.0
        self._ticks = 0
        self._first_ns: int | None = None
        self._skipped: Counter[str] = Counter()

    def take(self, event: Event) -> None:
        """Say what is worth a line, and add up the time."""
        if isinstance(event, Started) and self._announce:
            self.say(intention([f"{item.robot} ({item.topic})" for item in event.robots], "merging {} into {}"))
            if self.unused_topics:
                self.say(unused(self.unused_topics))
        elif isinstance(event, Skipped):
            self._say_skipped(event)
        elif isinstance(event, Noted):
            self.say(f"{event.robot}: {event.message}" if event.robot else event.message)
        elif isinstance(event, Merged):
            self._say_decided(event)
            self._merge_s += event.timing.merge_s
            self._render_s += event.timing.render_s
            self._ticks += 1

    def _say_decided(self, event: Merged) -> None:
        """Say what jumped, or was placed, moved or withdrawn, and when."""
        self._first_ns = event.stamp_ns if self._first_ns is None else self._first_ns
        after_s = (event.stamp_ns - self._first_ns) / NS_PER_S
        for _, words in decisions(event.result):
            self.say(f"+{after_s:.1f} s: {words}")

    def _say_skipped(self, event: Skipped) -> None:
        """Name the first few of each cause; `sum_up` counts them all."""
        self._skipped[event.cause] += 1
        if self._skipped[event.cause] <= _SKIPPED_NAMED:
            what = "skipped a message" if event.messages == 1 else lost(event.messages)
            self.say(f"{what} ({event.input}, {event.where}): {event.cause}: {event.detail}")

    def sum_up(self, report: Report, paths: Sequence[str]) -> None:
        """Say what was skipped, how long it took, and what was written."""
        for item in report["inputs"]:
            early = [each for each in report["skipped_at"] if _ends_early(each) and each["input"] == item["name"]]
            if early:
                parts = list(dict.fromkeys(part for each in early if (part := part_of(each["place"]))))
                self.say(recovered(item["name"], item["messages"], item["until_ns"], parts))
        for cause, number in self._skipped.items():
            if number > _SKIPPED_NAMED:
                self.say(f"and {number - _SKIPPED_NAMED} more of {cause}: the report lists them under skipped_at")
        skipped, late = sum(report["skipped"].values()), sum(item["late"] for item in report["inputs"])
        if skipped:
            least = {each["cause"] for each in report["skipped_at"] if each["messages"] is None}
            causes = ", ".join(f"{_least(cause in least)}{count} {cause}" for cause, count in report["skipped"].items())
            self.say(f"{_least(bool(least))}{counted(skipped, 'message')} skipped: {causes}")
        bad_stamps = sum(item["bad_stamps"] for item in report["inputs"])
        if bad_stamps:
            self.say(
                f"{counted(bad_stamps, 'message')} with a time far from those around: taken at the time at which "
                f"{'it was' if bad_stamps == 1 else 'they were'} recorded"
            )
        if late:
            self.say(f"{counted(late, 'message')} too late to be put in order of time: taken in on arrival")
        spent_s = perf_counter() - self._begin_s
        self.say(
            f"{counted(report['updates'], 'map')} at {counted(self._ticks, 'time')} in {spent_s:.1f} s: "
            f"{self._merge_s:.1f} s merging, {self._render_s:.1f} s drawing; wrote {', '.join(paths) or 'nothing'}"
        )

    def say(self, text: str) -> None:
        """Say a line."""
        self._console.print(plain(text), markup=False, soft_wrap=True)

    def finish(self) -> None:
        """Do nothing."""

    def publish(self) -> None:
        """Take note that all files have been published."""
        self.is_published = True

    def discard(self) -> None:
        """Do nothing."""


def _least(is_least: bool) -> str:
    return "at least " if is_least else ""


def _ends_early(skipped: Report) -> bool:
    return bool(skipped["cause"] == SkipCause.ENDS_EARLY)


def open_notes() -> Console:
    """Return a console on standard error, which falls silent where that cannot be written."""
    return _console(quiet_stderr())


def _console(stream: IO[str]) -> Console:
    """Return a console; where there is no terminal, lines are not broken at its width."""
    from rich.console import Console

    width = None if stream.isatty() else _WIDTH_WHERE_NO_TERMINAL
    return Console(file=stream, width=width, highlight=False, soft_wrap=False)


def table_text(report: Report) -> str:
    """Return a row for each robot: status, pose (its scale if that is free), agreement, confidence if known, reason.

    It is made for standard output, and not printed: of an error there, the library would end the program.
    """
    from rich.table import Table
    from rich.text import Text

    table = Table(box=None, pad_edge=False, header_style="bold")
    for name in ("robot", "status"):
        table.add_column(name, no_wrap=True)
    known = any(row["confidence"] is not None for row in report["robots"].values())
    scaled = report["settings"]["merge"]["scale"] == "free"
    pose = ("x / m", "y / m", "yaw / °", *(["scale"] if scaled else []))
    for name in (*pose, "acceptance", "overlap", *(["confidence"] if known else [])):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("reason", overflow="fold")
    for robot, row in report["robots"].items():
        status = str(row["status"])
        table.add_row(
            Text(plain(robot)),
            Text(status, style=_STYLES[status]),
            *_pose(row["merged_from_map"])[: len(pose)],
            share(row["acceptance"]),
            area(row["overlap_m2"]),
            *([share(row["confidence"], 4)] if known else []),
            Text(plain(row["reason"]["message"])),
        )
    console = _console(sys.stdout)
    with console.capture() as captured:
        console.print(table)
    return captured.get()


def _pose(pose: dict[str, float] | None) -> tuple[str, ...]:
    if pose is None:
        return ("–",) * 4
    turn_deg = math.degrees(pose["yaw_rad"])
    return f"{pose['x_m']:.2f}", f"{pose['y_m']:.2f}", f"{turn_deg:.1f}", f"{pose['scale']:.3f}"
