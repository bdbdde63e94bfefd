"""Merging of occupancy grid maps: arrays in, values out.

Nothing here reads a file, looks at a clock or prints; a `Merger` is the only thing that keeps state.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mapmerge.config import (
        CellConfig,
        ExistingConfig,
        MergeConfig,
        PaperConfig,
        RansacConfig,
        RefineConfig,
        SearchConfig,
        SlackConfig,
        VerifyConfig,
        WatchConfig,
    )
    from mapmerge.errors import ConfigError, GridError, MapMergeError
    from mapmerge.fuse import Agreement
    from mapmerge.graph import Placement
    from mapmerge.grid import Grid
    from mapmerge.match import Match, Rival
    from mapmerge.merger import Merger
    from mapmerge.once import merge
    from mapmerge.outcome import Change, ChangeKind, RobotOutcome, Status
    from mapmerge.prior import Prior
    from mapmerge.reasons import Reason, ReasonCode
    from mapmerge.result import MergeResult
    from mapmerge.sim2 import Sim2
    from mapmerge.verify import Scores
    from mapmerge.watch import Trigger

__all__ = [
    "Agreement",
    "CellConfig",
    "Change",
    "ChangeKind",
    "ConfigError",
    "ExistingConfig",
    "Grid",
    "GridError",
    "MapMergeError",
    "Match",
    "MergeConfig",
    "MergeResult",
    "Merger",
    "PaperConfig",
    "Placement",
    "Prior",
    "RansacConfig",
    "Reason",
    "ReasonCode",
    "RefineConfig",
    "Rival",
    "RobotOutcome",
    "Scores",
    "SearchConfig",
    "Sim2",
    "SlackConfig",
    "Status",
    "Trigger",
    "VerifyConfig",
    "WatchConfig",
    "merge",
]

_MODULES = {
    "Agreement": "fuse",
    "CellConfig": "config",
    "Change": "outcome",
    "ChangeKind": "outcome",
    "ConfigError": "errors",
    "ExistingConfig": "config",
    "Grid": "grid",
    "GridError": "errors",
    "MapMergeError": "errors",
    "Match": "match",
    "MergeConfig": "config",
    "MergeResult": "result",
    "Merger": "merger",
    "PaperConfig": "config",
    "Placement": "graph",
    "Prior": "prior",
    "RansacConfig": "config",
    "Reason": "reasons",
    "ReasonCode": "reasons",
    "RefineConfig": "config",
    "Rival": "match",
    "RobotOutcome": "outcome",
    "Scores": "verify",
    "SearchConfig": "config",
    "Sim2": "sim2",
    "SlackConfig": "config",
    "Status": "outcome",
    "Trigger": "watch",
    "VerifyConfig": "config",
    "WatchConfig": "config",
    "merge": "once",
}


def __getattr__(name: str) -> object:
    """Import what is asked for: who needs a map alone does not wait for all that merges maps."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)


def __dir__() -> list[str]:
    """Return what there is, also what was not asked for yet."""
    return sorted({*globals(), *__all__})
