"""Recordings that take long to make are made once and kept in a folder, with their truth beside them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol


class Recordable(Protocol):
    """Something that can be recorded: the same value gives the same recording."""

    @property
    def name(self) -> str:
        """What its recording is called: no two that differ have the same."""

    def record(self, path: Path) -> Mapping[str, Any]:
        """Write the recording and return its truth."""


def recorded(mission: Recordable, folder: Path) -> Path:
    """Return the recording of a mission in a folder; it is made if it is not there."""
    path = folder / f"{mission.name}.mcap"
    if not path.exists():
        partial = path.with_suffix(".partial")
        partial.unlink(missing_ok=True)
        found = mission.record(partial)
        path.with_suffix(".truth.json").write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
        partial.replace(path)
    return path
