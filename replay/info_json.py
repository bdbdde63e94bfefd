"""What recordings hold, and what would be merged, for programs."""

from __future__ import annotations

import json
from typing import Any

from replay.info import InputSummary, RunSummary, TopicSummary
from replay.plain_text import plain_json
from replay.sources.losses import Loss

SCHEMA = "replay.info/1"


def info_text(summary: RunSummary) -> str:
    """Return the summary as JSON: indented, in its own order, ending in a newline."""
    return plain_json(json.dumps(as_json(summary), indent=2, ensure_ascii=False, allow_nan=False)) + "\n"


def as_json(summary: RunSummary) -> dict[str, Any]:
    """Return the summary as JSON values; lengths are in metres, durations in seconds, and what is absent is None."""
    return {
        "schema": SCHEMA,
        "inputs": [_input(item) for item in summary.inputs],
        "robots": [
            {"robot": robot, "map_topic": topic, "has_map": (robot, topic) not in summary.mapless}
            for robot, topic in summary.robots
        ],
        "unused_topics": list(summary.unused),
        "problem": summary.problem,
    }


def _input(item: InputSummary) -> dict[str, Any]:
    return {
        "path": str(item.path),
        "format": item.format,
        "duration_s": item.duration_s,
        "messages": item.messages,
        "topics": [_topic(topic) for topic in item.topics],
        "losses": [_loss(loss) for loss in item.losses],
    }


def _topic(topic: TopicSummary) -> dict[str, Any]:
    return {
        "name": topic.name,
        "type": topic.msgtype,
        "messages": topic.messages,
        "unusable": topic.unusable,
        "sizes_cells": [{"cols": cols, "rows": rows} for cols, rows in topic.sizes],
        "resolutions_m": list(topic.resolutions_m),
        "frames": list(topic.frames),
        "header_times": topic.header_times,
    }


def _loss(loss: Loss) -> dict[str, Any]:
    return {"cause": str(loss.cause), "place": loss.place, "messages": loss.messages, "detail": loss.detail}
