"""The course of a run: what each robot's map was at each time, what was decided, and the log of it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby

from mapmerge.outcome import ChangeKind
from replay.decisions import linked_otherwise
from replay.figures import seconds
from replay.html.axes import Axis
from replay.html.plots import Mark, time_axis, time_marks
from replay.html.roster import Member
from replay.html.story import Decision, Story
from replay.options import NS_PER_S
from replay.words import STATUS_WORDS

MOST_MARKS = 60
"""So many marks have room on a lane; of a robot of which more was decided, those of one time are one mark."""
MOST_ENTRIES = 400

_MOST_COUNTED = 99

SIGNS = {ChangeKind.PLACED: "▲", ChangeKind.MOVED: "◆", ChangeKind.WITHDRAWN: "▼", ChangeKind.JUMPED: "✱"}


@dataclass(frozen=True, slots=True)
class Phase:
    """For how long a robot's map was what: from and to in percent."""

    status: str
    words: str
    at: float
    width: float


@dataclass(frozen=True, slots=True)
class Event:
    """A decision in the course of a run, or several that stand where one has room."""

    sign: str
    kind: str
    words: str
    at: float
    count: int = 1


@dataclass(frozen=True, slots=True)
class Lane:
    """One robot's course."""

    member: Member
    phases: tuple[Phase, ...]
    events: tuple[Event, ...]

    @property
    def summary(self) -> str:
        """What it shows, in words."""
        return "; ".join(phase.words for phase in self.phases)


@dataclass(frozen=True, slots=True)
class Entry:
    """A line of the log."""

    time: str
    sign: str
    kind: str
    words: str


@dataclass(frozen=True, slots=True)
class Course:
    """The course of a run.

    Parameters
    ----------
    first, last, left_out
        The log; so many decisions in the middle are not listed.
    otherwise
        What it does not say.
    unmarked
        So many decisions in the middle are on no lane.
    """

    lanes: tuple[Lane, ...]
    times: tuple[Mark, ...]
    first: tuple[Entry, ...]
    last: tuple[Entry, ...]
    left_out: int
    otherwise: str | None
    unmarked: int

    @property
    def has_groups(self) -> bool:
        """Whether any mark stands for several decisions."""
        return any(event.count > 1 for lane in self.lanes for event in lane.events)


def course(story: Story) -> Course | None:
    """Return the course; None if there was no tick."""
    if not story.series.ticks:
        return None
    over = time_axis(story)
    lanes = tuple(
        Lane(member, tuple(_phases(story, member, over)), tuple(_events(story, member, over)))
        for member in story.roster.values()
    )
    entries = [_entry(story, decision) for decision in story.decisions]
    first, last = (entries, []) if len(entries) <= MOST_ENTRIES else _ends(entries)
    left_out = story.decisions_left_out + len(entries) - len(first) - len(last)
    otherwise, unmarked = linked_otherwise(story.report), story.decisions_left_out
    return Course(lanes, time_marks(over), tuple(first), tuple(last), left_out, otherwise, unmarked)


def _ends(entries: Sequence[Entry]) -> tuple[list[Entry], list[Entry]]:
    half = MOST_ENTRIES // 2
    return list(entries[:half]), list(entries[-half:])


def _phases(story: Story, member: Member, over: Axis) -> Iterator[Phase]:
    stamps_ns = story.series.stamps_ns
    statuses = [sample.status for sample in story.series.of(member.index)]
    begins = [next(group)[0] for _, group in groupby(enumerate(statuses), key=lambda item: item[1])]
    for begin, after in zip(begins, [*begins[1:], None], strict=True):
        since_ns = stamps_ns[begin] - story.first_ns
        until_ns = (stamps_ns[-1] if after is None else stamps_ns[after]) - story.first_ns
        at, end = (over.share(each_ns / NS_PER_S) * 100.0 for each_ns in (since_ns, until_ns))
        if story.first_ns == story.last_ns:
            end = 100.0
        words = STATUS_WORDS[statuses[begin]]
        said = f"{words} from {seconds(since_ns)} to {seconds(until_ns)}"
        yield Phase(statuses[begin], said, round(at, 2), round(max(0.4, end - at), 2))


def _events(story: Story, member: Member, over: Axis) -> Iterator[Event]:
    """Yield a robot's marks; of very many decisions, one for those of each part of the time that has room for one."""
    own = [decision for decision in story.decisions if decision.robot == member.robot]
    places = [over.share((decision.stamp_ns - story.first_ns) / NS_PER_S) for decision in own]
    if len(own) <= MOST_MARKS:
        groups = [[item] for item in zip(places, own, strict=True)]
    else:
        parts = groupby(zip(places, own, strict=True), key=lambda item: min(MOST_MARKS - 1, int(item[0] * MOST_MARKS)))
        groups = [list(group) for _, group in parts]
    for group in groups:
        at = sum(place for place, _ in group) / len(group)
        yield _mark(story, [decision for _, decision in group], round(at * 100.0, 2))


def _mark(story: Story, decided: Sequence[Decision], at: float) -> Event:
    begin, end = (seconds(decision.stamp_ns - story.first_ns) for decision in (decided[0], decided[-1]))
    kind = decided[0].kind
    if len(decided) == 1:
        return Event(SIGNS[ChangeKind(kind)], kind, f"{kind} at {begin}", at)
    counts = Counter(decision.kind for decision in decided)
    words = ", ".join(f"{count} times {each}" if count > 1 else each for each, count in counts.items())
    sign = str(len(decided)) if len(decided) <= _MOST_COUNTED else "⋯"
    when = f"at {begin}" if begin == end else f"from {begin} to {end}"
    return Event(sign, kind if len(counts) == 1 else "several", f"{words} {when}", at, len(decided))


def _entry(story: Story, decision: Decision) -> Entry:
    time = seconds(decision.stamp_ns - story.first_ns)
    sign = SIGNS[ChangeKind(decision.kind)]
    return Entry(time, sign, decision.kind, decision.words)
