"""Which clock each robot's times come from, and how the clocks of several recordings are brought together."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from itertools import islice

from replay.codec import decode
from replay.errors import BadMessage, UsageError
from replay.events import Clock
from replay.messages import GridMessage, TransformMessage, UpdateMessage
from replay.options import NS_PER_S, ClockChoice
from replay.sources.base import RawMessage, Source
from replay.stamps import PROBED, Stamp, is_plain, lead_at_start_ns

_MAX_GAP_NS = 86_400 * NS_PER_S


@dataclass(frozen=True, slots=True)
class Probe:
    """What the first usable message of a topic in one input says.

    Parameters
    ----------
    clock
        What the topic's times are taken from.
    first_ns, last_ns
        About when its messages begin and end, by that clock; None for saved maps, which have no clock.
    first_log_ns, last_log_ns
        The same by the recorder's clock.
    frame_id
        Its map frame as recorded.
    lead_ns
        How far its headers' times are ahead of the recorder's clock then; None if they are not used.
    """

    robot: str
    input: int
    topic: str
    clock: Clock
    first_ns: int | None
    last_ns: int | None
    first_log_ns: int
    last_log_ns: int
    frame_id: str
    lead_ns: int | None = None

    def by_log(self) -> Probe:
        """Return the same by the recorder's clock; saved maps stay without one."""
        if self.clock != "header":
            return self
        return replace(self, clock="log", first_ns=self.first_log_ns, last_ns=self.last_log_ns, lead_ns=None)


def probe(source: Source, index: int, robot: str, topic: str, choice: ClockChoice) -> Probe | None:
    """Read the first usable message of a topic; None if there is none.

    Of the headers' times that follow, a few are looked at where the first one is far from the recorder's clock: it may
    be the only one that is, or all are.
    """
    info = source.info
    usable = _usable(source, topic)
    raw, message = next(usable, (None, None))
    if raw is None or message is None:
        return None
    log_ns, frame = raw.log_time_ns, message.frame_id
    if info.start_ns is None or info.stop_ns is None:
        return Probe(robot, index, topic, "none", None, None, log_ns, log_ns, frame)
    last_log_ns = max(log_ns, info.stop_ns)
    if choice == "log" or message.stamp_ns <= 0:
        return Probe(robot, index, topic, "log", log_ns, last_log_ns, log_ns, last_log_ns, frame)
    first = Stamp(message.stamp_ns, log_ns)
    lead_ns = first.lead_ns if is_plain(first) else lead_at_start_ns([first, *_next_stamps(usable)])
    supposed = Stamp(log_ns + lead_ns, log_ns)
    first_ns = first.own_ns if first.may_follow(supposed) else max(0, supposed.own_ns)
    last_ns = first_ns + last_log_ns - log_ns
    return Probe(robot, index, topic, "header", first_ns, last_ns, log_ns, last_log_ns, frame, lead_ns)


def _usable(source: Source, topic: str) -> Iterator[tuple[RawMessage, GridMessage | UpdateMessage]]:
    for raw in source.messages([topic]):
        try:
            yield raw, decode(raw)
        except BadMessage:
            continue


def _next_stamps(usable: Iterator[tuple[RawMessage, GridMessage | UpdateMessage]]) -> list[Stamp]:
    """Return the times of the next few messages that have one."""
    stamps = (Stamp(message.stamp_ns, raw.log_time_ns) for raw, message in usable if message.stamp_ns > 0)
    return list(islice(stamps, PROBED - 1))


def stamp_ns(clock: Clock, raw: RawMessage, message: GridMessage | UpdateMessage | TransformMessage) -> int:
    """Return the time of a message by this clock."""
    return message.stamp_ns if clock == "header" else raw.log_time_ns


def agreed(probes: Sequence[Probe]) -> list[Probe]:
    """Return the probes with one clock for each topic of a robot: the header's only where all of its inputs have it."""
    by_log = {(item.robot, item.topic) for item in probes if item.clock == "log"}
    return [item.by_log() if (item.robot, item.topic) in by_log else item for item in probes]


def refuse_recorded_twice(probes: Sequence[Probe], names: Sequence[str], tolerance_ns: int) -> None:
    """Refuse a robot that is in several recordings at the same time: parts of one mission follow each other.

    Parameters
    ----------
    names
        Of the inputs.
    tolerance_ns
        Parts may overlap by this much.
    """
    for index, item in enumerate(probes):
        for other in probes[:index]:
            if (item.robot, item.topic) != (other.robot, other.topic) or item.input == other.input:
                continue
            if item.first_ns is None or item.last_ns is None or other.first_ns is None or other.last_ns is None:
                continue
            if min(item.last_ns, other.last_ns) - max(item.first_ns, other.first_ns) > tolerance_ns:
                first, second = names[other.input], names[item.input]
                raise UsageError(
                    f"robot {item.robot!r} is in {first} and in {second} at the same times; if these are two robots, "
                    f"name them, as a={first} b={second}, else give one of the two"
                )


def frames(robots: Sequence[str], frame_ids: Mapping[str, str], merged_frame: str) -> dict[str, str]:
    """Return each robot's map frame for the outputs.

    It is the recorded one, its leading slash stripped, where that is unique in the run; else the robot's name and
    the frame, as ``r1/map``. Of a name that is no text, as of a file, what no message can hold is escaped.
    """
    bare = {robot: frame_ids.get(robot, "").lstrip("/") for robot in robots}
    named = {robot: robot.encode(errors="backslashreplace").decode() for robot in robots}
    prefixed = {robot: f"{named[robot]}/{frame or 'map'}" for robot, frame in bare.items()}
    taken = Counter([*bare.values(), *prefixed.values(), merged_frame])
    return {robot: frame if frame and taken[frame] == 1 else prefixed[robot] for robot, frame in bare.items()}


def offsets_ns(reference: str, probes: Sequence[Probe], *, align_starts: bool) -> dict[tuple[int, str], int]:
    """Return what is added to the times of each input and topic, to have them on the reference's clock.

    Raises
    ------
    UsageError
        If a robot's times are more than a day away from the reference's, and starts are not to be aligned.
    """
    timed = [item for item in probes if item.first_ns is not None]
    own = [item for item in timed if item.robot == reference]
    anchor = own[0] if own else (timed[0] if timed else None)
    if anchor is None:
        return {}
    if not align_starts:
        for item in timed:
            _refuse_other_clock(anchor, item)
        return {(item.input, item.topic): 0 for item in timed}
    groups = _sharing_a_clock(timed)
    start_ns = next(_first_ns(group) for group in groups if anchor in group)
    return {(item.input, item.topic): start_ns - _first_ns(group) for group in groups for item in group}


def _sharing_a_clock(probes: Sequence[Probe]) -> list[list[Probe]]:
    """Group what one clock timed: all of one input, and all parts of one robot's recording."""
    groups: list[list[Probe]] = []
    for item in probes:
        joined = [item]
        others = []
        for group in groups:
            same = any(
                item.clock == other.clock and (item.input == other.input or item.robot == other.robot)
                for other in group
            )
            if same:
                joined = [*group, *joined]
            else:
                others.append(group)
        groups = [*others, joined]
    return groups


def _first_ns(group: Sequence[Probe]) -> int:
    return min(item.first_ns for item in group if item.first_ns is not None)


def _refuse_other_clock(anchor: Probe, item: Probe) -> None:
    if anchor.first_ns is None or anchor.last_ns is None or item.first_ns is None or item.last_ns is None:
        return
    gap_ns = max(anchor.first_ns - item.last_ns, item.first_ns - anchor.last_ns)
    if gap_ns > _MAX_GAP_NS:
        raise UsageError(
            f"the clocks of {anchor.robot} ({_date(anchor.first_ns)}) and {item.robot} ({_date(item.first_ns)}) are "
            f"{gap_ns / _MAX_GAP_NS:.0f} days apart and cannot be the same; give --align-starts to let both begin "
            "at the same time"
        )


def _date(time_ns: int) -> str:
    try:
        moment = datetime.fromtimestamp(time_ns // NS_PER_S, tz=UTC)
    except (OverflowError, ValueError, OSError):
        return f"{time_ns} ns"
    return moment.strftime("%Y-%m-%d %H:%M:%S")
