"""The settings of a run that was: from its report to what a file of settings would say."""

from __future__ import annotations

from collections.abc import Mapping
from decimal import Decimal
from typing import Any

from replay.init_pose import InitPose
from replay.options import NS_PER_S


def document_of(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return the settings of a report as those of a file; which recordings were read is not among them."""
    outputs = settings.get("outputs") or {}
    document = {
        "robots": settings.get("robots"),
        "topics": [_topic(item) for item in settings["topics"]],
        "time": {
            "clock": settings["clock"],
            "start": _bound(settings["start"]),
            "stop": _bound(settings["stop"]),
            "reorder_window_s": _seconds(settings["reorder_window_ns"]),
            "align_starts": settings["align_starts"],
        },
        "placing": {
            "init_poses": [str(InitPose(**item)) for item in settings["init_poses"]],
            "use_tf": settings["use_tf"],
        },
        "outputs": {
            "images": outputs.get("images"),
            "every_s": None if "every_ns" not in outputs else _seconds(outputs["every_ns"]),
            "copy_maps": outputs.get("copy_maps"),
        },
        "rules": {"max_memory": settings["max_memory_bytes"]},
        "merge": settings["merge"],
    }
    return _without_none(document)


def _topic(item: Mapping[str, str | None]) -> str:
    return str(item["topic"]) if item["robot"] is None else f"{item['robot']}={item['topic']}"


def _bound(item: Mapping[str, Any] | None) -> Decimal | str | None:
    if item is None:
        return None
    return _seconds(item["ns"]) if item["relative"] else f"{item['ns']}ns"


def _seconds(time_ns: int) -> Decimal:
    return Decimal(time_ns) / NS_PER_S


def _without_none(document: Mapping[str, Any]) -> dict[str, Any]:
    return {
        key: _without_none(value) if isinstance(value, dict) else value
        for key, value in document.items()
        if value is not None
    }
