"""The keywords of `replay.merge` as values of `RunOptions`; what is none is refused by the name of its keyword."""

from __future__ import annotations

import inspect
import math
import os
import reprlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from decimal import Decimal
from functools import wraps
from numbers import Integral, Real
from pathlib import Path
from typing import Any, ParamSpec, TypeGuard, TypeVar

from mapmerge.config import MergeConfig
from mapmerge.errors import ConfigError
from replay.errors import UsageError
from replay.footprint import size_to_bytes
from replay.init_pose import InitPose
from replay.options import MOST_NS, NS_PER_S, TimeBound, seconds_to_ns
from replay.plain_text import brief
from replay.runs import RunPath, TopicChoice

_MOST_JOBS = 999
_POSE = "x_m, y_m and yaw_rad, and the standard deviation of each, if any"

_Value = TypeVar("_Value")
_Told = ParamSpec("_Told")


def known_only(function: Callable[_Told, _Value]) -> Callable[_Told, _Value]:
    """Return a function that refuses a keyword which it does not have, with the one that may have been meant.

    For whoever reads or checks types its signature is what it was.
    """
    known = tuple(inspect.signature(function).parameters)

    @wraps(function)
    def call(*args: _Told.args, **told: _Told.kwargs) -> _Value:
        for name in told:
            if name not in known:
                raise UsageError(f"{function.__name__} has no keyword {brief(name)}; {_meant(name, known)}")
        return function(*args, **told)

    return call


def run_paths(runs: object) -> tuple[RunPath, ...]:
    """Read a path, several, or one for each robot by its name."""
    if isinstance(runs, Mapping):
        return tuple(RunPath(_text("runs", robot), path("runs", value)) for robot, value in runs.items())
    several = (
        [runs] if isinstance(runs, (str, os.PathLike)) else _several("runs", runs, "a path, several, or a mapping")
    )
    # a path is one, whatever equals signs are in it
    return tuple(RunPath(None, path("runs", value)) for value in several)


def path(name: str, value: object) -> Path:
    """Read a path."""
    if isinstance(value, (str, os.PathLike)):
        found = os.fspath(value)
        if isinstance(found, str):
            return Path(found)
    raise _wrong(name, value, "a path")


def robot_names(robots: object) -> tuple[str, ...] | None:
    """Read names of robots, each once; None for all."""
    if robots is None:
        return None
    expected = "a list of names, each once, the reference first"
    if isinstance(robots, str):
        raise _wrong("robots", robots, expected)
    names = _several("robots", robots, expected)
    if not names or not all(isinstance(each, str) and each for each in names) or len(set(names)) != len(names):
        raise _wrong("robots", robots, expected)
    return tuple(names)


def topic_choices(topics: object) -> tuple[TopicChoice, ...]:
    """Read a topic for all, several, or one for each robot by its name."""
    if isinstance(topics, Mapping):
        return tuple(TopicChoice(_text("topics", robot), _text("topics", topic)) for robot, topic in topics.items())
    several = [topics] if isinstance(topics, str) else _several("topics", topics, "a topic, several, or a mapping")
    return tuple(_parsed("topics", "--topic ", TopicChoice.parse, _text("topics", each)) for each in several)


def time_bound(name: str, time: object) -> TimeBound | None:
    """Read seconds after the first map, a time, or text that says one of them."""
    if time is None:
        return None
    if isinstance(time, (str, datetime)):
        return _parsed(name, "", TimeBound.parse, time if isinstance(time, str) else time.isoformat())
    return TimeBound(nanoseconds(name, time), relative=True)


def nanoseconds(name: str, seconds: object) -> int:
    """Read a number of seconds, not negative."""
    if not _is_number(seconds) or not 0.0 <= seconds <= MOST_NS // NS_PER_S:
        raise UsageError(f"{name} is {_shown(seconds)}, which is no number of seconds; expected one such as 12.5")
    number = seconds if _is_whole(seconds) else float(seconds)
    return seconds_to_ns(f"{Decimal(str(number)):f}")


def init_poses(poses: object) -> tuple[InitPose, ...]:
    """Read poses by the names of robots, or as they are."""
    if isinstance(poses, Mapping):
        return tuple(_init_pose(_text("init_poses", robot), values) for robot, values in poses.items())
    several = _several("init_poses", poses, f"a mapping of robots to {_POSE}, or InitPose values")
    for each in several:
        if not isinstance(each, InitPose):
            raise _wrong("init_poses", each, "InitPose values, or a mapping of robots to numbers")
    return tuple(several)


def merge_config(config: object, method: object, scale: object, min_confidence: object) -> MergeConfig:
    """Return the settings of the merger with those in place that have keywords of their own."""
    from mapmerge.match import MATCHERS

    if config is None:
        config = MergeConfig()
    if not isinstance(config, MergeConfig):
        raise _wrong("config", config, "a MergeConfig")
    changes: dict[str, Any] = {}
    if method is not None:
        changes["method"] = one_of("method", method, tuple(MATCHERS))
    if scale is not None:
        changes["scale"] = one_of("scale", scale, ("metadata", "free"))
    try:
        if min_confidence is not None:
            if not _is_number(min_confidence):
                raise _wrong("min_confidence", min_confidence, "a number from 0 to 1")
            changes["verify"] = replace(config.verify, min_confidence=float(min_confidence))
        return replace(config, **changes)
    except ConfigError as error:
        raise UsageError(str(error)) from error


def max_memory_bytes(size: object) -> int | None:
    """Read a size: bytes, or text such as ``2GiB``; None for any."""
    if size is None:
        return None
    if isinstance(size, str):
        return _parsed("max_memory", "", size_to_bytes, size)
    if not _is_whole(size) or not 0 <= size <= 1 << 63:
        raise _wrong("max_memory", size, "a number of bytes, or text such as '2GiB'")
    return _parsed("max_memory", "", size_to_bytes, str(int(size)))


def job_count(jobs: object) -> int:
    """Read a number of threads."""
    if not _is_whole(jobs) or not 1 <= jobs <= _MOST_JOBS:
        raise _wrong("jobs", jobs, f"a number of threads, 1 to {_MOST_JOBS}")
    return int(jobs)


def truth(name: str, value: object) -> bool:
    """Read True or False."""
    if not isinstance(value, bool):
        raise _wrong(name, value, "True or False")
    return value


def one_of(name: str, value: object, choices: tuple[str, ...]) -> Any:  # noqa: ANN401 - one of the choices
    """Read one of several names."""
    if not isinstance(value, str) or value not in choices:
        raise _wrong(name, value, f"one of {', '.join(choices)}")
    return value


def _init_pose(robot: str, values: object) -> InitPose:
    name = f"init_poses of {robot}"
    if isinstance(values, (str, bytes)):
        raise _wrong(name, values, _POSE)
    numbers = _several(name, values, _POSE)
    if len(numbers) not in (3, 6):
        raise UsageError(f"{name} has {len(numbers)} numbers; expected {_POSE}")
    for each in numbers:
        if not _is_number(each) or not -math.inf < each < math.inf:
            raise UsageError(f"{name} has {_shown(each)} in it; expected numbers: {_POSE}")
    try:
        return InitPose(robot, *map(float, numbers))
    except OverflowError as error:
        raise UsageError(f"{name} has a number that is too large; expected {_POSE}") from error
    except UsageError as error:
        raise UsageError(f"init_poses: {str(error).removeprefix('--init-pose ')}") from error


def _meant(name: str, known: Iterable[str]) -> str:
    from replay.arguments import closest
    from replay.settings.fields import leaves

    offered = [each for each in known if each != "self"]
    if found := closest(name, offered):
        return f"did you mean {found[0]}?"
    fields = [key for key in leaves() if key.rpartition(".")[2] == name]
    if fields:
        return f"it is {fields[0].replace('merge.', 'config.', 1)}, of a mapmerge.MergeConfig that is given as config"
    return f"expected {', '.join(offered)}"


def _is_number(value: object) -> TypeGuard[float]:
    return isinstance(value, Real) and not isinstance(value, bool)


def _is_whole(value: object) -> TypeGuard[int]:
    return not isinstance(value, bool) and isinstance(value, Integral)


def _text(name: str, value: object) -> str:
    if not isinstance(value, str) or not value:
        raise _wrong(name, value, "text there, and not an empty one")
    return value


def _several(name: str, values: object, expected: str) -> Sequence[Any]:
    if not isinstance(values, Iterable) or isinstance(values, bytes):
        raise _wrong(name, values, expected)
    return list(values)


def _parsed(name: str, flag: str, parse: Callable[[str], _Value], text: str) -> _Value:
    """Return what text says; of what it cannot say, tell which keyword it was, and not which flag."""
    try:
        return parse(text)
    except UsageError as error:
        raise UsageError(f"{name}: {str(error).removeprefix(flag)}") from error


def _wrong(name: str, value: object, expected: str) -> UsageError:
    return UsageError(f"{name} is {_shown(value)}; expected {expected}")


def _shown(value: object) -> str:
    try:
        return reprlib.repr(value)
    except ValueError:  # an int of so many digits that Python does not print it
        return "a number of too many digits"
