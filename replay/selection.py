"""Which topic of which input is which robot's map."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches

from replay.errors import InputError, UsageError
from replay.plain_text import brief, listed
from replay.robot_names import file_names, is_costmap_or_mask, names_in, namespace
from replay.runs import RunPath, TopicChoice
from replay.sources.base import GRID_TYPE, UPDATE_TYPE, SourceInfo
from replay.sources.losses import Loss, summed_up
from replay.topics import MAP_TOPIC, REPORT_TOPIC

MOST_UNNAMED = 100
"""Every pair of robots is matched: of more robots than this, somebody must have meant it."""


@dataclass(frozen=True, slots=True)
class Selected:
    """One robot's map topic, and the inputs (as indices) that hold it."""

    robot: str
    topic: str
    inputs: tuple[int, ...]

    @property
    def topics(self) -> tuple[str, str]:
        """The map's topic and that of the updates of parts of it."""
        return self.topic, f"{self.topic}_updates"


def select(
    runs: Sequence[RunPath],
    infos: Sequence[SourceInfo],
    *,
    robots: Sequence[str] | None = None,
    topics: Sequence[TopicChoice] = (),
    losses: Sequence[Iterable[Loss]] = (),
) -> tuple[Selected, ...]:
    """Find each robot's map topic; the first robot is the reference.

    Parameters
    ----------
    runs, infos
        The inputs, and what each holds.
    robots
        Names asked for, the reference first; None for all that are found.
    topics
        Topics said outright.
    losses
        What is lost of each input, which may be why there is no map.

    Raises
    ------
    InputError
        If there is no map at all.
    UsageError
        If a robot is not there or its topic is ambiguous; the text lists what is there, as flags to paste.
    """
    counts = Counter[str]()
    for info in infos:
        counts.update({topic.name: topic.message_count for topic in info.topics if topic.msgtype == GRID_TYPE})
    if not counts.total():
        raise InputError(_nothing(runs, infos, losses))
    found = _discovered(runs, infos, topics, counts)
    there = _flags(found or _discovered(runs, infos, (), counts))
    wanted = list(robots) if robots is not None else _all_names(runs, found)
    unused = sorted({choice.robot for choice in topics if choice.robot is not None} - set(wanted))
    if unused:
        raise UsageError(f"--topic names {', '.join(unused)}, which --robots does not; add it there, or leave it out")
    if not wanted:
        said = " ".join(f"--topic {choice.topic}" for choice in topics)
        raise UsageError(f"{said}: there is no map that fits; there are: {there}")
    if robots is None and len(wanted) > MOST_UNNAMED:
        raise UsageError(
            f"there are maps of {len(wanted)} robots; more than {MOST_UNNAMED} are merged only if they are named, as "
            f"--robots {','.join(wanted[:2])}; there are: {there}"
        )
    selected = []
    for robot in wanted:
        candidates = found.get(robot) or _by_component(robot, runs, infos, topics, counts)
        selected.append(_one(robot, candidates, there, found))
    _refuse_shared(selected)
    _refuse_unused(selected, topics)
    return tuple(selected)


Candidates = dict[str, tuple[int, ...]]


def _grid_topics(info: SourceInfo) -> list[str]:
    return sorted(topic.name for topic in info.topics if topic.msgtype == GRID_TYPE)


def _robots_topics(info: SourceInfo) -> list[str]:
    """Return the map topics that may be robots' own: the merged map of an earlier run only where there is no other."""
    topics = _grid_topics(info)
    of_a_run = any(topic.name == REPORT_TOPIC for topic in info.topics)
    return [topic for topic in topics if not (of_a_run and topic == MAP_TOPIC)] or topics


def _discovered(
    runs: Sequence[RunPath],
    infos: Sequence[SourceInfo],
    topics: Sequence[TopicChoice],
    counts: Mapping[str, int],
) -> dict[str, Candidates]:
    """Return for each robot that can be named the map topics that may be its own."""
    found: dict[str, Candidates] = {}
    by_file = file_names(runs)
    for index, (run, info) in enumerate(zip(runs, infos, strict=True)):
        names = names_in(run, by_file[index], _robots_topics(info), topics)
        for topic, robot in names.items():
            if _chosen(robot, topic, topics):
                candidates = found.setdefault(robot, {})
                candidates[topic] = (*candidates.get(topic, ()), index)
    for choice in topics:
        if choice.robot is not None:
            found[choice.robot] = _said_outright(choice, runs, infos)
            found = _without_claimed(found, choice)
    best = {robot: _best(robot, candidates, counts) for robot, candidates in found.items()}
    asked = {run.robot for run in runs} | {choice.robot for choice in topics}
    maps = {robot for robot, candidates in best.items() if not all(map(is_costmap_or_mask, candidates))}
    return {robot: candidates for robot, candidates in best.items() if not maps or robot in maps | asked}


def _without_claimed(found: Mapping[str, Candidates], choice: TopicChoice) -> dict[str, Candidates]:
    """Take a topic that was said to be one robot's from the robot that it was found to be of."""
    claimed = set(found[str(choice.robot)][choice.topic])
    left: dict[str, Candidates] = {}
    for robot, candidates in found.items():
        kept = {
            topic: inputs
            for topic, inputs in candidates.items()
            if robot == choice.robot or topic != choice.topic or not claimed & set(inputs)
        }
        if kept:
            left[robot] = kept
    return left


def _chosen(robot: str, topic: str, topics: Sequence[TopicChoice]) -> bool:
    patterns = [choice.topic.replace("{robot}", robot) for choice in topics if choice.robot is None]
    return not patterns or topic in patterns


def _said_outright(choice: TopicChoice, runs: Sequence[RunPath], infos: Sequence[SourceInfo]) -> Candidates:
    own = [index for index, run in enumerate(runs) if run.robot == choice.robot]
    holders = own or [index for index, run in enumerate(runs) if run.robot is None]
    inputs = tuple(index for index in holders if choice.topic in _grid_topics(infos[index]))
    if not inputs:
        there = _flags({str(choice.robot): [topic for index in holders for topic in _grid_topics(infos[index])]})
        raise UsageError(f"--topic {choice.robot}={choice.topic}: no map on this topic; there are: {there}")
    return {choice.topic: inputs}


def _by_component(
    robot: str,
    runs: Sequence[RunPath],
    infos: Sequence[SourceInfo],
    topics: Sequence[TopicChoice],
    counts: Mapping[str, int],
) -> Candidates:
    """Return the map topics with the robot's name anywhere in their namespace."""
    found: Candidates = {}
    for index, (run, info) in enumerate(zip(runs, infos, strict=True)):
        for topic in _grid_topics(info):
            inside = robot in namespace(topic) or "/".join(namespace(topic)) == robot.strip("/")
            patterned = any(choice.robot is None for choice in topics) and _chosen(robot, topic, topics)
            if run.robot is None and (patterned or (inside and _chosen(robot, topic, topics))):
                found[topic] = (*found.get(topic, ()), index)
    return _best(robot, found, counts)


def _best(robot: str, candidates: Candidates, counts: Mapping[str, int]) -> Candidates:
    """Keep what is most like a robot's map: ``/robot/map``, then ``…/map``, then any map, then costmaps and masks.

    A topic without messages is taken only where there is none with.
    """

    def rank(topic: str) -> tuple[bool, int]:
        empty = counts[topic] == 0
        if is_costmap_or_mask(topic):
            return empty, 3
        if topic == f"/{robot}/map":
            return empty, 0
        return empty, 1 if topic.rsplit("/", 1)[-1] == "map" else 2

    best = min(map(rank, candidates), default=None)
    return {topic: inputs for topic, inputs in candidates.items() if rank(topic) == best}


def _all_names(runs: Sequence[RunPath], found: Mapping[str, Candidates]) -> list[str]:
    """Return all robots: those named with their paths in that order, then the others by name."""
    given = list(dict.fromkeys(run.robot for run in runs if run.robot is not None))
    return [*given, *sorted(set(found) - set(given))]


def _one(robot: str, candidates: Candidates, there: str, found: Mapping[str, Candidates]) -> Selected:
    if not candidates:
        alike = [name for name in found if name.lower() == robot.lower()] or get_close_matches(robot, found, 1)
        meant = f"did you mean {alike[0]!r}? There are" if alike else "there are"
        if not found:
            raise UsageError(f"there is no map of robot {robot!r}; there are: {there}")
        names = listed([f"{name} ({listed(sorted(topics))})" for name, topics in sorted(found.items())])
        example = next(topic for topics in found.values() for topic in topics)
        raise UsageError(
            f"there is no map of robot {robot!r}; {meant} {names}; to say whose map is whose: --topic {robot}={example}"
        )
    if len(candidates) > 1:
        choices = _flags({robot: candidates})
        raise UsageError(f"robot {robot!r} has {len(candidates)} map topics; choose one of: {choices}")
    topic, inputs = next(iter(candidates.items()))
    return Selected(robot, topic, inputs)


def _refuse_shared(selected: Sequence[Selected]) -> None:
    """Refuse two robots that would be fed from the same topic of the same input."""
    owners: dict[tuple[int, str], str] = {}
    for item in selected:
        for index in item.inputs:
            other = owners.setdefault((index, item.topic), item.robot)
            if other != item.robot:
                raise UsageError(
                    f"robots {other!r} and {item.robot!r} would both be fed from {item.topic}; "
                    f"give each its own, as --topic {item.robot}=/its/topic"
                )


def _refuse_unused(selected: Sequence[Selected], topics: Sequence[TopicChoice]) -> None:
    """Refuse a topic that was named without a robot, and would be left out because its robot was given another one."""
    used = {item.topic for item in selected}
    said = {choice.robot: choice.topic for choice in topics if choice.robot is not None}
    for choice in topics:
        if said and choice.robot is None and "{robot}" not in choice.topic and choice.topic not in used:
            others = " ".join(f"--topic {robot}={topic}" for robot, topic in said.items())
            raise UsageError(
                f"--topic {choice.topic}: it is not used beside {others}; "
                f"say whose it is, as --topic NAME={choice.topic}"
            )


def _flags(topics: Mapping[str, Iterable[str]]) -> str:
    """Return the topics of each robot as flags to paste."""
    flags = [f"--topic {robot}={topic}" for robot in sorted(topics) for topic in sorted(set(topics[robot]))]
    return listed(flags, "  ")


def _nothing(runs: Sequence[RunPath], infos: Sequence[SourceInfo], losses: Sequence[Iterable[Loss]]) -> str:
    paths = ", ".join(str(run.path) for run in runs)
    types = sorted({topic.msgtype for info in infos for topic in info.topics if topic.message_count > 0})
    if UPDATE_TYPE in types:
        what = "only updates of parts of maps, no full map"
    else:
        what = f"no map, only {listed([brief(each) for each in types])}" if types else "no messages"
    lost = summed_up((run.path.name, loss) for run, own in zip(runs, losses, strict=False) for loss in own)
    expected = f"expected a topic of type {GRID_TYPE}, such as /r1/map"
    return f"{paths}: {what}; {expected}{f'; {lost}' if lost else ''}"
