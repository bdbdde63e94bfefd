"""Merging of occupancy grid maps: arrays in, values out.

Nothing here reads a file, looks at a clock or prints; a `Merger` is the only thing that keeps state.
"""

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
