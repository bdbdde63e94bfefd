"""The settings of a run that was: from its report to what a file of settings would say."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from decimal import Decimal
from typing import Any

from replay.documents import Node
from replay.init_pose import InitPose
from replay.options import MOST_NS, NS_PER_S, ClockChoice, TimeBound
from replay.runs import TopicChoice


def document_of(settings: Node) -> dict[str, Any]:
    """Return the settings of a report as those of a file; which recordings were read is not among them.

    Raises
    ------
    InputError
        If what a run writes is missing or of another kind.
    """
    outputs = settings.get("outputs")
    document = {
        "robots": settings.maybe("robots", _texts),
        "topics": [_said_topic(choice) for choice in topics_of(settings)],
        "time": {
            "clock": clock_of(settings),
            "start": settings.maybe("start", _said_bound),
            "stop": settings.maybe("stop", _said_bound),
            "reorder_window_s": _seconds(settings.need("reorder_window_ns")),
            "align_starts": settings.need("align_starts").truth(),
        },
        "placing": {
            "init_poses": [str(_init_pose(item)) for item in settings.need("init_poses").elements()],
            "use_tf": settings.need("use_tf").truth(),
        },
        "outputs": {} if outputs is None else _outputs(outputs),
        "rules": {"max_memory": settings.maybe("max_memory_bytes", Node.whole)},
        "merge": {key: item.value for key, item in settings.need("merge").items()},
    }
    return _without_none(document)


def clock_of(settings: Node) -> ClockChoice:
    """Return what times were taken from.

    Raises
    ------
    InputError
        If it says neither.
    """
    clock = settings.need("clock")
    if clock.value not in ("header", "log"):
        clock.refuse("header or log")
    return "log" if clock.value == "log" else "header"


def topics_of(settings: Node) -> tuple[TopicChoice, ...]:
    """Return the topics that a run was told.

    Raises
    ------
    InputError
        If these are none.
    """
    return tuple(_topic(item) for item in settings.need("topics").elements())


def reading_of(settings: Node) -> dict[str, Any]:
    """Return how the recordings of a run were read, as keywords of `RunOptions`.

    Raises
    ------
    InputError
        If what a run writes is missing or of another kind.
    """
    return {
        "topics": topics_of(settings),
        "clock": clock_of(settings),
        "start": settings.maybe("start", _bound),
        "stop": settings.maybe("stop", _bound),
        "reorder_window_ns": _nanoseconds(settings.need("reorder_window_ns")),
        "align_starts": settings.need("align_starts").truth(),
        "max_memory_bytes": settings.maybe("max_memory_bytes", Node.whole),
    }


def _outputs(node: Node) -> dict[str, Any]:
    return {
        "images": node.maybe("images", Node.text),
        "every_s": node.maybe("every_ns", _seconds),
        "copy_maps": node.maybe("copy_maps", Node.truth),
    }


def _texts(node: Node) -> list[str]:
    return list(node.texts())


def _topic(node: Node) -> TopicChoice:
    return TopicChoice(node.maybe("robot", Node.text), node.need("topic").text())


def _said_topic(choice: TopicChoice) -> str:
    return choice.topic if choice.robot is None else f"{choice.robot}={choice.topic}"


def _init_pose(node: Node) -> InitPose:
    robot, *numbers = (item.name for item in fields(InitPose))
    return InitPose(node.need(robot).text(), *(node.need(name).number() for name in numbers))


def _bound(node: Node) -> TimeBound:
    is_relative = node.need("relative").truth()
    return TimeBound(_nanoseconds(node.need("ns"), 0 if is_relative else -MOST_NS), relative=is_relative)


def _said_bound(node: Node) -> Decimal | str:
    bound = _bound(node)
    return Decimal(bound.ns) / NS_PER_S if bound.relative else f"{bound.ns}ns"


def _seconds(node: Node) -> Decimal:
    return Decimal(_nanoseconds(node)) / NS_PER_S


def _nanoseconds(node: Node, least: int = 0) -> int:
    value = node.value
    if isinstance(value, int) and not isinstance(value, bool) and least <= value <= MOST_NS:
        return value
    return node.refuse("a whole number of nanoseconds" if least else "a whole number, 0 or more")


def _without_none(document: Mapping[str, Any]) -> dict[str, Any]:
    return {
        key: _without_none(value) if isinstance(value, dict) else value
        for key, value in document.items()
        if value is not None
    }
