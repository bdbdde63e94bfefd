"""The paths and topics that a run is told."""

from __future__ import annotations

import re
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from replay.errors import UsageError

_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]*")


@dataclass(frozen=True, slots=True)
class RunPath:
    """One ``RUN`` argument: a path, and the robot that it is of where that was said."""

    robot: str | None
    path: Path

    @staticmethod
    def parse(text: str) -> RunPath:
        """Read ``PATH`` or ``ROBOT=PATH``; a path that exists is a path even if it has an equals sign."""
        name, sign, rest = text.partition("=")
        if not sign or _exists(text):
            return RunPath(None, Path(text))
        if rest and _NAME.fullmatch(name):
            return RunPath(name, Path(rest))
        if not rest or not _exists(rest):
            return RunPath(None, Path(text))
        raise UsageError(f"{text}: {name!r} is no name for a robot; expected letters, digits, '_', '-' and '.'")


def _exists(text: str) -> bool:
    """Tell whether there is a file of this name; what may not be looked up is refused where it is opened."""
    with suppress(OSError):
        return Path(text).exists()
    return False


@dataclass(frozen=True, slots=True)
class TopicChoice:
    """``--topic``: for one robot, or for all with ``{robot}`` in its place."""

    robot: str | None
    topic: str

    @staticmethod
    def parse(text: str) -> TopicChoice:
        """Read ``/{robot}/map`` or ``r1=/x``."""
        name, sign, rest = text.partition("=")
        if not sign:
            name, rest = "", text
        if not rest or (sign and not name):
            raise UsageError(f"--topic {text}: expected a topic such as '/{{robot}}/map', or r1=/r1/map for one robot")
        return TopicChoice(name or None, rest)
