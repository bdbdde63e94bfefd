"""What robots are called: after their topics' namespaces or, where those have none, after their files."""

from __future__ import annotations

import re
from collections.abc import Sequence

from replay.runs import RunPath, TopicChoice

_NOT_A_MAP = re.compile(r"(^|[/_])(costmap|mask|keepout|speed)([/_]|$)", re.IGNORECASE)
_SUFFIXES = (".zstd", ".zst", ".bag", ".db3", ".mcap", ".yaml", ".yml")


def is_costmap_or_mask(topic: str) -> bool:
    """Tell whether a topic's name says that it is no map of a robot's surroundings, though it has that type."""
    return _NOT_A_MAP.search(topic) is not None


def names_in(run: RunPath, file_name: str, topics: Sequence[str], choices: Sequence[TopicChoice]) -> dict[str, str]:
    """Return the robot of each map topic of one input; ``file_name`` names one whose topics have no namespace."""
    if run.robot is not None:
        return dict.fromkeys(topics, run.robot)
    patterns = [choice.topic for choice in choices if choice.robot is None and "{robot}" in choice.topic]
    if patterns:
        return _named_by_patterns(topics, patterns)
    named = [topic for topic in topics if namespace(topic)]
    if any(not is_costmap_or_mask(topic) for topic in named):
        return _named_by_namespace(named)
    bare = [topic for topic in topics if not namespace(topic)]
    return dict.fromkeys(bare, file_name) if bare else _named_by_namespace(named)


def _named_by_patterns(topics: Sequence[str], patterns: Sequence[str]) -> dict[str, str]:
    """Name robots by what stands at ``{robot}`` in the patterns that their topics fit."""
    names = {}
    for pattern in patterns:
        before, *after = map(re.escape, pattern.split("{robot}"))
        shape = re.compile(before + "([^/]+)" + r"\1".join(after))
        names.update({topic: match[1] for topic in topics if (match := shape.fullmatch(topic))})
    return names


def _named_by_namespace(topics: Sequence[str]) -> dict[str, str]:
    """Name robots by the first part of the namespace or, where all share that, by the last."""
    maps = [topic for topic in topics if not is_costmap_or_mask(topic)] or list(topics)
    names = {}
    for topic in maps:
        first = namespace(topic)[0]
        alike = {other: namespace(other) for other in maps if namespace(other)[0] == first}
        distinct = len({space[-1] for space in alike.values()})
        nested = all(len(space) > 1 for space in alike.values())
        fleet = nested and distinct == len(alike) == len(maps) > 1
        names[topic] = namespace(topic)[-1] if fleet else first
    return names


def namespace(topic: str) -> list[str]:
    """Return the parts of a topic but the last."""
    return [part for part in topic.split("/") if part][:-1]


def file_names(runs: Sequence[RunPath]) -> list[str]:
    """Name robots by their files where nothing else does: two of one name have their folder's name in front."""
    paths = [run.path.resolve() for run in runs]
    stems = [stem_of(path.name) for path in paths]
    return [
        f"{stem_of(path.parent.name)}_{stem}" if stems.count(stem) > 1 else stem
        for path, stem in zip(paths, stems, strict=True)
    ]


def stem_of(name: str) -> str:
    """Return a robot's name from that of a file or folder."""
    for suffix in _SUFFIXES:
        name = name.removesuffix(suffix)
    return re.sub(r"[^A-Za-z0-9_.-]", "_", name)
