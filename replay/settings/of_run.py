"""The settings of a run that was: from its report to what a file of settings would say."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from decimal import Decimal
from typing import Any

from replay.documents import Node
from replay.init_pose import InitPose
from replay.options import NS_PER_S


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
        "topics": [_topic(item) for item in settings.need("topics").elements()],
        "time": {
            "clock": settings.need("clock").text(),
            "start": settings.maybe("start", _bound),
            "stop": settings.maybe("stop", _bound),
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


def _outputs(node: Node) -> dict[str, Any]:
    return {
        "images": node.maybe("images", Node.text),
        "every_s": node.maybe("every_ns", _seconds),
        "copy_maps": node.maybe("copy_maps", Node.truth),
    }


def _texts(node: Node) -> list[str]:
    return list(node.texts())


def _topic(node: Node) -> str:
    robot, topic = node.maybe("robot", Node.text), node.need("topic").text()
    return topic if robot is None else f"{robot}={topic}"


def _init_pose(node: Node) -> InitPose:
    robot, *numbers = (item.name for item in fields(InitPose))
    return InitPose(node.need(robot).text(), *(node.need(name).number() for name in numbers))


def _bound(node: Node) -> Decimal | str:
    time = node.need("ns")
    return _seconds(time) if node.need("relative").truth() else f"{time.whole()}ns"


def _seconds(node: Node) -> Decimal:
    return Decimal(node.whole()) / NS_PER_S


def _without_none(document: Mapping[str, Any]) -> dict[str, Any]:
    return {
        key: _without_none(value) if isinstance(value, dict) else value
        for key, value in document.items()
        if value is not None
    }
