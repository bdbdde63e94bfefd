"""What a person at the terminal sees while a run goes on: a progress bar, and a line for what is worth one."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from enum import IntEnum
from time import perf_counter
from typing import IO, TYPE_CHECKING

from mapmerge.reasons import ReasonCode
from replay.advice import ADVICE
from replay.colours import are_on
from replay.decisions import decisions
from replay.events import Event, Merged, Noted, Report, Skipped, Started
from replay.figures import share
from replay.options import NS_PER_S
from replay.plain_text import listed, plain
from replay.skip_cause import SkipCause
from replay.sources.losses import part_of
from replay.standard_streams import quiet_stderr
from replay.words import counted, intention, lost, moment, recovered, unused

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress, TaskID

_WIDTH_WHERE_NO_TERMINAL = 400
_SKIPPED_NAMED = 5
_LONGEST_RUN_S = 1e6
"""Messages farther from the first map than this have a time that is not to be believed."""


class Talk(IntEnum):
    """How much is said."""

    QUIET = 0
    """Nothing."""
    USUAL = 1
    """What is worth a line."""
    VERBOSE = 2
    """What was done at each time, as well."""


class ProgressSink:
    """Shows how far the run is; on a terminal only, and not between the lines of one that tells all."""

    def __init__(self, console: Console, talk: Talk = Talk.USUAL) -> None:
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

        self._progress: Progress = Progress(
            TextColumn("merging"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("maps"),
            TimeRemainingColumn(),
            console=console,
            transient=True,
            disable=not console.is_terminal or talk is not Talk.USUAL,
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
    talk
        How much is said.
    """

    def __init__(self, console: Console, *, announce: bool, talk: Talk = Talk.USUAL) -> None:
        self.unused_topics: Sequence[str] = ()
        """Map topics that are no robot's."""
        self.is_published = False
        """Whether all files of the run have their final names."""
        self._console = console
        self._announce = announce
        self._talk = talk
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
            self._first_ns = event.stamp_ns if self._first_ns is None else self._first_ns
            if self._talk is Talk.VERBOSE:
                for line in told(event, self._after(event.stamp_ns)):
                    self.say(line)
            self._say_decided(event)
            self._merge_s += event.timing.merge_s
            self._render_s += event.timing.render_s
            self._ticks += 1

    def _say_decided(self, event: Merged) -> None:
        """Say what jumped, or was placed, moved or withdrawn, and when."""
        for _, words in decisions(event.result):
            self.say(f"{self._after(event.stamp_ns)}: {words}")

    def _after(self, time_ns: int) -> str:
        """Return how long after the first map a time is."""
        first_ns = time_ns if self._first_ns is None else self._first_ns
        return f"+{(time_ns - first_ns) / NS_PER_S:.1f} s"

    def _say_skipped(self, event: Skipped) -> None:
        """Name the first few of each cause; `sum_up` counts them all."""
        self._skipped[event.cause] += 1
        if self._skipped[event.cause] <= _SKIPPED_NAMED:
            what = "skipped a message" if event.messages == 1 else lost(event.messages)
            self.say(f"{what} ({event.input}, {self._where(event)}): {event.cause}: {event.detail}")

    def _where(self, event: Skipped) -> str:
        """Return where something was: a place, or a topic, the time, and how long after the first map that is."""
        if event.place:
            return event.place
        after_s = 0.0 if self._first_ns is None else (event.log_time_ns - self._first_ns) / NS_PER_S
        since = f", {self._after(event.log_time_ns)}" if 0.0 < after_s < _LONGEST_RUN_S else ""
        return f"{event.topic} at {moment(event.log_time_ns)}{since}"

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
        placed = sum(row["merged_from_map"] is not None for row in report["robots"].values())
        self.say(
            f"{placed} of {counted(len(report['robots']), 'map')} {'is' if placed == 1 else 'are'} in the merged map"
        )
        if len(report["robots"]) == 1:
            self.say("there is one robot's map alone: nothing was merged with it; `replay info` lists all topics")
        for line in what_to_do(report):
            self.say(line)
        spent_s = perf_counter() - self._begin_s
        self.say(
            f"{counted(report['updates'], 'map')} at {counted(self._ticks, 'time')} in {spent_s:.1f} s: "
            f"{self._merge_s:.1f} s merging, {self._render_s:.1f} s drawing; wrote {', '.join(paths) or 'nothing'}"
        )

    def say(self, text: str) -> None:
        """Say a line, unless nothing is to be said."""
        if self._talk is Talk.QUIET:
            return
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


def what_to_do(report: Report) -> Iterator[str]:
    """Yield what may be done about maps that are not merged, once for each reason."""
    by_reason: dict[ReasonCode, list[str]] = {}
    for robot, row in report["robots"].items():
        by_reason.setdefault(ReasonCode(row["reason"]["code"]), []).append(robot)
    for code, robots in by_reason.items():
        if ADVICE[code] and any(report["robots"][robot]["merged_from_map"] is None for robot in robots):
            yield f"{listed(robots)} ({code}): {ADVICE[code]}"


def told(event: Merged, after: str) -> Iterator[str]:
    """Yield what was done at one time: which maps came, which pairs were searched and why, and what that took."""
    result, spent_s = event.result, event.timing.merge_s + event.timing.render_s
    came = f"new maps of {listed(result.updated)}" if result.updated else "nothing new"
    yield f"{after}: {came}; {event.done} of {counted(event.total, 'message')} read; {spent_s:.2f} s"
    for pair, trigger in result.searched.items():
        match = result.pairs[pair]
        sure = "" if match.confidence is None else f" (confidence {share(match.confidence, 4)})"
        verdict = "accepted" if match.accepted else "refused"
        yield f"  {pair[1]} on {pair[0]} searched, as {trigger.words}: {verdict}{sure}: {match.reason.message}"
    for remark in event.remarks:
        yield f"  {remark}"


def open_notes(colour: str = "auto") -> Console:
    """Return a console on standard error, which falls silent where that cannot be written."""
    return open_console(quiet_stderr(), colour)


def open_console(stream: IO[str], colour: str = "auto") -> Console:
    """Return a console; where there is no terminal, lines are not broken at its width."""
    from rich.console import Console

    on = are_on(stream, colour)
    return Console(
        file=stream,
        width=None if stream.isatty() else _WIDTH_WHERE_NO_TERMINAL,
        highlight=False,
        soft_wrap=False,
        # the library would take what forces colours for a terminal, and show its progress there
        force_terminal=stream.isatty(),
        no_color=not on,
        color_system=("auto" if stream.isatty() else "standard") if on else None,
    )
