"""What the outcome is of: inputs, settings, versions, and how to run it again."""

from __future__ import annotations

import json
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from replay.figures import size
from replay.html.story import Story
from replay.options import DEFAULT_REORDER_WINDOW_NS, NS_PER_S, OutputOptions, RunOptions
from replay.robot_names import stem_of
from replay.words import moment

_FLAGS_OF_MERGE = {"merge.method", "merge.scale", "merge.verify.min_confidence"}
_DEFAULTS = {**RunOptions(()).settings(), "outputs": OutputOptions(Path()).settings("changed")}


@dataclass(frozen=True, slots=True)
class Setting:
    """A setting, its value, and what that is by itself where it differs."""

    name: str
    value: str
    default: str | None


@dataclass(frozen=True, slots=True)
class Input:
    """A recording that was read."""

    name: str
    format: str
    size: str
    robots: str
    messages: int
    sha256: str


@dataclass(frozen=True, slots=True)
class Provenance:
    """All of it.

    Parameters
    ----------
    changed
        Settings that are not the default ones.
    settings
        All settings.
    command
        How to run it again; None where that cannot be said.
    why_not
        Why it cannot.
    """

    inputs: tuple[Input, ...]
    changed: tuple[Setting, ...]
    settings: tuple[Setting, ...]
    command: str | None
    why_not: str
    version: str
    first: str
    last: str


def provenance(story: Story) -> Provenance:
    """Return what a reader needs to have the same again."""
    report = story.report
    ours = dict(_flat(_DEFAULTS))
    settings = tuple(
        Setting(name, _text(value), None if value == ours.get(name) else _text(ours.get(name)))
        for name, value in _flat(story.settings)
    )
    changed = tuple(item for item in settings if item.default is not None)
    again, why_not = command(story)
    return Provenance(
        tuple(_input(item) for item in report["inputs"]),
        changed,
        settings,
        again,
        why_not,
        report["version"],
        moment(story.first_ns) if story.series.ticks else "",
        moment(story.last_ns) if story.series.ticks else "",
    )


def command(story: Story) -> tuple[str | None, str]:
    """Return the command that gives this outcome in the folder of its inputs or, if there is none, why."""
    inputs = story.report["inputs"]
    names = [str(item["name"]) for item in inputs]
    if len(set(names)) < len(names):
        return None, "Several recordings have the same name, and lay in different folders."
    if not all(names):
        return None, "A recording was given as a folder without its name."
    if any(_is_named_by_folder(item, inputs) for item in inputs):
        return None, "Robots are called after the folders in which their recordings lay."
    found = shlex.join(["replay", "merge", *_runs(story), *_flags(story)])
    if not found.isprintable():
        return None, "A name in it holds characters that cannot be typed."
    return found, ""


def _is_named_by_folder(item: Mapping[str, Any], inputs: Sequence[Mapping[str, Any]]) -> bool:
    """Tell whether a robot was named by its file, and by the folder of that, as another file has the same stem."""
    stem = stem_of(item["name"])
    alike = sum(stem_of(other["name"]) == stem for other in inputs)
    return alike > 1 and item["said_of"] is None and any(robot.endswith(f"_{stem}") for robot in item["robots"])


def _runs(story: Story) -> Iterator[str]:
    """Yield the recordings as they were given, for what was said of one decides what its robots are called."""
    for item in story.report["inputs"]:
        name = str(item["name"])
        if item["said_of"] is not None:
            yield f"{item['said_of']}={name}"
        else:
            yield f"./{name}" if name.startswith("-") else name  # which would be taken for a flag


def _flags(story: Story) -> Iterator[str]:
    said = story.settings
    if said["robots"] is not None:
        yield from ("--robots", ",".join(said["robots"]))
    for choice in said["topics"]:
        yield from ("--topic", f"{choice['robot']}={choice['topic']}" if choice["robot"] else str(choice["topic"]))
    if said["clock"] != "header":
        yield from ("--clock", str(said["clock"]))
    for name in ("start", "stop"):
        bound = said[name]
        if bound is not None:
            yield from (f"--{name}", _seconds(bound["ns"]) if bound["relative"] else f"{bound['ns']}ns")
    if said["reorder_window_ns"] != DEFAULT_REORDER_WINDOW_NS:
        yield from ("--reorder-window", _seconds(said["reorder_window_ns"]))
    if said["align_starts"]:
        yield "--align-starts"
    if said["max_memory_bytes"] is not None:
        yield from ("--max-memory", f"{said['max_memory_bytes']}")
    yield from _placing_flags(said)
    yield from _threshold_flags(said)
    yield from _output_flags(said["outputs"] or _DEFAULTS["outputs"])


def _placing_flags(said: Mapping[str, Any]) -> Iterator[str]:
    from replay.init_pose import InitPose

    ours = RunOptions(()).merge
    for pose in said["init_poses"]:
        yield from ("--init-pose", str(InitPose(**pose)))
    if said["use_tf"]:
        yield "--use-tf"
    merge = said["merge"]
    for flag, value, default in (
        ("--method", merge["method"], ours.method),
        ("--scale", merge["scale"], ours.scale),
        ("--min-confidence", merge["verify"]["min_confidence"], ours.verify.min_confidence),
    ):
        if value != default:
            yield from (flag, str(value))


def _threshold_flags(said: Mapping[str, Any]) -> Iterator[str]:
    """Yield what has no flag of its own."""
    ours = dict(_flat({"merge": _DEFAULTS["merge"]}))
    for name, value in _flat({"merge": said["merge"]}):
        if value != ours.get(name) and name not in _FLAGS_OF_MERGE:
            yield from ("--set", f"{name}={_text(value)}")


def _output_flags(outputs: Mapping[str, Any]) -> Iterator[str]:
    """Yield what decides what the MCAP holds."""
    if outputs["images"] != _DEFAULTS["outputs"]["images"]:
        yield from ("--images", str(outputs["images"]))
    if outputs["every_ns"]:
        yield from ("--every", _seconds(outputs["every_ns"]))
    if outputs["copy_maps"]:
        yield "--copy-maps"


def _seconds(time_ns: int) -> str:
    whole, rest = divmod(time_ns, NS_PER_S)
    return f"{whole}.{rest:09}".rstrip("0").rstrip(".")


def _input(item: Mapping[str, Any]) -> Input:
    return Input(
        str(item["name"]),
        str(item["format"]),
        size(item["size_bytes"]),
        ", ".join(item["robots"]),
        int(item["messages"]),
        str(item["sha256"] or ""),
    )


def _flat(values: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, Any]]:
    """Yield settings by their full names."""
    for name, value in values.items():
        if isinstance(value, dict) and name not in ("start", "stop"):
            yield from _flat(value, f"{before}{name}.")
        else:
            yield f"{before}{name}", value


def _text(value: Any) -> str:  # noqa: ANN401 - any JSON value
    return json.dumps(value, ensure_ascii=False)
