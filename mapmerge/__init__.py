"""Merging of occupancy grid maps: arrays in, values out.

Nothing here reads a file, looks at a clock or prints; a `Merger` is the only thing that keeps state.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mapmerge.config import MergeConfig
    from mapmerge.errors import ConfigError, GridError, MapMergeError
    from mapmerge.grid import Grid
    from mapmerge.match import Match
    from mapmerge.merger import Merger, MergeResult
    from mapmerge.outcome import RobotOutcome, Status
    from mapmerge.reasons import Reason, ReasonCode
    from mapmerge.sim2 import Sim2

__all__ = [
    "ConfigError",
    "Grid",
    "GridError",
    "MapMergeError",
    "Match",
    "MergeConfig",
    "MergeResult",
    "Merger",
    "Reason",
    "ReasonCode",
    "RobotOutcome",
    "Sim2",
    "Status",
]

_MODULES = {
    "ConfigError": "errors",
    "Grid": "grid",
    "GridError": "errors",
    "MapMergeError": "errors",
    "Match": "match",
    "MergeConfig": "config",
    "MergeResult": "merger",
    "Merger": "merger",
    "Reason": "reasons",
    "ReasonCode": "reasons",
    "RobotOutcome": "outcome",
    "Sim2": "sim2",
    "Status": "outcome",
}


def __getattr__(name: str) -> object:
    """Import what is asked for: who needs a map alone does not wait for all that merges maps."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
