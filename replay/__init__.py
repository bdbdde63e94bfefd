"""Offline replay of recorded occupancy grid maps: reads them, merges them step by step, writes what came of it."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from replay.api import MergeRun, merge
    from replay.errors import InputError, OutputError, ReplayError, UsageError
    from replay.events import Finished, Merged, Moved, Noted, Skipped, Started
    from replay.init_pose import InitPose
    from replay.report_file import read_report

__version__ = "0.1.0"

__all__ = [
    "Finished",
    "InitPose",
    "InputError",
    "MergeRun",
    "Merged",
    "Moved",
    "Noted",
    "OutputError",
    "ReplayError",
    "Skipped",
    "Started",
    "UsageError",
    "merge",
    "read_report",
]

_MODULES = {
    "Finished": "events",
    "InitPose": "init_pose",
    "InputError": "errors",
    "MergeRun": "api",
    "Merged": "events",
    "Moved": "events",
    "Noted": "events",
    "OutputError": "errors",
    "ReplayError": "errors",
    "Skipped": "events",
    "Started": "events",
    "UsageError": "errors",
    "merge": "api",
    "read_report": "report_file",
}


def __getattr__(name: str) -> object:
    """Import what is asked for: `import replay` is light."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)


def __dir__() -> list[str]:
    """Return what there is, also what was not asked for yet."""
    return sorted({*globals(), *__all__})
